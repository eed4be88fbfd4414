"""The error budget of an answer: its draws moved by what the model may be wrong by, and its parts.

A posterior whose scene states no size for the model's error is sampled as if there were none. Then
every draw is moved by errors of the flux and of a shadow on a background, drawn from what the
readings leave of them and followed linearly from draws near it
(`inference.identifiability.model_response`; where that bends before a background, also by how far
the best point of all lies from them, `inference.posterior.answer.where_bent`), and every range by a
random smooth error of the effective distance; where ranges are known, all by it
(`inference.posterior.answer.where_known`). Where sizes are stated, the flux's error is
integrated out already; draws are moved by that of the distance, and by what a flux error twice as
large would move them; an error of the shadow moves them with the flux's free to follow
(`inference.posterior.answer.shadow_beside`).
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.frame.known_range import rates_of
from inference.identifiability.model_response import ModelResponse
from inference.posterior.answer.error_parts import ErrorParts
from inference.posterior.answer.error_shares import error_shares
from inference.posterior.answer.moves import Moves
from inference.posterior.answer.responses import chosen_draws, flux_leads, responses_at
from inference.posterior.answer.shadow_beside import shadow_beside, with_shadow
from inference.posterior.answer.where_bent import best_end, where_bent
from inference.posterior.answer.where_known import where_known
from inference.posterior.answer.where_misfit import where_integrated, where_misfit
from inference.posterior.answer.widened import widened
from inference.posterior.criticism.discrepancy_check import ADDED, LargerDiscrepancy
from inference.posterior.criticism.glossy_object import GlossyObject
from inference.posterior.criticism.prior_sensitivity import PriorSensitivity
from inference.posterior.job import Job
from simulator.discrepancy import discrepancy_basis

__all__ = ["ErrorBudget", "error_budget"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class ErrorBudget(Moves):
    """How the draws of an answer move with the errors of its model.

    Attributes
    ----------
    of_z, of_log_r : ErrorParts of ndarray, shape (d,) and (frames,)
        Shares of the standard deviation; their squares add up to one.
    curvature : float
        What the next order would add to the response to the errors of flux and shadow, as a share
        of it, root mean square over ranges and draws; 0 where the flux's was integrated out.
    missed : ndarray, shape (d,)
        By how many standard deviations the next order would move each unknown.
    of_scene : int
        How many of the errors, the last, are what rests on priors of the scene.
    of_noise : int
        How many before these are what noise does beyond the stated one.
    by_flux : bool
        Whether most of what errors of flux and shadow move the scale by is the flux's, which can be
        integrated out; looked at only where the response bends.
    """

    of_z: ErrorParts
    of_log_r: ErrorParts
    curvature: float
    missed: Array
    of_scene: int
    of_noise: int
    by_flux: bool

    @property
    def model(self) -> slice:
        """Which of the errors are the model's, the constant apart."""
        return slice(1, -(self.of_scene + self.of_noise) or None)


