"""Scouts, and rounds of importance draws that begin where these stand and stood.

A small population is carried from the prior alone. It finds every branch and weighs none; where it
stood on its way shows how far tails reach that hold some thousandths, which rounds from its end
alone left out without a sign in their weights.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.job import Job
from inference.posterior.sampling.aliases import aliases_of
from inference.posterior.sampling.effort import scouts
from inference.posterior.sampling.ensemble import WALKERS
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.population import arrived_at, first_population, temper
from inference.posterior.sampling.proposal import Proposal
from inference.posterior.sampling.reparametrisation import reparametrisation_of
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.stages.chunk import evaluations
from inference.posterior.stages.ensembles import POPULATIONS
from inference.posterior.stages.setting_out import HALFWAY_DRAWS, SCOUTED_DRAWS
from inference.posterior.stages.stage import Tempering

__all__ = ["Scouts", "from_scouts", "send_scouts", "thinned"]

Array = NDArray[np.float64]

_MOST_FRAMES = 200  # at most; the walkers then start the wider, the more frames there are
_SCOUTS = 2 * WALKERS
_HOT = 0.003  # power of the likelihood, from which on places are remembered
_HALFWAY = 0.3  # power of the likelihood at which small populations stop
_MOST_S = 10  # seconds that rounds may take


class Scouts(NamedTuple):
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


def send_scouts(density: CollapsedDensity, rng: np.random.Generator) -> tuple[Scouts, int]:
    """Send out scouts; with the evaluations that it took."""
    effort = scouts(_SCOUTS)
    found = first_population(density, rng, effort)
    hot = [found.z[:0]]
    while not found.ended:
        found = temper(density, found, rng, effort)
        if found.power > _HOT:
            hot.append(found.z)
    total = found.log_likelihood + found.log_prior
    # a random half: the better half would lose a mode of little density, however wide
    _, first = np.unique(found.z, axis=0, return_index=True)
    kept = rng.permutation(first)[:WALKERS]
    z = found.z[kept[np.argsort(-total[kept])]]
    return Scouts(z, np.unique(np.concatenate(hot), axis=0)), found.calls


def thinned(density: CollapsedDensity) -> CollapsedDensity:
    """Return the density of some of the frames, spread over all: enough to show every branch."""
    n = len(density.frames)
    if n <= _MOST_FRAMES:
        return density
    chosen = np.linspace(0, n - 1, _MOST_FRAMES).round().astype(int)
    present = None if density.present is None else density.present[chosen]
    frames = np.ascontiguousarray(density.frames[chosen])
    return dataclasses.replace(density, frames=frames, present=present, weights=None)


def from_scouts(
    job: Job,
    density: CollapsedDensity,
    proposal: Proposal,
    stood: Scouts,
    known: WeightedDraws | None,
) -> Tempering | None:
    """Go on from the scouts; None where rounds of importance draws would take long.

    Where crosstalk and a background are confounded, or a background has aliases, so few points
    that never unbent what they stand on are no beginning: small populations are carried first.
    """
    hard = reparametrisation_of(density) is not None or aliases_of(density) is not None
    draws = HALFWAY_DRAWS if hard else SCOUTED_DRAWS
    cheap = _MOST_S * evaluations(job) >= draws and len(density.frames) <= _MOST_FRAMES
    pending = Verdict(False, ("no steps were made",))
    if cheap and hard:
        return Tempering(proposal, (None,) * POPULATIONS, pending, known, reach=_HALFWAY)
    if not (cheap and len(stood.hot) > stood.hot.shape[1]):
        return None
    arrived = arrived_at(stood.z), arrived_at(stood.hot)
    return Tempering(proposal, arrived, pending, known, scouted=True)
