"""The numbers that a tracker's settings stand for."""

import math
from typing import NamedTuple

import numpy as np
import scipy

from inference.tracking.motion import Rules
from inference.tracking.nuisance_jacobian import NuisanceJacobian
from inference.tracking.observed import Observed
from inference.tracking.settings import TrackingSettings

__all__ = ["MisfitLimits", "is_felt", "misfit_limits", "rules_of"]

_BREADTH = 10.0  # of an outlier's law, in units of the noise: wider than what noise explains
_SAME = 0.05  # nats per weight: two hypotheses merge long before any of their intervals shows it
_SURPRISE_TAIL = 1e-4  # probability beyond which a single frame's surprise is cut
_SHARED = 0.3  # standard deviations of a reading by which errors that frames share are felt


def rules_of(
    settings: TrackingSettings, observed: Observed, at_rest: bool, shared: NuisanceJacobian
) -> Rules:
    """Return the kernels' rules.

    Parameters
    ----------
    settings : TrackingSettings
        How objects move, come and go.
    observed : Observed
        What is read, and its units.
    at_rest : bool
        Whether the object is known not to move.
    shared : NuisanceJacobian
        What all frames err in common.
    """
    scale1, scale2 = observed.scale.tolist()
    tail = _SURPRISE_TAIL
    if is_felt(shared):
        tail = min(tail, 0.1 * settings.false_alarm)
    drift1, drift2 = settings.crosstalk_drift or (0.0, 0.0)
    return Rules(
        leave=1.0 / settings.visit_s,
        arrive=1.0 / settings.absence_s,
        rate_sd=0.0 if at_rest else settings.rate_sd,
        rate_time=settings.rate_time_s,
        drift1=drift1 * scale1,
        drift2=drift2 * scale2,
        outlier=settings.outlier,
        breadth=_BREADTH,
        hypotheses=settings.hypotheses,
        log_negligible=math.log(settings.negligible),
        same=_SAME,
        memory=1.0 - 1.0 / settings.window,
        most_surprise=float(scipy.special.chdtri(observed.channels, tail)),
        unique_above=settings.unique_above,
        from_scene=shared.from_scene,
    )


def is_felt(shared: NuisanceJacobian) -> bool:
    """Tell whether errors that frames share are felt beside the noise."""
    return bool(np.abs(shared.along).max(initial=0.0) > _SHARED)


class MisfitLimits(NamedTuple):
    """Above what a frame is a misfit."""

    surprise: float  # running surprise
    unsteady: float  # running mean of changes across the curve
    lasting: float  # mean of what is left across the curve, in standard deviations of what may be
    outliers: float  # outliers one after another, from so many on


def misfit_limits(
    settings: TrackingSettings, rules: Rules, channels: int, shared: NuisanceJacobian
) -> MisfitLimits:
    """Return the limits, each passed by chance as often as the settings allow.

    Parameters
    ----------
    settings : TrackingSettings
        With the probability of a false alarm.
    rules : Rules
        With the memory of the means.
    channels : int
        Readings of a frame that are used.
    shared : NuisanceJacobian
        What all frames err in common.
    """
    return MisfitLimits(
        surprise_limit(settings, rules, channels, shared),
        unsteady_limit(settings, rules),
        -float(scipy.special.ndtri(0.5 * settings.false_alarm)),
        outliers_limit(settings),
    )


def outliers_limit(settings: TrackingSettings) -> float:
    """Return how many outliers one after another are not there by chance, two at least.

    Parameters
    ----------
    settings : TrackingSettings
        With the probabilities of an outlier and of a false alarm.
    """
    if settings.outlier <= settings.false_alarm:
        return 2.0
    many = math.log(settings.false_alarm) / math.log(settings.outlier)
    return max(math.ceil(many - 1e-9), 2.0)


def surprise_limit(
    settings: TrackingSettings, rules: Rules, channels: int, shared: NuisanceJacobian
) -> float:
    """Return the running surprise above which the model does not fit.

    An exponential mean of chi-squares has the first two moments of a gamma law. Where frames err in
    common, one that surprises may be followed by others of the same surprise: the mean is then as
    wide as that of a single frame.

    Parameters
    ----------
    settings : TrackingSettings
        With the probability of a false alarm.
    rules : Rules
        With the memory of the mean.
    channels : int
        Readings of a frame that are used.
    shared : NuisanceJacobian
        What all frames err in common.
    """
    if is_felt(shared):
        return float(scipy.special.chdtri(channels, settings.false_alarm)) / channels
    freedom = 0.5 * channels * (1.0 + rules.memory) / (1.0 - rules.memory)
    return float(scipy.special.gammainccinv(freedom, settings.false_alarm)) / freedom


def unsteady_limit(settings: TrackingSettings, rules: Rules) -> float:
    """Return the running mean of changes across the curve above which noise is not as stated.

    As `surprise_limit`; but neighbours share a frame, so that their squares are correlated by 1/4,
    and the mean is as wide as that of two thirds as many.

    Parameters
    ----------
    settings, rules : TrackingSettings, Rules
        As for `surprise_limit`.
    """
    freedom = 0.5 * (1.0 + rules.memory) / (1.0 - rules.memory) / (1.0 + 0.5 * rules.memory)
    return float(scipy.special.gammainccinv(freedom, settings.false_alarm)) / freedom
