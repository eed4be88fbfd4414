"""Rows as text: for a terminal while they come, and in Markdown."""

from collections.abc import Iterable

import numpy as np

from service.report.honesty import band_in_words
from service.report.row import Row

__all__ = [
    "COLUMNS",
    "LEGEND",
    "cells_of_row",
    "heading",
    "left_out",
    "line",
    "markdown",
    "percent",
    "time_of",
    "with_error",
]

COLUMNS = (
    "method",
    "setting",
    "sets",
    "median error",
    "95 % error",
    "90 % interval holds",
    "CRPS",
    "ambiguous",
    "refused",
    "a frame",
    "p50",
    "p99",
    "memory",
    "likelihood calls",
    "effective draws a second",
)
LEGEND = (
    "Errors are relative to the range, of the frames with a single range. The 90 % interval of a "
    "frame with several ranges holds the truth where one of theirs does. CRPS: the continuous "
    "ranked probability score over the range, which for a number without interval would be its "
    "error. After ±: one standard error, by which a figure of other sets would differ; in "
    "brackets the 95 % band of a share. Both count sets of frames, for those of one set err "
    "together; of one long sweep blocks of neighbouring frames stand for sets, and of fewer than "
    "five sets no standard error can be told. Single frames of which something is unknown, or of "
    "a surface that is not as the model, have that error in common: they are one set. "
    "A frame: processor time of a call over its frames; p50, p99: quantiles of the time of a frame "
    "that comes by itself, and of fits and posteriors, which need many, over their data sets. "
    "Memory: most that a call held; of fits and posteriors one set of several is run for that "
    "alone, and its time is not counted. "
    "Effective draws a second: after a passed verdict. "
    "How often intervals of fits and posteriors hold the truth is told by many more sets: "
    "docs/coverage.md and docs/calibration.md."
)
_TINY = 1e-9  # a share whose zeros nobody counts
_WIDTHS = (32, 24, 4, 9, 9, 7, 9, 10, 8, 9, 9, 9, 9, 8, 9)
_HEADS = (
    "method",
    "",
    "sets",
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
    """Return a share in percent to two digits, without an exponent; of a tiny one only that."""
    if value is None:
        return "-"
    if 0.0 < value < _TINY:
        return "below 0.0000001 %"
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
    """Return what a row says with its Monte Carlo errors, one text a column of `COLUMNS`."""
    plain, s = _plain(row), row.scores
    if s is None:
        return plain
    found = dict(zip(COLUMNS, plain, strict=True))
    for name, value, off in (
        ("median error", s.median_error, s.median_se),
        ("95 % error", s.p95_error, s.p95_se),
        ("CRPS", s.crps, s.crps_se),
    ):
        found[name] = with_error(value, off)
    if s.coverage is not None:
        found["90 % interval holds"] += f" ({band_in_words(s)})"
    for name, share, off in (
        ("ambiguous", s.ambiguous, s.ambiguous_se),
        ("refused", s.refused, s.refused_se),
    ):
        if off is not None and off >= 0.0005:
            found[name] = f"{100 * share:.1f} ± {100 * off:.1f} %"
    return tuple(found.values())


def with_error(value: float | None, off: float | None) -> str:
    """Return a share in percent with its standard error, to as many digits as that tells."""
    if value is None or off is None or off <= 0.0:
        return percent(value)
    places = int(np.clip(1 - np.floor(np.log10(100 * off)), 0, 12))
    return f"{100 * value:.{places}f} ± {100 * off:.{places}f} %"


def _plain(row: Row) -> tuple[str, ...]:
    s, c = row.scores, row.costs
    if s is None:
        return (method_of(row), row.knob, *["-"] * (len(COLUMNS) - 2))
    return (
        method_of(row),
        row.knob,
        str(s.sets),
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
    return _aligned(_plain(row)) + said


def left_out(rows: Iterable[Row]) -> dict[str, str]:
    """Return which methods, or settings of them, were left out of a scene, and why."""
    rows = list(rows)
    served = {row.method for row in rows if row.scores is not None}
    return {
        f"{row.method}, {row.knob}" if row.method in served else row.method: row.remark
        for row in rows
        if row.scores is None
    }


def markdown(rows: Iterable[Row]) -> str:
    """Return the rows of one scene as a table in Markdown, and what was left out below it."""
    rows = list(rows)
    lines = [f"| {' | '.join(COLUMNS)} | remark |", "|---" * (len(COLUMNS) + 1) + "|"]
    served = [row for row in rows if row.scores is not None]
    lines += [f"| {' | '.join(cells_of_row(row))} | {row.remark} |" for row in served]
    lines += ["", "Left out:", ""]
    lines += [f"- {method}: {why}" for method, why in left_out(rows).items()]
    return "\n".join(lines)
