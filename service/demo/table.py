"""The answers as a table for a terminal."""

import math
from collections.abc import Iterator, Sequence

from service.demo.answers import Episode, Point

__all__ = ["rows_shown", "table"]

_ROWS = 5
_HEADER = (
    f"  {'truth [m]':>9}  {'range [m]':>9}  {'90 % interval [m]':<19}  {'status':<10} "
    "ranges that explain the frame [m]"
)


def rows_shown(count: int) -> list[int]:
    """Return which of so many frames a table shows."""
    return sorted({round((count - 1) * i / (_ROWS - 1)) for i in range(_ROWS)})


def _line(point: Point) -> str:
    known = math.isfinite(point.range_m) and len(point.roots) == 1
    middle = f"{point.range_m:9.4f}" if known else f"{'-':>9}"
    has_interval = math.isfinite(point.low_m)
    interval = f"{point.low_m:.4f} to {point.high_m:.4f}" if has_interval else "-"
    roots = ""
    if len(point.roots) > 1:
        equal = len({weight for _, weight in point.roots}) == 1
        roots = ", ".join(
            f"{root:.4f}" if equal else f"{root:.4f} ({weight:.0%})" for root, weight in point.roots
        )
    return f"  {point.truth_m:9.4f}  {middle}  {interval:<19}  {point.status:<10} {roots}".rstrip()


def _lines(episodes: Sequence[Episode]) -> Iterator[str]:
    for episode in episodes:
        yield f"{episode.title} - {episode.source}"
        for answer in episode.answers:
            remark = f" ({answer.remark})" if answer.remark else ""
            yield f"\n {answer.name}{remark}"
            yield _HEADER
            for row in rows_shown(len(answer.points)):
                yield _line(answer.points[row])
        yield ""


def table(episodes: Sequence[Episode]) -> str:
    """Return five frames of every answer, as text."""
    return "\n".join(_lines(episodes))
