"""The report as one page that needs nothing else, and as Markdown."""

import base64
import html
import re
from collections.abc import Mapping, Sequence
from string import Template

from service.report.honesty import WIDE, judged, range_in_words
from service.report.light import LIGHT
from service.report.row import Row
from service.report.run import Report
from service.report.table import (
    COLUMNS,
    LEGEND,
    cells_of_row,
    left_out,
    markdown,
    percent,
    time_of,
)
from service.report.taking import method_to_take
from service.report.together import together

__all__ = ["markdown_page", "page"]

_PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Error against run time</title>
<meta name="viewport" content="width=device-width">
<style>
body{font:15px/1.45 system-ui,sans-serif;max-width:1500px;margin:2em auto;padding:0 1em;color:#222}
h1{margin:0 0 .2em}h2{margin:2em 0 .3em;border-top:1px solid #ccc;padding-top:.8em}
table{border-collapse:collapse;font-size:12.5px;margin:.6em 0}
th,td{padding:.2em .55em;text-align:right;border-bottom:1px solid #eee}
th{font-weight:600;vertical-align:bottom;border-bottom:1px solid #999}
td:first-child,th:first-child,td:nth-child(2),th:nth-child(2),td:last-child{text-align:left}
td{white-space:nowrap;line-height:1.15}td:last-child{white-space:normal;min-width:13em}
td small{color:#555}
.glance{font-size:11.5px}.glance td,.glance th{text-align:center;padding:.2em .35em}
.together td:last-child,.together th:last-child{text-align:left}
.glance td:first-child{text-align:left;white-space:normal}.glance td:last-child{min-width:0}
.good{background:#d8efdf}.wide{background:#e3edf7}.bad{background:#f8d3c5}.none{color:#999}
.small{color:#555;font-size:13px}svg,img{max-width:100%;height:auto}.scroll{overflow-x:auto}
text{font-family:system-ui,sans-serif!important}
</style></head><body>
<h1>Error against run time</h1>
<p>Every method on $count scenes, from the same seed ($seed).
Techniques of single frames and the tracker are told what the object is; fits over many frames and
posteriors are told nothing of it, unless a remark says so. Readings come from the object parameter
model, told to be exact, or from the light of a real plate, added up over its surface.</p>
<p class="small">$machine</p>
<ul>$short</ul>
<h2>At a glance</h2>
<p>Median relative error of each kind of method at its best setting, and processor time a frame.
<span class="good">Green</span>: its 90 % intervals hold the truth in 80 to 97 % of frames;
<span class="wide">blue</span>: in more; <span class="bad">red</span>: in less, so that it is more
confident than it may be. Coloured only where the 95 % band of that share lies on one side of 80 %:
frames of one set err together, and of what has no colour there are too few sets here to tell.
$star</p>
<div class="scroll">$glance</div>
<p>Which to take: of the methods whose intervals are shown to hold the truth in 80 % of frames or
more, the one of least time that errs by at most twice the least. What would err less by more than
half, but of which too few sets tell, is named beside it.</p><ul>$take</ul>
<h2>Intervals over all scenes</h2>
<p>In what share of frames the 90 % intervals of a method hold the truth, all scenes and settings
together that tell it what is so and whose readings the object model made, or that claim nothing of
it; each set of frames counts once.</p>
<div class="scroll">$together</div>
<h2>What each term costs</h2>
<p>One evaluation of the density that posteriors and fits ask, by what the scene has. A term that
a scene lacks costs nothing there: the dashed line is the object alone.
Known crosstalk costs nothing, it is subtracted.</p>
$terms
$snr
$scenes
<h2>How to read the tables</h2><p>$legend</p>
<p>Dashed lines are what no method can do better: the Cramer-Rao bound of the noise with everything
but the range known, and one division a frame ($division). Curves go over what a method lets one
choose: frames of a sweep, hypotheses, frames and draws of a posterior; bars are one standard
error. A point of few frames or sets may lie below the bound by chance.</p>
</body></html>
""")
_STAR = (
    "* told that there is neither crosstalk nor wall, which is not so: it could not be used "
    "otherwise."
)


def _percent(value: float | None) -> str:
    return percent(value).replace(" ", "\u00a0")


def _take(report: Report) -> list[str]:
    """Say scene by scene which method to take."""
    found = ((scene, method_to_take(report.of(scene))) for scene in report.scenes if scene != LIGHT)
    return [f"{scene}: {text}." for scene, text in found if text]


def _best(rows: Sequence[Row]) -> Row | None:
    """Return the row of the least score, of those with intervals."""
    scored = [row for row in rows if row.scores is not None and row.scores.crps is not None]
    honest = [row for row in scored if not row.told] or scored
    return min(honest, key=lambda row: (row.scores and row.scores.crps) or 0.0, default=None)


def _class(row: Row) -> str:
    if row.scores is None or row.scores.coverage is None:
        return "none"
    holds = judged(row.scores)
    if holds is None:
        return "few"
    return "bad" if not holds else "good" if row.scores.coverage <= WIDE else "wide"


def _glance(report: Report) -> str:
    served = [row for row in report.rows if row.scores is not None and row.scene != LIGHT]
    methods = list(dict.fromkeys(row.method for row in served))
    head = "".join(f"<th>{html.escape(method)}</th>" for method in methods)
    lines = [f"<tr><th>scene</th>{head}</tr>"]
    for scene in dict.fromkeys(row.scene for row in served):
        cells = []
        for method in methods:
            row = _best([r for r in report.of(scene) if r.method == method])
            if row is None or row.scores is None:
                cells.append('<td class="none">-</td>')
                continue
            s = row.scores
            text = _percent(s.median_error) + ("*" if row.told else "")
            if s.single < 0.5:
                text = f"{100 * s.ambiguous:.0f} % ambiguous"
            text += f"<br><small>{time_of(row.costs.frame_s)}</small>"
            title = f"90 % intervals hold the truth in {_percent(s.coverage)} of frames"
            cells.append(f'<td class="{_class(row)}" title="{title}">{text}</td>')
        lines.append(f"<tr><td>{html.escape(scene)}</td>{''.join(cells)}</tr>")
    return f'<table class="glance">{"".join(lines)}</table>'


_TOGETHER = ("method", "scenes", "sets", "90 % interval holds", "95 % band", "too confident on")


def _together(report: Report) -> list[tuple[str, ...]]:
    return [
        (
            one.method,
            str(one.scenes),
            str(one.sets),
            f"{100 * one.coverage:.1f} %",
            range_in_words(one.low, one.high),
            "; ".join(one.misled) or "none",
        )
        for one in together(report.rows)
    ]


def _together_table(report: Report) -> str:
    head = "".join(f"<th>{name}</th>" for name in _TOGETHER)
    lines = [
        f"<tr>{''.join(f'<td>{html.escape(text)}</td>' for text in cells)}</tr>"
        for cells in _together(report)
    ]
    return f'<table class="together"><tr>{head}</tr>{"".join(lines)}</table>'


def _short(report: Report) -> list[str]:
    """Say in a sentence a scene what misleads and what does not."""
    found = []
    for scene in report.scenes:
        rows = report.of(scene)
        best = _best(rows)
        blind = [r for r in rows if r.told and r.scores and r.scores.median_error is not None]
        if best is None or best.scores is None or not blind:
            continue
        wrong = blind[0].scores
        assert wrong is not None  # noqa: S101  # as filtered above
        found.append(
            f"{scene}: {blind[0].method}, which takes no notice, errs by "
            f"{_percent(wrong.median_error)} and its 90 % intervals hold the truth in "
            f"{_percent(wrong.coverage)} of frames; {best.method} errs by "
            f"{_percent(best.scores.median_error)} and they do in {_percent(best.scores.coverage)}."
        )
    return found


_HOLDS = COLUMNS.index("90 % interval holds")


def _cell(text: str) -> str:
    """Return a text with its Monte Carlo error or its band below it, smaller."""
    value, mark, off = html.escape(text).partition(" ±")
    if mark:
        return (
            f"{value} %<br><small>±{off}</small>"
            if "%" in off
            else f"{value}<br><small>±{off} %</small>"
        )
    return re.sub(r" \((\d+-\d+ %)\)$", r"<br><small>\1</small>", value)


def _table(rows: Sequence[Row]) -> str:
    head = "".join(f"<th>{name}</th>" for name in (*COLUMNS, "remark"))
    lines = [f"<tr>{head}</tr>"]
    for row in rows:
        if row.scores is None:
            continue
        cells = [f"<td>{_cell(text)}</td>" for text in (*cells_of_row(row), row.remark)]
        cells[_HOLDS] = cells[_HOLDS].replace("<td>", f'<td class="{_class(row)}">')
        lines.append(f"<tr>{''.join(cells)}</tr>")
    return f'<div class="scroll"><table>{"".join(lines)}</table></div>'


def _machine(report: Report) -> str:
    spent = report.spent
    took = (
        f" {spent.measurements:,} measurements took {spent.processor_s / 60:.1f} minutes of "
        f"processor time, and compiling {spent.compiling_s:.0f} s beside."
    )
    return "Measured on: " + ", ".join(f"{k} {v}" for k, v in report.machine.items()) + "." + took


def page(report: Report, pictures: Mapping[str, str], terms: str, snr: str | None) -> str:
    """Return one page of HTML.

    Parameters
    ----------
    pictures : mapping of str to str
        SVG by scene; empty where nothing can be drawn.
    terms, snr : str or None
        SVG of what each term costs, and of error against the signal-to-noise ratio.
    """
    parts = []
    for scene in report.scenes:
        rows = report.of(scene)
        why = "; ".join(f"{method}: {reason}" for method, reason in left_out(rows).items())
        parts.append(
            f"<h2>{html.escape(scene)}</h2>{_image(pictures.get(scene, ''), scene)}{_table(rows)}"
            f'<p class="small">Left out: {html.escape(why) or "nothing"}.</p>'
        )
    short = "".join(f"<li>{html.escape(line)}</li>" for line in _short(report))
    return _PAGE.substitute(
        count=len(report.least_errors),
        seed=report.seed,
        machine=html.escape(_machine(report)),
        short=short,
        star=_STAR,
        glance=_glance(report),
        together=_together_table(report),
        take="".join(f"<li>{html.escape(line)}</li>" for line in _take(report)),
        terms=_image(terms, "what each term costs"),
        snr=""
        if snr is None
        else f"<h2>Error against noise, bare object</h2>{_image(snr, 'error against noise')}",
        scenes="".join(parts),
        legend=html.escape(LEGEND),
        division=f"{1e9 * report.division_s:.2g} ns",
    )


def _image(picture: str, what: str) -> str:
    """Return a picture within the page; as an image, whose names do not meet those of others."""
    if not picture:
        return ""
    data = base64.b64encode(picture.encode()).decode()
    return f'<img alt="{html.escape(what)}" src="data:image/svg+xml;base64,{data}">'


def markdown_page(report: Report) -> str:
    """Return the report in Markdown: tables without pictures."""
    lines = ["# Error against run time", "", _machine(report), f"Seed {report.seed}.", ""]
    lines += [f"- {line}" for line in _short(report)]
    lines += ["", "## Which method to take", "", *(f"- {line}" for line in _take(report))]
    lines += ["", "## Intervals over all scenes", "", f"| {' | '.join(_TOGETHER)} |"]
    lines += ["|---" * len(_TOGETHER) + "|"]
    lines += [f"| {' | '.join(cells)} |" for cells in _together(report)]
    lines += ["", LEGEND, "", _STAR, "", "## What each term costs", ""]
    lines += [
        "| scene | unknowns | arithmetic a frame | microseconds a frame |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {t.term} | {t.unknowns} | {t.operations:,.0f} | {1e6 * t.frame_s:.2f} |"
        for t in report.terms
    ]
    for scene in report.scenes:
        least = report.least_errors.get(scene)
        lines += [
            "",
            f"## {scene}",
            "",
            f"Least error that the noise leaves: {_percent(least)}.",
            "",
        ]
        lines.append(markdown(report.of(scene)))
    return "\n".join(lines) + "\n"
