"""Whether errors of the model are to be integrated out in full, and where rounds with them begin.

Draws of an exact model are moved by its errors along straight lines. Where the next order would
change that by much, and it is most of what the answer does not know, the error of the flux is
integrated out in full: rounds of importance draws begin at the moved draws.

An exact model whose posterior its Laplace shapes do not fit is not sampled first: draws of these
shapes tell as well whether its errors bend, and with errors integrated out the posterior is wider
and nearer to its own shape. The exact model follows where rounds there fail.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.moves import Moves
from inference.posterior.answer.responses import (
    MEASURED,
    Responses,
    first_responses,
    flux_leads,
    repeated,
)
from inference.posterior.criticism.discrepancy_check import is_bent, may_be_bent, misses
from inference.posterior.criticism.prior_conflict import are_far_out
from inference.posterior.job import Job
from inference.posterior.sampling.population import arrived_at
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.reparametrisation import reparametrisation_of
from inference.posterior.sampling.scouts import Scouts
from inference.posterior.sampling.start import Optimum, added, climb, refine
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.sampling.warm import MAP_SHARE
from inference.posterior.stages.optima import that_matter
from inference.posterior.stages.stage import Tempering
from inference.posterior.streams import Stream

__all__ = ["MEMBERS", "at_once", "bending", "from_moved", "moved_by"]

Array = NDArray[np.float64]

MEMBERS = 400  # draws that are moved
_CLIMBS = 2  # from the best of them
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
    density: CollapsedDensity, z: Array, others: Sequence[Array] = ()
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
    """
    value = density(z)
    z, value = z[np.isfinite(value)], value[np.isfinite(value)]
    if len(z) <= 2 * z.shape[1]:
        return None
    optima: list[Optimum] = []
    for i in np.argsort(-value)[:_CLIMBS]:
        optima = added(optima, refine(density, climb(density, z[i])[0]))
    if not optima:
        return None
    proposal = Proposal(mixture_of(that_matter(optima)), None, MAP_SHARE)
    pending = Verdict(False, ("no steps were made",))
    members = tuple(arrived_at(one) for one in (z, *others) if len(one))
    return Tempering(proposal, members, pending, scouted=True)


def at_once(
    job: Job, density: CollapsedDensity, optima: Sequence[Optimum], scouts: Scouts
) -> tuple[Tempering, int] | None:
    """Begin with errors integrated out, where they are to be; with the evaluations it took.

    Not where crosstalk and a background are confounded: so few points are no beginning there, and
    what rounds that fail have taken is lost.

    Parameters
    ----------
    density : CollapsedDensity
        Of an exact model, whose posterior Laplace shapes do not fit.
    optima : sequence of Optimum
        Of this density.
    scouts : Scouts
        Told of none of them.
    """
    if not job.can_integrate_error or reparametrisation_of(density) is not None:
        return None
    rng = job.stream(Stream.RESPONSE, 1)
    z = mixture_of(optima).draw(rng, MEMBERS)
    z = z[np.isfinite(density(z))]
    if len(z) < _FOLLOWED:
        return None
    found = bending(job, density, z, z[:_FOLLOWED], rng, _TRIED)
    if found is None:
        return None
    erring = job.with_error_integrated().density()
    stage = from_moved(erring, moved_by(found, z, rng), (scouts.z, scouts.hot))
    return None if stage is None else (stage, 2 * MEMBERS)
