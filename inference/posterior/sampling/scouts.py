"""A small population that is carried from the prior alone, and is told of no optimum.

It finds every branch and weighs none; where it stood on its way shows how far tails reach that hold
some thousandths, which rounds of importance draws from its end alone left out without a sign in
their weights.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.effort import scouts
from inference.posterior.sampling.ensemble import WALKERS
from inference.posterior.sampling.population import first_population, temper
from inference.posterior.sampling.start import Finish, Optimum, added, climb, refine

__all__ = ["MOST_FRAMES", "Scouts", "led_to", "send_scouts", "thinned"]

Array = NDArray[np.float64]

MOST_FRAMES = 200  # at most; the walkers then start the wider, the more frames there are
_SCOUTS = 2 * WALKERS
_HOT = 0.003  # power of the likelihood, from which on places are remembered
# temperatures: of 75 wide random sets up to a signal-to-noise ratio of 1e6 none took half as many;
# readings that no parameters explain are a million nats apart from member to member
_MOST = 200
# and of those that stop on their way, who mostly need 20 to 40: who lag behind then are lost in a
# valley far below the posterior, and what they found there counts for nothing
_MOST_HALFWAY = 45


@dataclasses.dataclass(frozen=True, eq=False)
class Scouts:
    """Points that came from the prior alone, and know nothing of the optima.

    Attributes
    ----------
    z : ndarray, shape (n, d)
        Where scouts stand, the best first: an ensemble that starts there can contradict others.
    hot : ndarray, shape (m, d)
        Where they stood on their way, from a small power of the likelihood on: beyond them, and
        at the ends of its tails.
    """

    z: Array
    hot: Array


def send_scouts(
    density: CollapsedDensity, rng: np.random.Generator, reach: float = 1.0
) -> tuple[Scouts, int]:
    """Send out scouts; with the evaluations that it took.

    They stay where they are where readings that nothing explains keep them on their way.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    rng : numpy.random.Generator
        Source of randomness.
    reach : float
        Power of the likelihood from which on they need not go on; below 1 they take fewer
        temperatures at most, too.

    Returns
    -------
    (Scouts, int)
        The scouts, and density evaluations.
    """
    effort, most = scouts(_SCOUTS), _MOST if reach == 1.0 else _MOST_HALFWAY
    found = first_population(density, rng, effort)
    hot = [found.z[:0]]
    while not found.ended and found.power < reach and found.steps < most:
        found = temper(density, found, rng, effort)
        if found.power > _HOT:
            hot.append(found.z)
    total = found.log_likelihood + found.log_prior
    # a random half: the better half would lose a mode of little density, however wide
    _, first = np.unique(found.z, axis=0, return_index=True)
    kept = rng.permutation(first)[:WALKERS]
    z = found.z[kept[np.argsort(-total[kept])]]
    return Scouts(z, np.unique(np.concatenate(hot), axis=0)), found.calls


def led_to(
    scouts: Scouts, density: CollapsedDensity, optima: Sequence[Optimum], finish: Finish = refine
) -> list[Optimum]:
    """Return optima, the best first, with those that the best scout leads to.

    Parameters
    ----------
    scouts : Scouts
        None of them, perhaps.
    density : CollapsedDensity
        Of the optima.
    optima : sequence of Optimum
        Found before.
    finish : callable
        What makes an optimum of the end of a climb: `refine` or `roughly`.
    """
    if not len(scouts.z):
        return list(optima)
    found = added(optima, finish(density, climb(density, scouts.z[0])[0]))
    return added(found, finish(density, scouts.z[0]))


def thinned(density: CollapsedDensity) -> CollapsedDensity:
    """Return the density of some of the frames, spread over all: enough to show every branch."""
    n = len(density.frames)
    if n <= MOST_FRAMES:
        return density
    chosen = np.linspace(0, n - 1, MOST_FRAMES).round().astype(int)
    present = None if density.present is None else density.present[chosen]
    frames = np.ascontiguousarray(density.frames[chosen])
    return dataclasses.replace(density, frames=frames, present=present, weights=None)
