"""Axes and notes that the figures share."""

import textwrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure

__all__ = ["axes", "note"]


def axes(
    figure: Figure, title: str, x: str, y: str, *, x_log: bool = False, y_log: bool = False
) -> Axes:
    """Add the only axes of a figure, with title, labels and grid."""
    ax = figure.add_subplot()
    ax.set_title(title, fontsize=10)
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    if x_log:
        ax.set_xscale("log")
    if y_log:
        ax.set_yscale("log")
    ax.grid(visible=True, which="major", alpha=0.4)
    ax.grid(visible=True, which="minor", alpha=0.12)
    return ax


def note(figure: Figure, text: str) -> None:
    """State below the axes the parameters that the thesis's caption lacks."""
    figure.supxlabel("\n".join(textwrap.wrap(text, 115)), fontsize=7, color="0.35")
