"""What an answer owes to frames in the dark: ranges that their own readings hardly tell.

Such a frame lies at the end of the curve of readings. Where many do, what they say together of the
other unknowns depends on how ranges are supposed to be spread out there, which no law of the ranges
leaves open (docs/model.md, reference-prior).
"""

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.frame.known_range import rates_of
from inference.frame.range_prior import LEAST_INFORMATION
from inference.frame.warmth import gains_of
from inference.identifiability.experiment import Experiment
from inference.identifiability.status import Identifiability, weak_at_best
from simulator.scene import Reference

__all__ = ["mark_dark"]

Array = NDArray[np.float64]

_MANY = 1 / 3  # of the frames with an object: the bias reaches 1.5 standard deviations
_DRAWS = 20


def mark_dark(
    density: CollapsedDensity, rows: tuple[Identifiability, ...], z: Array, log_r: Array
) -> tuple[Identifiability, ...]:
    """Mark as weak at best what many frames in the dark may have moved.

    Parameters
    ----------
    density : CollapsedDensity
        The density; only under a reference prior of the ranges are there such frames.
    rows : tuple of Identifiability
        As judged by the spread of the draws.
    z : ndarray, shape (n, d)
        Draws of equal weight.
    log_r : ndarray, shape (n, frames)
        Their ranges; nan for a frame without object.

    Returns
    -------
    tuple of Identifiability
    """
    if not (len(density.parameters) and isinstance(density.parameters.range_prior, Reference)):
        return rows
    chosen = np.linspace(0, len(z) - 1, min(len(z), _DRAWS)).astype(int)
    told = [_told(density, z[i], log_r[i]) for i in chosen]
    present = np.isfinite(log_r[0])
    dark = int((np.median(told, axis=0)[present] < LEAST_INFORMATION).sum())
    if not dark > _MANY * present.sum():
        return rows
    reason = (
        f"but {dark} of {int(present.sum())} frames tell their range to worse than a fifth of "
        "itself, and what so many say together rests on where ranges in the dark are supposed to "
        "lie: leave these frames out, or measure with more light"
    )
    return weak_at_best(rows, reason)


def _told(density: CollapsedDensity, z: Array, log_r: Array) -> Array:
    """Return the information on every log r, shape (frames,), of readings and of what is known."""
    rates, gain = rates_of(density.frames), gains_of(density.frames)
    of = Experiment(density.sensor, density.parameters, z, log_r, gain, rates=rates)
    told = np.square(of.whitened_terms()[1]).sum(axis=1)
    return np.asarray(told if of.beside is None else told + np.square(of.beside[0]).sum(axis=1))
