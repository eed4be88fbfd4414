"""Whether errors of the model are to be integrated out in full, and where rounds with them begin.

Draws of an exact model are moved by its errors along straight lines. Where the next order would
change that by much, and it is most of what the answer does not know, the error of the flux is
integrated out in full: rounds of importance draws begin at the moved draws.

An exact model is not sampled to the end first. The draws of a warm start, or those of Laplace
shapes where these do not fit it, tell as well whether its errors bend; with errors integrated out
the posterior is wider, and nearer to its own shape. The exact model follows where rounds there
fail.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.moves import Moves
from inference.posterior.answer.responses import (
    MEASURED,
    Responses,
    chosen_draws,
    first_responses,
    flux_leads,
    repeated,
)
from inference.posterior.criticism.discrepancy_check import is_bent, may_be_bent, misses
from inference.posterior.criticism.prior_conflict import are_far_out
from inference.posterior.job import Job
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.population import arrived_at
from inference.posterior.sampling.proposal import Mixture, Proposal, mixture_of
from inference.posterior.sampling.reparametrisation import reparametrisation_of
from inference.posterior.sampling.scouts import Scouts
from inference.posterior.sampling.start import Optimum, added, climb, refine
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.sampling.warm import MAP_SHARE
from inference.posterior.stages.optima import that_matter
from inference.posterior.stages.stage import Tempering
from inference.posterior.streams import Stream

__all__ = ["MEMBERS", "RANKED", "AtOnce", "at_once", "bending", "from_moved", "moved_by"]

Array = NDArray[np.float64]

MEMBERS = 400  # draws that are moved
_CLIMBS = 2  # from the best of these
RANKED = 100
# draws of Laplace shapes that are followed, and errors that are beyond the first order: both tell
# whether the response bends, not by how much
_FOLLOWED, _TRIED = 20, 50


def bending(
    job: Job,
    density: CollapsedDensity,
    draws: Array,
    chosen: Array,
    rng: np.random.Generator,
    tried: int = MEASURED,
) -> Responses | None:
    """Return how draws follow the model's errors, where these are to be integrated out.

    Parameters
    ----------
    density : CollapsedDensity
        Of an exact model.
    draws : ndarray, shape (m, d)
        Of it, or nearly.
    chosen : ndarray, shape (n, d)
        Of them, that are followed.
    tried : int
        As of `repeated`.

    Returns
    -------
    Responses or None
        None where linear response stands, or the errors are mostly a shadow's, which is not
        integrated.
    """
    log_r = density.draw_log_ranges(chosen, rng)
    if not np.isfinite(log_r[0]).any():
        return None
    by_noise = float(log_r[:, np.isfinite(log_r[0])].mean(axis=1).std())
    found = first_responses(job, density, chosen, log_r, rng)
    # a prior that the readings contradict is to be named, not explained by errors of the model
    may_miss = not are_far_out(density, draws)
    if not _bent(may_be_bent, found, by_noise, may_miss):
        return None
    found = repeated(job, found, rng, tried)
    if not _bent(is_bent, found, by_noise, may_miss):
        return None
    return found if flux_leads(found) else None


def _bent(
    test: Callable[[float, float, float], bool], found: Responses, by_noise: float, may_miss: bool
) -> bool:
    """Tell whether the response bends, of the scale or by what it misses of an unknown."""
    model = found.of_scale
    bent = test(model, math.hypot(model, by_noise), found.curvature)
    return bent or (may_miss and misses(found.missed))


def moved_by(found: Responses, z: Array, rng: np.random.Generator) -> Array:
    """Return draws, shape (n, d), moved by random errors."""
    moves = Moves(found.z, found.log_r, found.by_z, found.by_log_r)
    return moves.moved(z, moves.errors(len(z), rng))


def from_moved(
    density: CollapsedDensity, z: Array, others: Sequence[Array] = (), *, near: bool = True
) -> Tempering | None:
    """Set up rounds of importance draws from points; None where the density leaves too few.

    Parameters
    ----------
    density : CollapsedDensity
        With errors integrated out.
    z : ndarray, shape (n, d)
        The points.
    others : sequence of ndarray
        Points that know nothing of them, and are to contradict what the draws leave out.
    near : bool
        Whether the points are draws of the exact model, that were moved by its errors.
    """
    z = z[np.isfinite(density.parameters.log_prior(z))]
    value = density(z[:RANKED])  # rounds evaluate all
    if np.isfinite(value).sum() <= 2 * z.shape[1]:
        return None
    optima: list[Optimum] = []
    for i in np.argsort(-value)[:_CLIMBS]:
        optima = added(optima, refine(density, climb(density, z[i])[0]))
    if not optima:
        return None
    proposal = Proposal(mixture_of(that_matter(optima)), None, MAP_SHARE)
    pending = Verdict(False, ("no steps were made",))
    members = tuple(arrived_at(one) for one in (z, *others) if len(one))
    return Tempering(proposal, members, pending, scouted=True, near=near)


class AtOnce(NamedTuple):
    """What draws tell before an exact model is sampled to the end.

    Attributes
    ----------
    bent : bool or None
        Whether its errors are to be integrated out; None where the draws do not tell.
    stage : Tempering or None
        Where rounds begin then.
    calls : int
        Density evaluations that it took.
    """

    bent: bool | None
    stage: Tempering | None
    calls: int


def at_once(
    job: Job, density: CollapsedDensity, known: Mixture | WeightedDraws, scouts: Scouts
) -> AtOnce:
    """Begin with errors integrated out, where they are to be.

    Not where crosstalk and a background are confounded: so few points are no beginning there, and
    what rounds that fail have taken is lost.

    Parameters
    ----------
    density : CollapsedDensity
        Of an exact model.
    known : Mixture or WeightedDraws
        Its Laplace shapes, where these do not fit it; or draws of it, which tell all that more of
        them would.
    scouts : Scouts
        Told of none of them.
    """
    if not job.can_integrate_error or reparametrisation_of(density) is not None:
        return AtOnce(None, None, 0)
    rng = job.stream(Stream.RESPONSE, 1)
    if isinstance(known, WeightedDraws):
        z, near, calls = known.z[rng.choice(len(known.z), size=MEMBERS, p=known.weights)], True, 0
        followed, tried = z[chosen_draws(len(z), len(density.frames))], MEASURED
    else:
        z, near, calls = known.draw(rng, MEMBERS), False, MEMBERS
        z = z[np.isfinite(density(z))]
        followed, tried = z[:_FOLLOWED], _TRIED
    if len(z) < _FOLLOWED:
        return AtOnce(None, None, calls)
    found = bending(job, density, z, followed, rng, tried)
    if found is None:
        return AtOnce(False if near else None, None, calls)
    erring = job.with_error_integrated().density()
    others = scouts.z, scouts.hot
    stage = from_moved(erring, moved_by(found, z, rng), others, near=near)
    return AtOnce(True, stage, calls + RANKED)
