"""Which method to take on a scene, by what was measured and no more."""

from collections.abc import Iterable
from typing import NamedTuple

from service.report.honesty import judged
from service.report.row import Row
from service.report.table import percent, time_of

__all__ = ["method_to_take"]

# how much worse than the least error a cheaper method may be
_NEAR = 2.0


class _Candidate(NamedTuple):
    """A row that could be taken; the cheapest is the least."""

    time_s: float
    error: float
    name: str
    holds: bool | None


def method_to_take(rows: Iterable[Row]) -> str:
    """Say which method costs least of those that come near the least error, and hold the truth.

    Parameters
    ----------
    rows : iterable of Row
        Of one scene.

    Returns
    -------
    str
        For an object that is known and one that is not. Taken is only what is shown to hold the
        truth: the whole band of the share is above 80 %. What errs less by more than twice, and
        of which too few sets tell, stands beside it.
    """
    groups: dict[str, list[_Candidate]] = {"known": [], "unknown": []}
    for row in rows:
        s, time_s = row.scores, row.costs.frame_s
        if s is None or time_s is None or row.told or s.median_error is None or s.single < 0.5:
            continue
        told = row.family in ("single frames", "tracker") or "told the object" in row.remark
        holds = judged(s)
        if holds is not False:
            name = f"{row.method}, {row.knob}"
            candidate = _Candidate(time_s, s.median_error, name, holds)
            groups["known" if told else "unknown"].append(candidate)
    said = []
    for object_is, found in groups.items():
        shown = [x for x in found if x.holds]
        words = []
        if shown:
            least = min(x.error for x in shown)
            taken = min(x for x in shown if x.error <= _NEAR * least)
            words.append(_in_words(taken))
            found = [x for x in found if _NEAR * x.error < taken.error]
        unsure = [x for x in found if x.holds is None]
        if unsure:
            better = min(unsure, key=lambda x: x.error)
            words.append(f"too few sets to tell of {_in_words(better)}")
        if words:
            said.append(f"object {object_is}: {'; '.join(words)}")
    return ". ".join(text[0].upper() + text[1:] for text in said)


def _in_words(found: _Candidate) -> str:
    return f"{found.name} ({percent(found.error)}, {time_of(found.time_s)} a frame)"
