"""The answers as a picture: range against truth with intervals, roots where ambiguous."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from service.demo.answers import Answer, Episode, Point

__all__ = ["draw"]

Place = Literal["upper left", "upper center", "lower right"]

# distinguishable without colour vision (Okabe and Ito)
_COLOURS = {"conventional": "#d55e00", "differential": "#009e73", "posterior": "#0072b2"}
_OTHER = "#cc79a7"
_DIAGONAL = "#999999"


def _colour(answer: Answer) -> str:
    return _COLOURS.get(answer.name, _OTHER)


def _ambiguous(point: Point) -> bool:
    return len(point.roots) > 1


def _diagonal(axes: Axes, truths: Sequence[float]) -> None:
    ends = [min(truths), max(truths)]
    axes.plot(ends, ends, color=_DIAGONAL, lw=1, zorder=0)


def _ranges(axes: Axes, answer: Answer) -> None:
    """Range against truth: a dot with its interval, or every root with its weight as area."""
    colour = _colour(answer)
    single = [p for p in answer.points if not _ambiguous(p) and math.isfinite(p.range_m)]
    if single:
        truth, middle = [p.truth_m for p in single], [p.range_m for p in single]
        below = [max(p.range_m - p.low_m, 0.0) for p in single]
        above = [max(p.high_m - p.range_m, 0.0) for p in single]
        error = [
            [b if math.isfinite(b) else 0.0 for b in below],
            [a if math.isfinite(a) else 0.0 for a in above],
        ]
        axes.errorbar(truth, middle, error, fmt="o", ms=3.5, lw=1.2, color=colour, zorder=3)
    for point in filter(_ambiguous, answer.points):
        heights = [root for root, _ in point.roots]
        sizes = [max(90 * weight, 4) for _, weight in point.roots]
        ends = [min(heights), max(heights)]
        axes.plot([point.truth_m] * 2, ends, color=colour, lw=0.5, alpha=0.4, zorder=1)
        axes.scatter(
            [point.truth_m] * len(heights),
            heights,
            s=sizes,
            facecolors="none",
            edgecolors=colour,
            linewidths=1.2,
            zorder=2,
        )


def _errors(axes: Axes, answer: Answer, scale: float, share: bool) -> None:
    """Error with its interval, in units of 1 / scale or as a share of the truth."""
    points = [p for p in answer.points if not _ambiguous(p) and math.isfinite(p.range_m)]
    if not points:
        return
    truth = [p.truth_m for p in points]
    unit = [scale / p.truth_m if share else scale for p in points]
    middle = [(p.range_m - p.truth_m) * u for p, u in zip(points, unit, strict=True)]
    below = [(p.range_m - p.low_m) * u for p, u in zip(points, unit, strict=True)]
    above = [(p.high_m - p.range_m) * u for p, u in zip(points, unit, strict=True)]
    axes.errorbar(
        truth, middle, [below, above], fmt="o", ms=3, lw=1.2, color=_colour(answer), zorder=3
    )


def _legend(axes: Axes, episode: Episode, place: Place) -> None:
    handles = []
    for answer in episode.answers:
        hollow = sum(map(_ambiguous, answer.points)) > len(answer.points) / 2
        handles.append(
            Line2D(
                [],
                [],
                ls="",
                marker="o",
                ms=7 if hollow else 5,
                mfc="none" if hollow else _colour(answer),
                mec=_colour(answer),
                label=answer.name + (" (reports a misfit)" if answer.misfit else ""),
            )
        )
    axes.legend(handles=handles, fontsize=8, loc=place, frameon=False)


def _panel(axes: Axes, episode: Episode, place: Place = "upper left") -> None:
    for answer in episode.answers:
        _ranges(axes, answer)
    _diagonal(axes, [p.truth_m for p in episode.answers[0].points])
    axes.set(xlabel="true range [m]", ylabel="range [m]")
    axes.set_title(f"{episode.title}\n{episode.source.split(' (')[0]}", fontsize=10)
    _legend(axes, episode, place)


def draw(episodes: Sequence[Episode], path: Path) -> None:
    """Draw four episodes: two with their errors, two with their roots.

    Parameters
    ----------
    episodes : sequence of Episode
        In the order of `episodes.EPISODES`.
    path : Path
        The image; its suffix says which format.
    """
    near, crosstalk, derivatives, phases = episodes
    figure = Figure(figsize=(13, 8), layout="constrained")
    panels = figure.subplots(2, 3)
    for column, episode in ((0, near), (1, crosstalk)):
        _panel(panels[0, column], episode)
        axes = panels[1, column]
        share = column == 1
        for answer in episode.answers:
            _errors(axes, answer, 100.0 if share else 1000.0, share)
        axes.axhline(0, color=_DIAGONAL, lw=1, zorder=0)
        unit = "% of the range" if share else "mm"
        axes.set(xlabel="true range [m]", ylabel=f"error [{unit}]")
        axes.set_title("error, with 90 % intervals", fontsize=10)
    # the conventional errors grow to 90 %: they go out of the picture
    panels[1, 1].set_ylim(-12, 12)
    farthest = max(point.truth_m for answer in crosstalk.answers for point in answer.points)
    panels[0, 1].set_ylim(0.0, 1.3 * farthest)
    _panel(panels[0, 2], derivatives, "upper center")
    panels[0, 2].margins(y=0.2)
    _panel(panels[1, 2], phases, "lower right")
    panels[1, 2].margins(y=0.2)
    figure.suptitle(
        "Dots: one range, with its 90 % interval. Circles: ambiguous, every range that explains "
        "the frame (area: its weight). Grey: the truth.",
        fontsize=10,
    )
    figure.savefig(path, dpi=110)