def error_budget(
    job: Job,
    density: CollapsedDensity,
    z: Array,
    log_r: Array,
    larger: LargerDiscrepancy | None,
    sensitivity: PriorSensitivity | None,
    glossy: GlossyObject | None,
    rng: np.random.Generator,
) -> ErrorBudget:
    """Compute the response to the model's errors at draws, and the parts of their spread.

    Parameters
    ----------
    z : ndarray, shape (n, d)
        Draws of equal weight.
    log_r : ndarray, shape (n, frames)
        Their ranges; nan for a frame without object.
    larger : LargerDiscrepancy or None
        Where the flux's error was integrated out: what one twice as large would change.
    sensitivity : PriorSensitivity or None
        Where the answer rests on the law of the ranges: what the reference prior would change, as
        the last of the errors.
    glossy : GlossyObject or None
        Where nothing is said of the object: what changes as it may be glossy.
    """
    error, rates = job.model_error, rates_of(density.frames)
    shadow = error.shadow if density.parameters.has_background else 0.0
    chosen = chosen_draws(len(z), log_r.shape[1])
    found = responses_at(job, density, z[chosen], log_r[chosen], rng)
    by_flux = not found.curvature > ADDED or flux_leads(found)
    experiments, responses, readings = found.experiments, found.each, found.readings
    at, ranges = found.z, found.log_r
    by_z, by_log_r = ([by[:, :, :1], by[:, :, 1:]] for by in (found.by_z, found.by_log_r))
    follow: tuple[Array, Array]
    if job.flux_times > 1 and job.numbers is None:  # a climb for each part would take minutes
        if isinstance(density, DiscrepantDensity):
            follow = where_integrated(density, experiments, readings, (z, log_r), job.flux_times)
        else:
            follow = where_misfit(experiments, readings, *_moved(z, log_r, by_z[0], by_log_r[0]))
        for by, moved in zip((by_z, by_log_r), follow, strict=True):
            by[0] = by[0] + moved[:, :1]
            by.append(np.broadcast_to(moved[:, 1:], (len(at), *moved[:, 1:].shape)))
    elif found.repeated and experiments[0].shadow > 0:
        best = best_end(experiments, readings)
        follow = where_bent(best, *_moved(z, log_r, by_z[0], by_log_r[0]))
        for by, moved in zip((by_z, by_log_r), follow, strict=True):
            by.append(np.broadcast_to(moved[:, None], (len(at), moved.size, 1)))
    if larger is not None:
        by_z.append(np.broadcast_to(larger.of_z[:, None], (*at.shape, 1)))
        by_log_r.append(np.broadcast_to(larger.of_log_r[:, None], (*ranges.shape, 1)))
    if error.range_m > 0 and rates is not None:
        follow = where_known(density, experiments, readings, error.range_m, larger)
        for by, moved in zip((by_z, by_log_r), follow, strict=True):
            by[0] = by[0] + moved[:, :, :1]
            by.append(moved[:, :, 1:])
    elif error.range_m > 0:
        moved = _range_error(density, ranges, responses, error.range_m)
        by_z.append(np.zeros((*at.shape, moved.shape[2])))
        by_log_r.append(moved)
    if isinstance(density, DiscrepantDensity) and shadow > 0:
        follow = shadow_beside(with_shadow(density, experiments, shadow), readings)
        for by, moved in zip((by_z, by_log_r), follow, strict=True):
            by[0] = by[0] + moved[:, :, :1]
            by.append(moved[:, :, 1:])
    of_noise = 0
    if job.noise_times > 1:
        for by, more in zip((by_z, by_log_r), widened(z, log_r, job.noise_times), strict=True):
            by.append(np.broadcast_to(more, (len(at), *more.shape)))
        of_noise = by_z[-1].shape[2]
    if glossy is not None:
        for by, moved in zip((by_z, by_log_r), (glossy.of_z, glossy.of_log_r), strict=True):
            by[0] = by[0] + moved[:, :1]
            by.append(np.broadcast_to(moved[:, 1:], (len(at), *moved[:, 1:].shape)))
    if sensitivity is not None:
        by_z.append(np.broadcast_to(sensitivity.of_z[:, None], (*at.shape, 1)))
        moved = np.broadcast_to(sensitivity.of_log_r[:, None], (*ranges.shape, 1))
        by_log_r.append(moved)
    of_scene = (0 if glossy is None else 1) + (0 if sensitivity is None else 1)
    of_z, of_log_r = np.concatenate(by_z, axis=2), np.concatenate(by_log_r, axis=2)
    return ErrorBudget(
        at,
        ranges,
        of_z,
        of_log_r,
        *error_shares(
            z,
            log_r,
            responses,
            (of_z, of_log_r),
            integrated=larger is not None,
            of_scene=of_scene,
            of_noise=of_noise,
            noisier=job.noise_times,
        ),
        found.curvature,
        found.missed,
        of_scene,
        of_noise,
        by_flux,
    )


def _moved(z: Array, log_r: Array, by_z: Array, by_log_r: Array) -> tuple[Array, Array]:
    """Return draws moved by the middle of what moves them all."""
    return z + np.median(by_z[:, :, 0], axis=0), log_r + np.median(by_log_r[:, :, 0], axis=0)


def _range_error(
    density: CollapsedDensity, log_r: Array, responses: Sequence[ModelResponse], size: float
) -> Array:
    """Return how ranges follow a smooth error of the effective distance, shape (m, frames, k)."""
    basis = discrepancy_basis(*density.parameters.reach_m)
    present = np.isfinite(log_r)
    at = np.where(present, log_r, basis.first)
    told = np.array([each.told for each in responses])
    scale = np.where(present, size * told * np.exp(-at), 0.0)
    return np.asarray(scale[:, :, None] * basis.values(at))
