"""The picture of the tables: distribution functions of the ranks, with simultaneous bands."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from benchmarks.calibration.ranks import DRAWS
from benchmarks.calibration.report import CellRanks
from benchmarks.calibration.uniformity import ecdf_difference, simultaneous_band

__all__ = ["draw"]

_COLUMNS = 4
_STYLES = {"unknown": "tab:blue", "range": "tab:orange", "log density": "black"}


def _style(name: str) -> str:
    if name == "log density":
        return name
    return "range" if name.startswith("range ") else "unknown"


def draw(found: Sequence[CellRanks], path: Path) -> None:
    """Draw a panel a cell."""
    found = [cell for cell in found if cell.sets]
    rows = -(-(len(found) + 1) // _COLUMNS)
    with mpl.rc_context({"font.size": 8, "svg.hashsalt": "calibration"}):
        figure = Figure(figsize=(11, 2.3 * rows), layout="constrained")
        axes = figure.subplots(rows, _COLUMNS, sharex=True, squeeze=False).ravel()
        grid = np.arange(1, DRAWS + 1) / (DRAWS + 1)
        for axis, cell in zip(axes, found, strict=False):
            band = simultaneous_band(cell.sets, 0.05 / len(cell.ranks))
            axis.fill_between(grid, *band, step="mid", color="0.88", lw=0)
            axis.axhline(0.0, color="0.6", lw=0.6)
            for name, ranks in cell.ranks.items():
                kind = _style(name)
                axis.plot(grid, ecdf_difference(ranks), lw=0.9, color=_STYLES[kind], alpha=0.8)
            axis.tick_params(labelbottom=True)
            axis.set_title(f"{cell.cell.name}\n{cell.sets} sets", fontsize=8)
            top = 1.35 * float(np.abs(band).max())
            axis.set_ylim(-top, top)
        for axis in axes[len(found) :]:
            axis.set_axis_off()
        lines = [Line2D([], [], color=color, label=name) for name, color in _STYLES.items()]
        handles = [*lines, Patch(color="0.88", label="95 % of even ranks,\nwhole panel")]
        axes[len(found)].legend(handles=handles, loc="center", frameon=False)
        figure.supxlabel("rank of the truth / number of draws")
        figure.supylabel("distribution function of the ranks minus the even one")
        figure.savefig(path, dpi=110)
