"""Whether the model can make such readings at all: posterior predictive checks."""

import dataclasses

__all__ = ["Fit", "FitCheck"]


@dataclasses.dataclass(frozen=True)
class FitCheck:
    """One of the checks of a fit.

    Attributes
    ----------
    name : str
        "total": chi-square of all frames; "worst_frame": its squared residual; "neighbours":
        correlation of residuals along the range; "wander": their slow wandering along it;
        "flux_error": size of the flux's error that they ask for, against what the scene allows.
    statistic, expected : float
        Of the frames, and the mean over replicates of them.
    p_value : float
        How rarely a replicate is as large.
    """

    name: str
    statistic: float
    expected: float
    p_value: float


@dataclasses.dataclass(frozen=True)
class Fit:
    """Posterior predictive checks: is the model able to make such readings at all.

    Attributes
    ----------
    p_value : float
        Of all checks together.
    misfit : bool or None
        Whether it is below 1e-3, the frames demand a larger discrepancy than was stated, or they
        pull an unknown or ranges beyond their prior; None where nothing was drawn, so that nothing
        was checked.
    reasons : tuple of str
        What misfits, in plain words.
    chi_square, degrees_of_freedom : float
        Of the frames at their best ranges, parameters fitted, and what is expected of it.
    checks : tuple of FitCheck
        One by one.
    outliers : tuple of int
        Frames without which the others fit, by index, where the worst frame is a reason.
    """

    p_value: float
    misfit: bool | None
    reasons: tuple[str, ...]
    chi_square: float
    degrees_of_freedom: float
    checks: tuple[FitCheck, ...]
    outliers: tuple[int, ...]
