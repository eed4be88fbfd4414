"""The answers as a picture: where others are wrong, and where two ranges explain a frame."""

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from service.demo.answers import Answer, Episode, Point

__all__ = ["draw"]

# distinguishable without colour vision (Okabe and Ito)
_COLOURS = {
    "conventional": "#d55e00",
    "joint_fit": "#009e73",
    "posterior": "#0072b2",
    "background_cancelling": "#0072b2",
}
_TRUTH = "#999999"
_ASIDE_M = 0.008  # so that two intervals at one range stand side by side


def _ambiguous(point: Point) -> bool:
    return len(point.roots) > 1


def _single(answer: Answer) -> list[Point]:
    return [p for p in answer.points if not _ambiguous(p) and math.isfinite(p.range_m)]


def _dots(axes: Axes, answer: Answer) -> None:
    """Draw ranges with their 90 % intervals."""
    points = _single(answer)
    truth, middle = [p.truth_m for p in points], [p.range_m for p in points]
    below = [max(p.range_m - p.low_m, 0.0) for p in points]
    above = [max(p.high_m - p.range_m, 0.0) for p in points]
    colour = _COLOURS[answer.name]
    axes.errorbar(truth, middle, [below, above], fmt="o", ms=3.5, lw=1.4, color=colour, zorder=3)


def _errors(axes: Axes, answer: Answer, aside_m: float) -> None:
    """Draw the errors of ranges with their 90 % intervals, in percent, a little to one side."""
    points = _single(answer)
    truth = [p.truth_m + aside_m for p in points]
    unit = [100.0 / p.truth_m for p in points]
    middle = [(p.range_m - p.truth_m) * u for p, u in zip(points, unit, strict=True)]
    below = [max(p.range_m - p.low_m, 0.0) * u for p, u in zip(points, unit, strict=True)]
    above = [max(p.high_m - p.range_m, 0.0) * u for p, u in zip(points, unit, strict=True)]
    colour = _COLOURS[answer.name]
    axes.errorbar(truth, middle, [below, above], fmt="o", ms=3, lw=1.4, color=colour, zorder=3)


def _roots(axes: Axes, answer: Answer) -> None:
    """Draw every root of the ambiguous frames as a ring."""
    for point in filter(_ambiguous, answer.points):
        heights = [root for root, _ in point.roots]
        places = [point.truth_m] * len(heights)
        colour = _COLOURS[answer.name]
        axes.plot(places, heights, color=colour, lw=0.8, alpha=0.5, zorder=1)
        axes.plot(places, heights, "o", ms=8, mfc="white", mec=colour, mew=1.6, zorder=2)


def _truth(axes: Axes, points: Sequence[Point]) -> None:
    ends = [min(p.truth_m for p in points), max(p.truth_m for p in points)]
    axes.plot(ends, ends, color=_TRUTH, lw=1.2, zorder=0)


def _label(axes: Axes, text: str, place: tuple[float, float], colour: str) -> None:
    axes.text(*place, text, transform=axes.transAxes, color=colour, fontsize=9.5, va="top")


def _glass(above: Axes, below: Axes, episode: Episode) -> None:
    conventional, fit, posterior = episode.answers
    for answer in (conventional, posterior):
        _dots(above, answer)
    # the conventional errors grow to 90 %
    _errors(below, fit, -_ASIDE_M)
    _errors(below, posterior, _ASIDE_M)
    _truth(above, posterior.points)
    above.set(ylabel="range [m]", ylim=(0.0, 2.35))
    above.set_title(f"{episode.title}\n{episode.source}", fontsize=11)
    _label(above, "conventional: far too near", (0.55, 0.30), _COLOURS["conventional"])
    words = "posterior: knows neither plate nor crosstalk,\nhas five frames without the plate"
    _label(above, words, (0.03, 0.95), _COLOURS["posterior"])
    _label(above, "grey line: the truth", (0.70, 0.52), _TRUTH)
    below.axhline(0, color=_TRUTH, lw=1.2, zorder=0)
    below.set(xlabel="true range [m]", ylabel="error [% of the range]", ylim=(-9, 9))
    _label(below, "posterior, with 90 % intervals", (0.03, 0.95), _COLOURS["posterior"])
    _label(below, "joint_fit, the same at once", (0.03, 0.14), _COLOURS["joint_fit"])


def _phases(axes: Axes, episode: Episode) -> None:
    conventional, technique, _ = episode.answers
    _dots(axes, conventional)
    _dots(axes, technique)
    _roots(axes, technique)
    _truth(axes, technique.points)
    axes.margins(y=0.12)
    axes.set(xlabel="true range [m]", ylabel="range [m]")
    axes.set_title(f"{episode.title}\n{episode.source}", fontsize=11)
    _label(axes, "conventional: one answer, a wrong one", (0.05, 0.96), _COLOURS["conventional"])
    words = "rings: two ranges explain\nthe frame, and both are said\ndots: one range"
    _label(axes, words, (0.55, 0.22), _COLOURS["posterior"])
    _label(axes, "grey line: the truth", (0.38, 0.58), _TRUTH)


def draw(episodes: Sequence[Episode], path: Path) -> None:
    """Draw crosstalk through a glass with its errors, and frames that two ranges explain.

    Parameters
    ----------
    episodes : sequence of Episode
        In the order of `episodes.EPISODES`.
    path : Path
        The image; its suffix says which format.
    """
    _, glass, _, phases = episodes
    figure = Figure(figsize=(11, 6.2), layout="constrained")
    panels = figure.subplot_mosaic(
        [["glass", "phases"], ["errors", "phases"]], height_ratios=[3, 2]
    )
    panels["glass"].sharex(panels["errors"])
    _glass(panels["glass"], panels["errors"], glass)
    _phases(panels["phases"], phases)
    figure.savefig(path, dpi=110)
