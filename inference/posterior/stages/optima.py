"""Optima that were found: which of them matter, and which an exact model alone rules out.

Sampling follows the noise of the readings, and what the model's errors add is computed by linear
response around its draws. Where an optimum far below the best one is more probable than that once
errors of the flux are integrated out, no response around the best one leads there.
"""

from collections.abc import Sequence

import numpy as np

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import with_discrepancy
from inference.posterior.job import Job
from inference.posterior.sampling.start import Optimum, refine

__all__ = ["depend_on_errors", "that_matter"]

_MATTERS = 20.0  # nats below the best: what is there holds some billionths
_AHEAD = 10.0  # nats of mass, where errors are integrated out: along a sheet it differs by as many
_WITHIN_REACH = 100.0  # nats below the best there, of what is as yet not refined
_MOST = 2  # optima of either kind that are compared, the best first


def that_matter(optima: Sequence[Optimum]) -> list[Optimum]:
    """Return those, the best first, that are not negligible beside it."""
    return [one for one in optima if one.log_density > optima[0].log_density - _MATTERS]


def depend_on_errors(job: Job, density: CollapsedDensity, optima: Sequence[Optimum]) -> bool:
    """Tell whether it is the model's errors that decide which optimum is the best.

    Parameters
    ----------
    job : Job
        Whose scene says what errors there may be.
    density : CollapsedDensity
        Of an exact model.
    optima : sequence of Optimum
        Of this density, all that were found, the best first.

    Returns
    -------
    bool
        False where errors are integrated out already, or cannot be.
    """
    best = max(one.log_mass for one in optima)
    near = [one for one in optima if one.log_mass >= best - _MATTERS]
    far = [one for one in optima if one.log_mass < best - _MATTERS]
    if not (far and job.can_integrate_error):
        return False
    erring = with_discrepancy(density, job.scene.allowed_error.flux)
    here, there = (erring(np.array([one.z for one in some])) for some in (near, far))
    within = there > here.max() - _WITHIN_REACH
    if not within.any():
        return False
    near = sorted(near, key=lambda one: -one.log_mass)
    far = [one for one, reached in zip(far, within, strict=True) if reached]
    return _mass(erring, far[:_MOST]) > _mass(erring, near[:_MOST]) + _AHEAD


def _mass(density: CollapsedDensity, optima: Sequence[Optimum]) -> float:
    """Return the largest log mass that climbs from some optima come to."""
    refined = [refine(density, one.z) for one in optima]
    return max((one.log_mass for one in refined if one is not None), default=-np.inf)
