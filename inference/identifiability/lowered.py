"""A row of what is foreseen, as most draws of the priors have it."""

from inference.identifiability.over_priors import Elsewhere
from inference.identifiability.status import STATUSES, Identifiability, contraction_of

__all__ = ["lowered"]


def lowered(place: int, here: Identifiability, unit: float, over: Elsewhere) -> Identifiability:
    """Return a row as three draws of four have it, where that is worse.

    Parameters
    ----------
    place : int
        Of the row.
    here : Identifiability
        At the values of reference.
    unit : float
        Spread of the prior.
    over : Elsewhere
        At draws of the priors.
    """
    one, status = over.quarter(place), over.status(place)
    if one is None or status <= STATUSES.index(here.status):
        return here
    words = STATUSES[status].replace("_", " ")
    if status < len(STATUSES) - 1:
        words += " or less"
    worse = int((over.statuses[:, place] >= status).sum())
    reason = (
        f"{here.reason}, where the unknowns are at the medians of their priors; it is {words} at "
        f"{worse} of {len(over.texts)} draws of the priors, at one of them {over.texts[one][place]}"
    )
    contraction = contraction_of(float(over.spreads[one, place]) / unit) if unit > 0 else 0.0
    return Identifiability(here.parameter, STATUSES[status], contraction, reason)
