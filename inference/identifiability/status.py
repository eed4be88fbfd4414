"""Whether a parameter is identified: the answer for one unknown."""

import dataclasses

__all__ = ["Identifiability", "status_of"]

# posterior spread against the prior's for an unknown; of the mean of log r for the ranges' scale
_PARAMETER_LIMITS = (0.2, 0.7)
_SCALE_LIMITS = (0.05, 0.3)


@dataclasses.dataclass(frozen=True)
class Identifiability:
    """Whether the data tell a parameter.

    Attributes
    ----------
    parameter : str
        Scene path, or "range_m" for the common scale of the ranges.
    status : "identified", "weak" or "not_identified"
        By how much the data narrow the prior; for the ranges' scale by its relative error.
    contraction : float
        1 - variance of the posterior over that of the prior.
    reason : str
        Why, and what would help, in plain words.
    """

    parameter: str
    status: str
    contraction: float
    reason: str


def status_of(parameter: str, spread: float) -> str:
    """Return the status of a parameter.

    Parameters
    ----------
    parameter : str
        Scene path, or "range_m".
    spread : float
        Posterior standard deviation in z, where the prior's is one; for "range_m" of log r.
    """
    limits = _SCALE_LIMITS if parameter == "range_m" else _PARAMETER_LIMITS
    if spread < limits[0]:
        return "identified"
    return "weak" if spread < limits[1] else "not_identified"
