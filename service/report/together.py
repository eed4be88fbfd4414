"""How often intervals of a method hold the truth over all scenes together."""

import dataclasses
from collections.abc import Iterable

from service.report.honesty import judged
from service.report.row import Row
from service.report.uncertain import band_of

__all__ = ["Together", "together"]

# of a real plate that is said to be exactly as the model: what that does is shown, not counted
_UNTRUE = "told that the model is exact"


@dataclasses.dataclass(frozen=True)
class Together:
    """Intervals of one method over all scenes.

    Attributes
    ----------
    method : str
        Which.
    scenes, sets : int
        How many, of all settings that have data of their own.
    coverage, low, high : float
        Share of frames in which a 90 % interval holds the truth, each set counting once, and its
        95 % band.
    misled : tuple of str
        Scenes on which intervals of some setting are shown to hold it in less than 80 %.
    """

    method: str
    scenes: int
    sets: int
    coverage: float
    low: float
    high: float
    misled: tuple[str, ...]


def together(rows: Iterable[Row]) -> list[Together]:
    """Put the intervals of each method together, scenes about which it was told an untruth apart.

    Parameters
    ----------
    rows : iterable of Row
        Of all scenes.

    Returns
    -------
    list of Together
        In the order of the rows.
    """
    by_method: dict[str, list[Row]] = {}
    for row in rows:
        counts = row.scores is not None and row.scores.coverage is not None
        if counts and not row.told and not row.scene.endswith(_UNTRUE) and row.family != "light":
            by_method.setdefault(row.method, []).append(row)
    return [_of_method(method, found) for method, found in by_method.items()]


def _of_method(method: str, rows: list[Row]) -> Together:
    # settings that share their data count once: draws of a posterior, hypotheses of a tracker
    apart: dict[tuple[str, str], Row] = {}
    for row in rows:
        data = "" if row.family == "tracker" else row.knob.partition(",")[0]
        apart.setdefault((row.scene, data), row)
    counted = [row.scores for row in apart.values() if row.scores is not None]
    sets = sum(scores.sets for scores in counted)
    share = sum(scores.sets * (scores.coverage or 0.0) for scores in counted) / sets
    misled = (r.scene for r in rows if r.scores is not None and judged(r.scores) is False)
    scenes = len({row.scene for row in rows})
    return Together(
        method, scenes, sets, share, *band_of(share, sets), tuple(dict.fromkeys(misled))
    )
