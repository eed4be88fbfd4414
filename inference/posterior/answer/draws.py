"""The draws behind an answer: parameters, ranges, replicated readings."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.replicate import replicate
from inference.posterior.job import Job
from inference.posterior.sample import Sample
from inference.posterior.sampling.diagnostics import effective_sample_size

__all__ = ["Draws", "draws_of"]

Array = NDArray[np.float64]

_LEAST = 1000
_PER_EFFECTIVE = 2.0  # draws of ranges for every effective draw: the error grows by a fifth
_SHARE = 1.0 / 16.0  # of all draws: one with ranges costs four times as much as one without
_MOST_FRAMES = 1_000_000  # draws times frames, some ten seconds, for which the least may be cut
_FEWEST = 100


@dataclasses.dataclass(frozen=True, eq=False)
class Draws:
    """Draws from the posterior.

    Ranges and readings are drawn for even steps of every walker, twice as many as the parameters'
    effective sample size, or a sixteenth of all draws, but a thousand at least.

    Attributes
    ----------
    names : tuple of str
        Parameters.
    parameters : ndarray, shape (ensembles, walkers, steps, d)
        In SI units; with importance sampling one ensemble of one walker, resampled by weight.
    log_density : ndarray, shape (ensembles, walkers, steps)
        Log posterior density in the prior's normal coordinates, ranges integrated out.
    step : ndarray of int, shape (steps,)
        Number of each step; the burn-in is counted, but left out.
    accepted : ndarray of bool, shape (ensembles, walkers, steps)
        Whether the walker moved in that step.
    mode : ndarray of int, shape (ensembles, walkers, steps)
        Index among `Posterior.modes` of the optimum that each draw belongs to.
    thinned : ndarray of int, shape (t,)
        Indices of the steps that have ranges.
    range_m : ndarray, shape (ensembles, walkers, t, frames)
        Ranges [m] given the parameters; nan where a frame holds no object or is saturated.
    readings : ndarray, shape (ensembles, walkers, t, frames, 2)
        Readings drawn anew at these parameters and ranges; nan for a saturated frame.
    log_likelihood : ndarray, shape (ensembles, walkers, t, frames)
        log p(readings of the frame | parameters), its range integrated out; nan likewise.
    widened : bool
        Whether parameters and ranges are moved by a random part of what the law of the ranges or
        the number of frames would move them, or mixed with those of a glossy object: they are then
        not those of the posterior whose `log_density` this is.
    unfinished : float
        Share of the integrals over ranges that did not settle: what was drawn is then not the
        posterior.
    """

    names: tuple[str, ...]
    parameters: Array
    log_density: Array
    step: NDArray[np.intp]
    accepted: NDArray[np.bool_]
    mode: NDArray[np.intp]
    thinned: NDArray[np.intp]
    range_m: Array
    readings: Array
    log_likelihood: Array
    widened: bool = False
    unfinished: float = 0.0


def _count(sample: Sample, frames: int) -> int:
    """Return how many draws have ranges: as many as they are worth, bounded by what they cost."""
    size = sample.log_density.size
    ess = float(size)
    if sample.chains is not None:
        columns = np.moveaxis(sample.z, -1, 0)
        sizes = [effective_sample_size(column, sample.chains.start) for column in columns]
        ess = min((size for size in sizes if math.isfinite(size)), default=0.0)
    elif sample.weighted is not None:
        ess = sample.weighted.ess
    wanted = max(min(_PER_EFFECTIVE * ess, _SHARE * size), _LEAST)
    return int(min(wanted, max(_MOST_FRAMES // frames, _FEWEST)))


def draws_of(
    density: CollapsedDensity,
    job: Job,
    sample: Sample,
    rng: np.random.Generator,
    parts: int = 1,
) -> Draws:
    """Draw ranges and readings to a sample of the parameters.

    Parameters
    ----------
    parts : int
        How many jobs the frames were dealt out to, of which this is one: what all cost counts.
    """
    ensembles, walkers, steps = sample.log_density.shape
    d, frames = sample.z.shape[-1], len(job.frames)
    count = _count(sample, parts * len(density.frames))
    each = min(max(math.ceil(count / (ensembles * walkers)), 1), steps)
    thinned = np.linspace(0, steps - 1, each).astype(np.intp)
    z = sample.z[:, :, thinned].reshape(ensembles * walkers * each, d)
    log_r, likelihood, lost = density.draw_with_likelihoods(z, rng)
    readings = replicate(density, z, log_r, rng)
    usable = job.usable

    def of_all_frames(values: Array) -> Array:
        whole = np.full((ensembles, walkers, each, frames, *values.shape[2:]), np.nan)
        whole[:, :, :, usable] = values.reshape(ensembles, walkers, each, *values.shape[1:])
        return whole

    return Draws(
        density.parameters.names,
        density.parameters.natural(sample.flat).reshape(sample.z.shape),
        sample.log_density,
        sample.step,
        sample.accepted,
        sample.mode,
        thinned,
        of_all_frames(np.exp(log_r)),
        of_all_frames(readings),
        of_all_frames(likelihood),
        unfinished=lost / max(len(z) * density.data.blocks, 1),
    )
