"""Pictures of the report: work against precision, and what each term costs."""

import io
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from service.report.labels import SIZE, Labels, place_all
from service.report.light import LIGHT
from service.report.row import Row
from service.report.run import Report
from service.report.terms import TermCost

__all__ = ["draw_scene", "draw_snr", "draw_summary", "draw_terms", "svg"]

# colour-blind safe (Okabe and Ito), one a family of methods
_COLOURS = {
    "single frames": "#0072b2",
    "many frames": "#009e73",
    "tracker": "#cc79a7",
    "posterior": "#d55e00",
    "light": "#333333",
}
_GREY = "#777777"
_SVG_DPI = 72  # that of a picture that is placed at another is laid out twice
_SUMMARY = ("Bare object", "Unknown crosstalk", "Known wall behind", "Through the fold")


def _curves(rows: Sequence[Row]) -> dict[tuple[str, str, str], list[Row]]:
    """Return the curves of a scene: rows of one method by its knob.

    Of a posterior, which has two knobs, those with the fewest draws: more are a curve of their own.
    """
    curves: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        if row.scores is not None and row.scores.median_error and row.costs.frame_s:
            curves.setdefault((row.family, row.method, row.told), []).append(row)
    found: dict[tuple[str, str, str], list[Row]] = {}
    for (family, method, told), curve in curves.items():
        ordered = sorted(curve, key=lambda row: row.order)
        few = [row for row in ordered if row.draws <= min(x.draws for x in ordered)]
        found[family, method, told] = few
        more = [row for row in ordered if row not in few]
        if more:
            alike = [row for row in few if row.frames_a_set == more[0].frames_a_set]
            found[family, f"{method}, more draws", told] = [*alike, *more]
    return found


def _along(x: Sequence[float], y: Sequence[float]) -> list[tuple[float, float]]:
    """Return points of a curve and on the lines between them, which no label shall cover."""
    found = list(zip(x, y, strict=True))
    for (x0, y0), (x1, y1) in itertools.pairwise(found[:]):
        found += list(zip(np.geomspace(x0, x1, 12), np.geomspace(y0, y1, 12), strict=True))
    return found


def _panel(axes: Axes, rows: Sequence[Row], least: float | None, division: float) -> Labels:
    """Draw a scene; its labels are placed when all panels of the figure are there."""
    labels: list[tuple[float, float, str, str]] = []
    points: list[tuple[float, float]] = []
    for (family, method, told), curve in _curves(rows).items():
        colour = _COLOURS[family]
        x = [row.costs.frame_s or 0.0 for row in curve]
        y = [row.scores.median_error or 0.0 for row in curve if row.scores]
        axes.loglog(
            x, y, "-o", color=colour, ms=5, lw=1.2, mfc="white" if told else colour, clip_on=False
        )
        off = [(row.scores and row.scores.median_se) or 0.0 for row in curve]
        # a bar that reached below zero would leave the picture
        down = [min(o, 0.9 * e) for o, e in zip(off, y, strict=True)]
        axes.errorbar(x, y, yerr=[down, off], fmt="none", ecolor=colour, lw=0.8, alpha=0.7)
        points += _along(x, y)
        name = f"{method} (misinformed)" if told else method
        at = int(np.argmin(y))
        labels.append((x[at], y[at], name, colour))
    low = min([least or np.inf, *(y for _, y in points)], default=1e-6)
    high = max((y for _, y in points), default=1.0)
    axes.set_ylim(low / 6, high * 6)
    axes.set_xlim(division / 2, 30.0)
    if least:
        axes.axhline(least, color=_GREY, lw=1, ls="--")
        axes.annotate(
            "least error: all known but the range",
            (division, least),
            (4, -10),
            textcoords="offset points",
            color=_GREY,
            fontsize=SIZE,
        )
    axes.axvline(division, color=_GREY, lw=1, ls="--")
    axes.annotate(
        "one division",
        (division, high * 6),
        (4, -4),
        textcoords="offset points",
        va="top",
        rotation=90,
        color=_GREY,
        fontsize=SIZE,
    )
    axes.grid(alpha=0.25)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return Labels(axes, labels, points, least)


def draw_scene(report: Report, scene: str) -> Figure:
    """Draw error against time a frame of one scene, each method a curve over its own knob."""
    figure = Figure(figsize=(8.6, 4.6), layout="constrained", dpi=_SVG_DPI)
    axes = figure.subplots()
    axes.set(
        xlabel="processor time a frame [s]",
        ylabel="median error of the range, relative",
    )
    if scene == LIGHT:
        axes.set(
            xlabel="processor time a distance [s]", ylabel="median error of the light, relative"
        )
    panel = _panel(axes, report.of(scene), report.least_errors.get(scene), report.division_s)
    place_all(figure, [panel])
    return figure


