"""Rounds of importance draws that begin with a Laplace shape in straight coordinates.

Before a background the posterior is a thin sheet that bends, the most where crosstalk is confounded
with it, and what comes from the prior takes long to unbend it. In coordinates in which it is
straight it is nearly normal where the model's errors are most of its width, and are integrated out:
rounds begin there at once, and scouts from the prior, which know of no optimum, are what they are
held to.
"""

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.posterior.checks import check_best_fit, check_ranges
from inference.posterior.job import Job
from inference.posterior.sampling.aliases import aliases_of, with_aliases
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.population import arrived_at
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.scouts import MOST_FRAMES
from inference.posterior.sampling.shape import Shape, shape_at
from inference.posterior.sampling.start import Optimum, added
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.sampling.warm import MAP_SHARE
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.scouting import from_scouts
from inference.posterior.stages.stage import Starting, Tempering
from inference.posterior.streams import Stream

__all__ = ["CLIMBED", "begins_with_a_shape", "climbed_from", "from_shapes", "with_ends"]

Array = NDArray[np.float64]

CLIMBED = 2  # optima, the best with the model's errors
_HELD_TO = 1000  # of the places where scouts stood: one in a hundred counts
_APART = 1.0  # nats below the lower of two tops, midway, from which on they are two
_STEP = 0.3  # standard deviations, over which curvature is measured
_WIDENED = 15.0  # times the curvature without errors, in the median direction, where these lead
_NEGLIGIBLE = 6.0  # nats of mass: what is less holds some thousandths


def begins_with_a_shape(job: Job, density: CollapsedDensity) -> bool:
    """Tell whether a job's rounds begin so.

    Parameters
    ----------
    job : Job
        Without optional terms.
    density : CollapsedDensity
        Its own.
    """
    few = not job.is_large and len(density.frames) <= MOST_FRAMES
    errs = job.can_integrate_error or isinstance(density, DiscrepantDensity)
    may = few and errs and job.settings.method != "importance"
    return may and density.parameters.has_background


def climbed_from(
    job: Job, density: CollapsedDensity, optima: Sequence[Optimum], rank: int
) -> Shape | None:
    """Climb to a shape, with the model's errors integrated out.

    Parameters
    ----------
    job : Job
        That begins with a shape.
    density : CollapsedDensity
        Its own.
    optima : sequence of Optimum
        Of this density.
    rank : int
        Which of them to climb from: 0 for the best with the errors.

    Returns
    -------
    Shape or None
        None where the density is not finite around the point.
    """
    target = _target(job, density)
    best = np.argsort(-target(np.array([one.z for one in optima])))
    return shape_at(target, coordinates_of(density), optima[best[rank]].z)


def from_shapes(job: Job, density: CollapsedDensity, start: Starting) -> Checkpoint | None:
    """Set up such rounds, with the model's errors integrated out.

    Parameters
    ----------
    job : Job
        That begins with a shape.
    density : CollapsedDensity
        Its own.
    start : Starting
        With all that was found, scouts among it.

    Returns
    -------
    Checkpoint or None
        None where there are several optima that matter, or none that is one, and where noise is
        most of what the readings leave open.

    Raises
    ------
    RefusedError
        Where no parameters explain the frames at all.
    """
    target, scouts = _target(job, density), start.scouts
    if scouts is None:
        raise ValueError("scouts are what rounds are held to")
    found = sorted(start.shapes or (), key=lambda one: -one.optimum.log_density)
    if not found or _are_several(target, found):
        return None
    shape, aliases = found[0], aliases_of(target)
    if aliases is not None and len(with_aliases(aliases, target, [shape.optimum])) > 1:
        return None
    check_ranges(target, job.scene, shape.optimum.z)
    check_best_fit(target, shape.optimum.z)
    if target is not density and not _errors_lead(density, shape):
        return None
    proposal = Proposal(mixture_of([shape.optimum]), shape.transport, MAP_SHARE)
    rng = job.stream(Stream.MEMBERS)
    hot = scouts.hot
    if len(hot) > _HELD_TO:
        hot = hot[rng.choice(len(hot), _HELD_TO, replace=False)]
    members = tuple(arrived_at(z) for z in (scouts.z, hot) if len(z))
    if not members:
        return None
    pending = Verdict(False, ("no steps were made",))
    stage = Tempering(proposal, members, pending, scouted=True, shaped=True)
    if target is density:
        return Checkpoint(stage, 0)
    optima = with_ends(start)
    own = Proposal(mixture_of(optima), None, MAP_SHARE)
    exact = from_scouts(job, density, own, scouts, None)
    return Checkpoint(stage, len(optima), integrated=True, exact=exact)


def with_ends(start: Starting) -> list[Optimum]:
    """Return all optima, the best first, with those that scouts led to."""
    return functools.reduce(added, start.ends, start.optima)


def _target(job: Job, density: CollapsedDensity) -> CollapsedDensity:
    """Return the density with the model's errors integrated out."""
    return job.with_error_integrated().density() if job.can_integrate_error else density


def _errors_lead(density: CollapsedDensity, shape: Shape) -> bool:
    """Tell whether the model's errors are most of the width of a shape, in most directions.

    Where noise is, linear response around draws of the exact model mostly stands, and an evaluation
    of that takes half as long. Where the density of an exact model bends upwards within a step, the
    shape stands on a slope of it, and it is the errors that keep it there.

    Parameters
    ----------
    density : CollapsedDensity
        Of an exact model.
    shape : Shape
        With its errors integrated out: of a unit curvature in each of its directions.
    """
    d = len(shape.optimum.z)
    steps = _STEP * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
    value = density(shape.transport.bend(steps)[0])
    with np.errstate(invalid="ignore"):
        bends = (2.0 * value[0] - value[1 : d + 1] - value[d + 1 :]) / _STEP**2
    return bool(np.median(np.where(np.isnan(bends), np.inf, np.abs(bends))) > _WIDENED)


def _are_several(target: CollapsedDensity, found: Sequence[Shape]) -> bool:
    """Tell whether tops, the best first, lie in valleys of their own, and the others matter."""
    first = found[0].optimum
    for other in (one.optimum for one in found[1:]):
        if other.log_mass < first.log_mass - _NEGLIGIBLE or first.is_near(other.z):
            continue
        if _is_apart(target, found[0], other.z, other.log_density):
            return True
    return False


def _is_apart(target: CollapsedDensity, shape: Shape, z: Array, value: float) -> bool:
    """Tell whether a place of some log density, below the top of a shape, lies behind a dip."""
    straight, _ = shape.transport.unbend(z[None])  # the top is at zero
    return not target(shape.transport.bend(0.5 * straight)[0])[0] > value - _APART
