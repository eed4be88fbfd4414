"""Labels beside the curves of a picture, placed when all of it is there."""

import math
from collections.abc import Iterable
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

__all__ = ["SIZE", "Labels", "place_all"]

SIZE = 8.0
"""Of labels, in points."""
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# where a label may stand about its point, in points: tried one after the other
_PLACES = [
    (x, y)
    for y in (0, 9, -9, 18, -18, 27, -27, 36, -36, 48, -48)
    for x in ((7, "left"), (-7, "right"))
]


class Labels(NamedTuple):
    """Labels of the curves of a panel, with what they shall not cover."""

    axes: Axes
    labels: list[tuple[float, float, str, str]]
    points: list[tuple[float, float]]
    line: float | None = None


def _decade(value: float, _: int | None = None) -> str:
    return f"10{str(round(math.log10(value))).translate(_RAISED)}"


def place_all(figure: Figure, panels: Iterable[Labels]) -> None:
    """Lay the figure out once, and put the labels of all panels where nothing moves any more."""
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        # plain text: laying out formulas, one of them empty at every minor tick, takes seconds
        axis.set_major_formatter(FuncFormatter(_decade))
        axis.set_minor_formatter(NullFormatter())
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for panel in panels:
        _place(figure.dpi / 72.0, *panel)


def _place(
    per_point: float,
    axes: Axes,
    labels: list[tuple[float, float, str, str]],
    points: list[tuple[float, float]],
    line: float | None = None,
) -> None:
    """Put every label beside its point where it covers neither a point, label nor the line."""
    transform = axes.transData.transform
    taken = [(x - 4, y - 4, x + 4, y + 4) for x, y in map(transform, points)]
    frame = axes.get_window_extent()
    if line:
        height = transform((1.0, line))[1]
        taken.append((frame.x0, height - 1, frame.x1, height + 1))
    for x, y, text, colour in sorted(labels, key=lambda label: label[1]):
        px, py = transform((x, y))
        width, height = 0.56 * SIZE * len(text) * per_point, 1.15 * SIZE * per_point
        best = None
        for (dx, side), dy in _PLACES:
            left = px + dx * per_point - (width if side == "right" else 0)
            low = py + dy * per_point - height / 2
            box = (left, low, left + width, low + height)
            inside = box[0] > frame.x0 + 14 and box[2] < frame.x1
            hit = sum(
                box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in taken
            )
            cost = (0 if inside else 5) + hit
            if best is None or cost < best[0]:
                best = (cost, dx, dy, side, box)
            if cost == 0:
                break
        if best is None:
            continue
        _, dx, dy, side, box = best
        taken.append(box)
        axes.annotate(
            text,
            (x, y),
            (dx, dy),
            textcoords="offset points",
            ha=side,
            va="center",
            color=colour,
            fontsize=SIZE,
            bbox={"facecolor": "white", "alpha": 0.7, "lw": 0, "pad": 0.3},
            arrowprops={"arrowstyle": "-", "color": colour, "lw": 0.5} if abs(dy) > 10 else None,
        )
