"""The thesis's figures, drawn from this code; needs matplotlib.

A figure is a function that draws into an empty `matplotlib.figure.Figure`; it is added by writing
one and entering it in `FIGURES`.
"""

from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from simulator.optics.figures import appendix_a, chapter2, chapter3, chapter4, chapter5, quality

__all__ = ["FIGURES", "draw"]

FIGURES: dict[str, Callable[[Figure], None]] = {
    **chapter2.FIGURES,
    **chapter3.FIGURES,
    **chapter4.FIGURES,
    **chapter5.FIGURES,
    **appendix_a.FIGURES,
    **quality.FIGURES,
}


def draw(name: str, directory: Path, file_format: str = "png") -> Path:
    """Draw a figure into a directory and return the path of its file.

    Parameters
    ----------
    name : str
        Key of `FIGURES`, the thesis's number of the figure, such as "3-1".
    directory : Path
        Must exist.
    file_format : str
        png, svg or pdf.

    Raises
    ------
    KeyError
        If there is no such figure.
    """
    figure = Figure(figsize=(7.0, 5.0), dpi=130, layout="constrained")
    FIGURES[name](figure)
    path = directory / f"figure_{name}.{file_format}"
    figure.savefig(path)
    return path
