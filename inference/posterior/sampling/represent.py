"""How many frames are stood for by few: where their likelihoods must agree, and whether they do."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.representatives import (
    Representatives,
    calibrated,
    drawn_by_information,
    standing_for,
)
from inference.posterior.sampling.proposal import mixture_of
from inference.posterior.sampling.start import Optimum, refine

__all__ = ["doubts", "represent"]

Array = NDArray[np.float64]

_POINTS = 1.5  # by the number of quadratic terms, at which likelihoods are made to agree
_FRAMES = 3  # for each such point
_LEAST_FRAMES = 300
_WIDER = 1.5  # than the posterior: where walkers go
_PASSES = 8
_MATTERS = 20.0  # nats below the best
_AGREED = 0.05  # nats: what is made to agree then is far better
_EVALUATIONS = 1_000_000  # of one frame, for the check
_CHECKS = (20, 60)
_MOST_OFF = 0.1  # nats, standard deviation over the posterior


def represent(
    density: CollapsedDensity, optima: Sequence[Optimum], rng: np.random.Generator
) -> tuple[Representatives, list[Optimum], int]:
    """Choose frames that stand for all in the posterior of all.

    Parameters
    ----------
    density : CollapsedDensity
        Of all frames.
    optima : sequence of Optimum
        Of the density of some of them, the best first: wider than that of all.

    Returns
    -------
    (Representatives, list of Optimum, int)
        With the optima of the density of all, the best first, and how often it was evaluated.

    Notes
    -----
    Likelihoods are made to agree where the posterior of some frames lies, which leads to that of
    all; then there, and so on until they agreed before they were made to.
    """
    d = optima[0].z.size
    points = math.ceil(_POINTS * (d + 1) * (d + 2) / 2)
    count = max(_LEAST_FRAMES, 2 * _FRAMES * points)
    found, rows, standing, calls = list(optima), [np.empty((0, len(density.frames)))], None, 0
    for _ in range(_PASSES):
        spread = [dataclasses.replace(each, factor=_WIDER * each.factor) for each in found]
        z = np.concatenate([found[0].z[None], mixture_of(spread).draw(rng, points)])
        likelihoods = density.frame_log_likelihoods(z)
        calls += len(z)
        inside = np.isfinite(likelihoods).all(axis=1)
        z, likelihoods = z[inside], likelihoods[inside]
        off = math.inf
        if standing is not None:
            off = float(np.std(likelihoods.sum(axis=1) - standing.log_likelihood(z)))
        likelihoods[1:] -= likelihoods[0]
        rows = [rows[-1], likelihoods]
        by = drawn_by_information(density, found[0].z, count, rng)
        by = calibrated(by, np.concatenate(rows))
        standing = standing_for(density, by)
        refined = [refine(standing, each.z) for each in found]
        found = _distinct([each for each in refined if each is not None]) or found
        if off < _AGREED:
            break
    return by, found, calls


def _distinct(optima: Sequence[Optimum]) -> list[Optimum]:
    """Return those that matter, the best first."""
    kept: list[Optimum] = []
    for one in sorted(optima, key=lambda optimum: -optimum.log_density):
        if not any(other.is_near(one.z) for other in kept):
            kept.append(one)
    return [one for one in kept if one.log_density > kept[0].log_density - _MATTERS]


def doubts(density: CollapsedDensity, standing: CollapsedDensity, z: Array) -> tuple[str, ...]:
    """Hold the frames that stand for all to all of them, at draws.

    Parameters
    ----------
    density, standing : CollapsedDensity
        Of all frames, and of those that stand for them.
    z : ndarray, shape (n, d)
        Draws of the second.

    Returns
    -------
    tuple of str
        Why not to believe draws, if at all. No mean of the posterior is off by more of its own
        standard deviations than the difference of the two has nats of standard deviation over the
        draws (the covariance with the log of a weight, to first order in it).
    """
    count = int(np.clip(_EVALUATIONS // len(density.frames), *_CHECKS))
    chosen = z[np.linspace(0, len(z) - 1, min(count, len(z))).astype(int)]
    off = float(np.std(density.log_likelihood(chosen) - standing.log_likelihood(chosen), ddof=1))
    if off <= _MOST_OFF:
        return ()
    return (
        f"{len(standing.frames)} frames were sampled in the name of {len(density.frames)}, and "
        f"their likelihood follows that of all only to {off:.2g} nats: an answer may be off by as "
        "many standard deviations; send fewer frames, or state more of the scene",
    )
