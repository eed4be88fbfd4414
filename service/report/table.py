"""Rows as text: for a terminal while they come, and in Markdown."""

from collections.abc import Iterable

import numpy as np

from service.report.row import Row

__all__ = [
    "COLUMNS",
    "LEGEND",
    "cells_of_row",
    "heading",
    "left_out",
    "line",
    "markdown",
    "method_to_take",
    "percent",
    "time_of",
]

COLUMNS = (
    "method",
    "knob",
    "median error",
    "95 % error",
    "90 % interval holds",
    "CRPS",
    "ambiguous",
    "refused",
    "a frame",
    "alone p50",
    "alone p99",
    "memory",
    "likelihood calls",
    "effective draws a second",
)
LEGEND = (
    "Errors are relative to the range, of the frames with a single range. The 90 % interval of a "
    "frame with several ranges holds the truth where one of theirs does. CRPS: the continuous "
    "ranked probability score over the range, which for a number without interval would be its "
    "error. A frame: processor time of a call over its frames; alone: of a frame that comes by "
    "itself. Memory: most that a call held. Effective draws a second: after a passed verdict. "
    "Frames of one fit or posterior err together, and few of these are measured here: how often "
    "their intervals hold the truth is told by many: docs/coverage.md and docs/calibration.md."
)
_WIDTHS = (32, 24, 9, 9, 7, 9, 10, 8, 9, 9, 9, 9, 8, 9)
_HEADS = (
    "method",
    "",
    "median",
    "95 %",
    "holds",
    "CRPS",
    "ambiguous",
    "refused",
    "a frame",
    "p50",
    "p99",
    "memory",
    "calls",
    "draws/s",
)


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.0f} %"


def percent(value: float | None) -> str:
    """Return a share in percent to two digits, without an exponent."""
    if value is None:
        return "-"
    text = np.format_float_positional(
        100 * value, precision=2, unique=False, fractional=False, trim="-"
    )
    return f"{text} %"


def time_of(seconds: float | None) -> str:
    """Return a time in the unit that fits."""
    if seconds is None:
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def _memory(size: int | None) -> str:
    if size is None:
        return "-"
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.0f} kB"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}" if value < 100 else f"{value:,.0f}"


def method_of(row: Row) -> str:
    """Return the method, with what it was told that is not so."""
    return f"{row.method}*" if row.told else row.method


def cells_of_row(row: Row) -> tuple[str, ...]:
    """Return what a row says, one text a column of `COLUMNS`."""
    s, c = row.scores, row.costs
    if s is None:
        return (method_of(row), row.knob, *["-"] * (len(COLUMNS) - 2))
    return (
        method_of(row),
        row.knob,
        percent(s.median_error),
        percent(s.p95_error),
        _share(s.coverage),
        percent(s.crps),
        _share(s.ambiguous),
        _share(s.refused),
        time_of(c.frame_s),
        time_of(c.p50_s),
        time_of(c.p99_s),
        _memory(c.peak_bytes),
        _number(row.likelihood_calls),
        _number(c.draws_per_s),
    )


def _aligned(cells: Iterable[str]) -> str:
    parts = [
        f"{cell:<{width}}" if k < 2 else f"{cell:>{width}}"
        for k, (cell, width) in enumerate(zip(cells, _WIDTHS, strict=True))
    ]
    return " ".join(parts).rstrip()


def heading(scene: str) -> str:
    """Return what stands above a scene's lines in a terminal."""
    return f"\nscene: {scene}\n{_aligned(_HEADS)}"


def line(row: Row) -> str:
    """Return a row as a line for a terminal."""
    said = " (*told that there is neither crosstalk nor wall)" if row.told else ""
    return _aligned(cells_of_row(row)) + said


def method_to_take(rows: Iterable[Row]) -> str:
    """Say which method costs least of those that come near the least error, and hold the truth.

    Near: within a factor of two. Holding: the truth is in 80 % or more of the 90 % intervals.
    """
    groups: dict[str, list[tuple[float, float, str]]] = {"known": [], "unknown": []}
    for row in rows:
        s, time_s = row.scores, row.costs.frame_s
        if s is None or time_s is None or row.told or s.median_error is None or s.single < 0.5:
            continue
        if s.coverage is None or s.coverage < 0.8:
            continue
        told = row.family in ("single frames", "tracker") or "told the object" in row.remark
        found = groups["known" if told else "unknown"]
        found.append((time_s, s.median_error, f"{row.method}, {row.knob}"))
    said = []
    for object_is, found in groups.items():
        if found:
            least = min(error for _, error, _ in found)
            time_s, error, name = min(x for x in found if x[1] <= 2 * least)
            said.append(f"object {object_is}: {name} ({percent(error)}, {time_of(time_s)} a frame)")
    return "; ".join(said)


def left_out(rows: Iterable[Row]) -> dict[str, str]:
    """Return which methods were left out of a scene, and why."""
    rows = list(rows)
    served = {row.method for row in rows if row.scores is not None}
    reasons = {row.method: row.remark for row in rows if row.scores is None}
    return {method: why for method, why in reasons.items() if method not in served}


def markdown(rows: Iterable[Row]) -> str:
    """Return the rows of one scene as a table in Markdown, and what was left out below it."""
    rows = list(rows)
    lines = [f"| {' | '.join(COLUMNS)} | remark |", "|---" * (len(COLUMNS) + 1) + "|"]
    served = [row for row in rows if row.scores is not None]
    lines += [f"| {' | '.join(cells_of_row(row))} | {row.remark} |" for row in served]
    lines += ["", "Left out:", ""]
    lines += [f"- {method}: {why}" for method, why in left_out(rows).items()]
    return "\n".join(lines)
