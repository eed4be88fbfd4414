"""The picture of coverage: share inside and relative width, by class and term."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from benchmarks.coverage.report import GOAL, Coverage

__all__ = ["draw"]

_COLOURS = {"exact": "tab:red", "default": "tab:blue", "walked": "tab:green"}
_LABELS = {
    "exact": "model taken for exact",
    "default": "nothing stated",
    "walked": "nothing stated, by walkers",
}


def draw(found: Sequence[Coverage], path: Path) -> None:
    """Draw a row a class."""
    names = list(dict.fromkeys(each.name for each in found))
    terms = [term for term in _COLOURS if any(each.term == term for each in found)]
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(10, 0.8 + 0.42 * len(names)), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3, 2))
        left.axvspan(100 * GOAL[0], 100 * GOAL[1], color="0.9", lw=0)
        left.axvline(90, color="0.5", lw=0.7)
        for k, term in enumerate(terms):
            here = [each for each in found if each.term == term]
            height = np.array([names.index(each.name) for each in here])
            height = height + 0.22 * (k - (len(terms) - 1) / 2)
            inside = 100 * np.array([each.inside for each in here])
            bounds = 100 * np.array([[each.low, each.high] for each in here])
            left.errorbar(
                inside,
                height,
                xerr=np.abs(bounds.T - inside),
                fmt="o",
                ms=4,
                lw=1.2,
                color=_COLOURS[term],
                label=_LABELS[term],
            )
            widths = 100 * np.array([each.width for each in here])
            right.plot(widths, height, "o", ms=4, color=_COLOURS[term])
        left.set_yticks(range(len(names)), names)
        left.invert_yaxis()
        left.set_xlim(-2, 102)
        left.set_xlabel("90 % intervals of r that hold the truth [%]\n(95 % bootstrap; grey: goal)")
        right.set_xscale("log")
        right.xaxis.set_major_formatter("{x:g}")
        right.xaxis.set_minor_formatter("{x:g}")
        right.tick_params(axis="x", which="minor", labelsize=7)
        right.set_xlabel("median relative width [%]")
        right.grid(axis="x", color="0.9")
        figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=3)
        figure.savefig(path, dpi=110)
