"""Whether light at rest and an error of the flux leave the ranges' scale open."""

import dataclasses

from inference.identifiability.expected_posterior import ExpectedPosterior, expected_posterior
from inference.identifiability.experiment import Experiment

__all__ = ["left_open"]

_HELP = 2.0  # a term is to blame where the scale would be known so many times better with it known
_ALIKE = (
    ": {term} and an error of the object's flux of {error:.2g}, as `discrepancy` allows for, look "
    "alike in these frames and leave it open by {spread:.2g} of itself, more than the error of the "
    "flux; were {term} known{how}, it would be known to {known:.2g}"
)
_STATIC = {"crosstalk": ", as frames without the object tell it", "background": ""}


def left_open(
    experiment: Experiment, scale: float, expected: ExpectedPosterior | None
) -> str | None:
    """Say so where an error of the flux and light that stands still leave the ranges' scale open.

    Unknown crosstalk takes up what a smooth error of the flux bends: all ranges then stretch
    together, by more than the flux may err, and how far is decided by how right the model is taken
    to be, not by the readings.

    Parameters
    ----------
    experiment : Experiment
        Where it is computed.
    scale : float
        Standard deviation of the mean of log r.
    expected : ExpectedPosterior or None
        At the experiment.

    Returns
    -------
    str or None
        The end of a sentence; None for an object at rest, whose flux errs as its c2 does.
    """
    error = experiment.discrepancy
    if error is None or expected is None or experiment.common_range or not scale > error:
        return None
    for term, how in _STATIC.items():
        group = tuple(name for name in experiment.parameters.names if name.startswith(term))
        if not group:
            continue
        known = expected_posterior(dataclasses.replace(experiment, known=group)).scale_sd
        if _HELP * known < expected.scale_sd:
            return _ALIKE.format(term=term, how=how, error=error, spread=scale, known=known)
    return None