def draw_summary(report: Report, path: Path) -> None:
    """Draw four scenes into one picture."""
    names = [name for name in _SUMMARY if name in report.scenes] or list(report.scenes)[:4]
    figure = Figure(figsize=(13, 9), layout="constrained", dpi=100)
    panels = figure.subplots(2, 2).ravel()
    for axes in panels[len(names) :]:
        axes.set_visible(False)
    for axes, name in zip(panels, names, strict=False):
        axes.set_title(name, fontsize=11, loc="left")
        axes.set(xlabel="processor time a frame [s]", ylabel="median relative error")
    drawn = [
        _panel(axes, report.of(name), report.least_errors.get(name), report.division_s)
        for axes, name in zip(panels, names, strict=False)
    ]
    place_all(figure, drawn)
    figure.savefig(path, pil_kwargs={"optimize": True})


def draw_snr(report: Report, ratios: Mapping[str, Mapping[str, float]]) -> Figure | None:
    """Draw error against the signal-to-noise ratio, a panel a kind of sensor.

    Parameters
    ----------
    ratios : mapping of str to mapping of str to float
        By title, the ratios of scenes that differ in nothing else.

    Returns
    -------
    Figure or None
        None where of no kind two were measured.
    """
    measured = {
        title: sorted((n for n in report.scenes if n in those), key=lambda n: those[n])
        for title, those in ratios.items()
    }
    measured = {title: names for title, names in measured.items() if len(names) > 1}
    if not measured:
        return None
    figure = Figure(figsize=(8.6, 4.6 * len(measured)), layout="constrained", dpi=_SVG_DPI)
    panels = figure.subplots(len(measured), squeeze=False)[:, 0]
    drawn = []
    for axes, (title, names) in zip(panels, measured.items(), strict=True):
        axes.set_title(title, fontsize=11, loc="left")
        axes.set(xlabel="signal-to-noise ratio at 1 m", ylabel="median relative error")
        drawn.append(_snr_panel(axes, report, {name: ratios[title][name] for name in names}))
    place_all(figure, drawn)
    return figure


def _snr_panel(axes: Axes, report: Report, ratios: Mapping[str, float]) -> Labels:
    """Draw the best of each method at each ratio, and the least error."""
    found: dict[tuple[str, str], dict[float, float]] = {}
    for name, ratio in ratios.items():
        for (family, method, _), curve in _curves(report.of(name)).items():
            best = min(r.scores.median_error or np.inf for r in curve if r.scores)
            found.setdefault((family, method), {})[ratio] = best
    labels, points = [], []
    for (family, method), values in found.items():
        x, y = list(values), list(values.values())
        axes.loglog(x, y, "-o", color=_COLOURS[family], ms=4, lw=1.2)
        labels.append((x[-1], y[-1], method, _COLOURS[family]))
        points += _along(x, y)
    least = [report.least_errors.get(name) or np.nan for name in ratios]
    axes.loglog(list(ratios.values()), least, "--", color=_GREY, lw=1)
    axes.set_xlim(None, max(ratios.values()) * 300)
    axes.grid(alpha=0.25)
    return Labels(axes, labels, points)


def draw_terms(terms: Sequence[TermCost]) -> Figure:
    """Draw what each term costs, beside the object alone."""
    figure = Figure(figsize=(10, 3.6), layout="constrained", dpi=_SVG_DPI)
    panels = figure.subplots(1, 3, sharey=True)
    names = [term.term for term in terms]
    columns = (
        ("unknowns", [float(term.unknowns) for term in terms], "{:.0f}"),
        ("arithmetic a frame", [term.operations for term in terms], "{:,.0f}"),
        ("microseconds a frame", [1e6 * term.frame_s for term in terms], "{:.1f}"),
    )
    for axes, (title, values, form) in zip(panels, columns, strict=True):
        bars = axes.barh(names, values, color="#0072b2", alpha=0.8)
        axes.bar_label(bars, [form.format(v) for v in values], padding=3, fontsize=SIZE)
        axes.axvline(values[0], color=_GREY, lw=1, ls="--")
        axes.set_xlim(0, 1.25 * max(values))
        axes.xaxis.set_major_locator(MaxNLocator(3))
        axes.set_title(title, fontsize=10, loc="left")
        axes.tick_params(labelsize=SIZE)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    panels[0].invert_yaxis()  # of all, which share it
    return figure


def svg(figure: Figure) -> str:
    """Return a figure as SVG whose text is text, without what stands before the element."""
    buffer = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "hybridtof"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
