"""The picture: relative error of R against the signal-to-noise ratio, for three spans of range."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from benchmarks.unknown_background.cells import SNRS, SPANS, Cell, prior_sd

__all__ = ["draw"]

_COLOURS = ("tab:blue", "tab:orange", "tab:red")
_LIMITS = (1e-5, 1e3)


def _panel(axis: Axes, case: str, distance: float, rows: Sequence[Mapping[str, str]]) -> None:
    snrs = np.geomspace(SNRS[0], SNRS[-1], 33)
    prior = prior_sd()
    axis.axhspan(0.7 * prior, _LIMITS[1], color="0.90", lw=0)
    axis.axhline(prior, color="0.55", lw=0.8)
    axis.axhline(0.1, color="0.55", lw=0.8, ls=":")
    for span, colour in zip(SPANS, _COLOURS, strict=True):
        foreseen = [Cell(case, distance, span, float(snr), 0).foreseen() for snr in snrs]
        axis.plot(snrs, [f.bound for f in foreseen], color=colour, lw=0.9, ls="--")
        axis.plot(snrs, [f.predicted for f in foreseen], color=colour, lw=1.5)
        for row in rows:
            if (float(row["from_m"]), float(row["to_m"])) != span:
                continue
            good = row["converged"] == "1"
            axis.plot(
                float(row["snr"]),
                float(row["sd"]),
                marker="o",
                ms=6,
                color=colour,
                mfc=colour if good else "white",
                mew=1.2,
                zorder=3,
            )
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_ylim(*_LIMITS)
    axis.grid(visible=True, alpha=0.3)
    shadow = "the object's own shadow" if case == "A" else "a shadow of unknown shape"
    axis.set_title(f"R = {distance:g} m, {shadow}", fontsize=9)


def draw(rows: Sequence[Mapping[str, str]], path: Path) -> None:
    """Draw a panel for each case and distance."""
    with mpl.rc_context({"font.size": 8.5, "svg.hashsalt": "unknown background"}):
        figure = Figure(figsize=(9.5, 7.6), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True, sharey=True)
        for line, case in zip(axes, "AB", strict=True):
            for axis, distance in zip(line, (3.0, 10.0), strict=True):
                here = [
                    row
                    for row in rows
                    if row["case"] == case and float(row["distance_m"]) == distance
                ]
                _panel(axis, case, distance, here)
        handles = [
            *(
                Line2D([], [], color=colour, lw=1.5, label=f"object moves over {low:g}-{high:g} m")
                for (low, high), colour in zip(SPANS, _COLOURS, strict=True)
            ),
            Line2D([], [], color="0.3", lw=0.9, ls="--", label="Cramer-Rao bound, no prior"),
            Line2D([], [], color="0.3", lw=1.5, label="predicted posterior, prior included"),
            Line2D([], [], color="0.3", marker="o", ls="", label="posterior, converged"),
            Line2D(
                [],
                [],
                color="0.3",
                marker="o",
                mfc="white",
                ls="",
                label="posterior, not converged",
            ),
            Patch(color="0.90", label="no more than the prior: impossible"),
            Line2D([], [], color="0.55", lw=0.8, ls=":", label="10 %"),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
        for axis in axes[1]:
            axis.set_xlabel(
                "signal-to-noise ratio of the whole reading at the middle of the stroke"
            )
        figure.supylabel("standard deviation of log R (all of object and background unknown)")
        figure.suptitle("Unknown background distance R, 40 frames", fontsize=10)
        figure.savefig(path, dpi=110)
