"""What an answer owes to frames in the dark: ranges that their own readings hardly tell.

Such a frame lies at the end of the curve of readings. Where many do, what they say together of the
other unknowns depends on how ranges are supposed to be spread out there, which no law of the ranges
leaves open (docs/model.md, reference-prior). So does an unknown that few of them tell, where the
other frames tell next to nothing of it.
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
_MOST = 0.5  # of the sd that the other frames leave: three quarters of what is known are the dark's
_DRAWS = 20


def mark_dark(
    density: CollapsedDensity, rows: tuple[Identifiability, ...], z: Array, log_r: Array
) -> tuple[Identifiability, ...]:
    """Mark as weak at best what frames in the dark may have moved.

    All, where they are many; else what they alone tell.

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
    """
    if not (len(density.parameters) and isinstance(density.parameters.range_prior, Reference)):
        return rows
    chosen = np.linspace(0, len(z) - 1, min(len(z), _DRAWS)).astype(int)
    looked_at = [_experiment(density, z[i], log_r[i]) for i in chosen]
    present = np.isfinite(log_r[0])
    in_dark = np.median([_told(each) for each in looked_at], axis=0) < LEAST_INFORMATION
    dark = int(in_dark[present].sum())
    if dark > _MANY * present.sum():
        reason = (
            f"but {dark} of {int(present.sum())} frames tell their range to worse than a fifth of "
            "itself, and what so many say together rests on where ranges in the dark are supposed "
            "to lie: leave these frames out, or measure with more light"
        )
        return weak_at_best(rows, reason)
    if not dark or looked_at[0].beside is not None:
        return rows
    light = ~in_dark | ~present
    without = np.median([_sd_by(each, light, density.weights) for each in looked_at], axis=0)
    alone = z.std(axis=0) < _MOST * without
    names = {name for name, own in zip(density.parameters.names, alone, strict=True) if own}
    reason = (
        f"but what is known of it comes from {dark} of {int(present.sum())} frames that tell their "
        "range to worse than a fifth of itself, and rests on where ranges in the dark are supposed "
        "to lie: give frames without an object, or measure with more light"
    )
    return tuple(weak_at_best([row], reason)[0] if row.parameter in names else row for row in rows)


def _experiment(density: CollapsedDensity, z: Array, log_r: Array) -> Experiment:
    gain, rates = gains_of(density.frames), rates_of(density.frames)
    return Experiment(density.sensor, density.parameters, z, log_r, gain, rates=rates)


def _told(of: Experiment) -> Array:
    """Return the information on every log r, shape (frames,), of readings and of what is known."""
    told = np.square(of.whitened_terms()[1]).sum(axis=1)
    return np.asarray(told if of.beside is None else told + np.square(of.beside[0]).sum(axis=1))


def _sd_by(of: Experiment, chosen: NDArray[np.bool_], weights: Array | None) -> Array:
    """Return what some of the frames and the priors leave of the unknowns, shape (d,), linearly.

    Every range is free. In the coordinates in which the prior is standard normal.
    """
    by_term, along, _ = of.whitened_terms()
    by_z = (by_term @ of.change)[chosen]
    along = np.nan_to_num(along[chosen])  # a frame without object has no range
    square = np.square(along).sum(axis=1)
    share = np.einsum("ni,nij->nj", along, by_z) / np.where(square > 0.0, square, 1.0)[:, None]
    rest = by_z - along[:, :, None] * share[:, None, :]
    if weights is not None:
        rest = rest * np.sqrt(weights[chosen])[:, None, None]
    d = rest.shape[2]
    upper = np.linalg.qr(np.concatenate([np.eye(d), rest.reshape(-1, d)]), mode="r")
    return np.asarray(np.linalg.norm(np.linalg.inv(upper), axis=1))
