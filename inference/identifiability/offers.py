"""What to do about a parameter that is not identified: the useful of the remedies, in order."""

import dataclasses
import math
from collections.abc import Iterable

from inference.identifiability.remedies import Remedy
from inference.identifiability.status import STATUSES, Identifiability

__all__ = ["NOTHING_HELPS", "NOTHING_IDENTIFIES", "Offer", "offers"]

_HELP = 2.0  # a change that lowers bound or spread by less is not worth its words
_BETTER = 1.2  # by which what costs more has to be better
_OPEN = 1.0  # a bound as large as what it is measured by: not even an order of magnitude

NOTHING_HELPS = (
    "; of more frames without the object, known distances, odometry and a wider stroke none would "
    "tell it much better"
)
NOTHING_IDENTIFIES = (
    "; more frames without the object, known distances, odometry and a wider stroke, each on its "
    "own, would not have it identified"
)


@dataclasses.dataclass(frozen=True)
class Offer:
    """Something to be done about a parameter that is not identified.

    Attributes
    ----------
    kind : "empty", "distance", "distances", "odometry" or "motion"
        Frames without the object, the object at one or two known distances, odometry, a stroke.
    words : str
        It in full.
    bound : float
        Cramer-Rao bound that it would give: relative, of c1 over sqrt(c0), of crosstalk over the
        scene's light, of "range_m" that of the mean of log r.
    status : "identified", "weak" or "not_identified"
        What the parameter would be then, as it is foreseen of a posterior.
    """

    kind: str
    words: str
    bound: float
    status: str


def offers(
    remedies: Iterable[Remedy], row: Identifiability, bound: float, spread: float
) -> tuple[Offer, ...]:
    """Return what would help a parameter, what has it identified first, then the cheapest.

    An offer lowers the bound to a half or less, and below one; and the parameter's status is better
    then, or its spread a half or less. Of remedies that achieve as much the best of those that cost
    the same is offered, and none that is worse than a cheaper one; what achieves less only where it
    is cheaper.

    Parameters
    ----------
    remedies : iterable of Remedy
        What was tried.
    row : Identifiability
        Of the parameter, as it is.
    bound, spread : float
        Its bound and its spread (`inference.identifiability.status`), as they are.
    """
    name, now = row.parameter, STATUSES.index(row.status)
    achieved: dict[int, list[tuple[tuple[int, int], float, Remedy]]] = {}
    for remedy in remedies:
        after = remedy.bound(name)
        # of what is known after all the bound is no number
        if not (math.isfinite(after) and after < min(_OPEN, bound / _HELP)):
            continue
        then = STATUSES.index(remedy.status(name))
        if then < now or (then == now and _HELP * remedy.spread(name) <= spread):
            achieved.setdefault(then, []).append((remedy.cost, after, remedy))
    found: list[Offer] = []
    dearest: tuple[float, float] = (math.inf, math.inf)
    for then in sorted(achieved):
        least = math.inf
        for cost, after, remedy in sorted(achieved[then], key=lambda item: item[:2]):
            if after < least and cost < dearest:
                words = remedy.words.rstrip(",")
                found.append(Offer(remedy.kind, words, after, STATUSES[then]))
                least = after / _BETTER
        dearest = min(dearest, min(item[0] for item in achieved[then]))
    return tuple(found)
