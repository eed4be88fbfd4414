"""What an answer from many frames owes to their number: a bias that no frame shows.

Every frame has a range of its own, and the law of that range moves what the frame tells of all
else by a small part of its noise, all frames in one direction (Neyman and Scott 1948). The noise
averages out over the frames; that does not. It is measured: readings are drawn anew at given
parameters and ranges, and the slope of their likelihood there, which should be zero in the mean,
is not.
"""

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.replicate import replicate_frames
from inference.posterior.criticism.prior_sensitivity import PriorSensitivity

__all__ = ["bias_of_many_frames", "following"]

Array = NDArray[np.float64]

_EVALUATIONS = 1_000_000  # of one frame
_FEWEST, _MOST = 3, 20  # sets of readings drawn anew


def bias_of_many_frames(density: CollapsedDensity, z: Array, rng: np.random.Generator) -> Array:
    """Measure by how much the posterior of all frames misses parameters that are known.

    Parameters
    ----------
    density : CollapsedDensity
        Of all frames.
    z : ndarray, shape (n, d)
        Draws of its posterior.

    Returns
    -------
    ndarray, shape (d,)
        Of z; known to a standard deviation of the posterior over the root of the number of sets of
        readings, which are 3 at least.
    """
    d, n = z.shape[1], len(density.frames)
    centre = z.mean(axis=0)
    factor = scipy.linalg.qr((z - centre) / np.sqrt(len(z)), mode="economic")[1].T
    sets = int(np.clip(_EVALUATIONS // (2 * d * n), _FEWEST, _MOST))
    log_r = density.draw_log_ranges(centre[None], rng)
    points = np.concatenate([centre + factor.T, centre - factor.T])
    slopes = []
    for _ in range(sets):
        frames = replicate_frames(density, centre[None], log_r, rng)[0]
        values = dataclasses.replace(density, frames=frames).log_likelihood(points)
        slopes.append(0.5 * (values[:d] - values[d:]))
    slope = np.mean(slopes, axis=0)
    return np.asarray(factor @ np.where(np.isfinite(slope), slope, 0.0))


def following(bias: Array, z: Array, log_r: Array) -> PriorSensitivity:
    """Return what a bias of the parameters does to ranges, by the draws of both.

    Parameters
    ----------
    bias : ndarray, shape (d,)
        From `bias_of_many_frames`.
    z : ndarray, shape (n, d)
        Draws.
    log_r : ndarray, shape (n, frames)
        Their ranges; nan for a frame without object.
    """
    present = np.isfinite(log_r[0])
    ranges = np.where(present, log_r, 0.0)
    scale = log_r[:, present].mean(axis=1) if present.any() else np.zeros(len(z))
    columns = np.column_stack([scale, ranges])
    slope = scipy.linalg.lstsq(z - z.mean(axis=0), columns - columns.mean(axis=0))[0]
    moved, sd = bias @ slope, z.std(axis=0)
    spread = float(scale.std())
    return PriorSensitivity(
        np.divide(bias, sd, out=np.zeros_like(bias), where=sd > 0),
        float(moved[0]) / spread if spread > 0 else 0.0,
        bias,
        moved[1:],
        "so many frames move it by {:.1f} standard deviations of what was drawn, all in one "
        "direction, as each has a range of its own to be told: its interval is widened by that; "
        "frames with more light, or means of frames at one range, are moved less",
    )
