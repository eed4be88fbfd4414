"""Work against precision, one panel a scene."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from service.report.measure import Row

__all__ = ["draw"]


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw median relative error against run time a frame.

    Parameters
    ----------
    rows : sequence of Row
        The report.
    path : Path
        The image; its suffix says which format.
    """
    scenes = list(dict.fromkeys(row.scene for row in rows))
    names = list(dict.fromkeys(row.technique for row in rows))
    colours = dict(zip(names, colormaps["tab10"](range(10)), strict=False))
    figure = Figure(figsize=(12, 8), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    for axes, scene in zip(panels, scenes, strict=True):
        for name in names:
            chosen = [r for r in rows if (r.scene, r.technique) == (scene, name)]
            chosen = [r for r in chosen if r.median_error is not None]
            if not chosen:
                continue
            # hollow: told that what disturbs it is not there
            hollow = "as if" in chosen[0].remark
            axes.loglog(
                [r.frame_s for r in chosen],
                [r.median_error or 0.0 for r in chosen],
                "-o" if len(chosen) > 1 else "o",
                ms=8,
                color=colours[name],
                mfc="none" if hollow else colours[name],
                label=name,
            )
        axes.set_title(scene, fontsize=10)
        axes.grid(alpha=0.3)
    for axes in panels[2:]:
        axes.set_xlabel("run time a frame [s]")
    for axes in panels[::2]:
        axes.set_ylabel("median relative error of single ranges")
    found: dict[str, Artist] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    figure.legend(
        handles=list(found.values()),
        labels=list(found),
        loc="outside lower center",
        ncols=4,
        fontsize=9,
    )
    figure.suptitle(
        "Error against run time. Hollow: crosstalk or background present and not told.", fontsize=11
    )
    figure.savefig(path, dpi=110)
