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
import functools
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.frame.blocks import DISPLACEMENT, RANGE
from inference.frame.known_range import rates_of
from inference.frame.warmth import gains_of
from inference.identifiability.experiment import Experiment
from inference.identifiability.model_response import (
    ModelResponse,
    common_pull,
    curvature_of_response,
    model_response,
)
from inference.posterior.answer.error_parts import ErrorParts
from inference.posterior.answer.error_shares import error_shares
from inference.posterior.answer.shadow_beside import shadow_beside, with_shadow
from inference.posterior.answer.where_bent import best_ends, where_bent
from inference.posterior.answer.where_known import where_known
from inference.posterior.criticism.discrepancy_check import LargerDiscrepancy
from inference.posterior.criticism.prior_sensitivity import PriorSensitivity
from inference.posterior.job import Job
from simulator.discrepancy import discrepancy_basis

__all__ = ["ErrorBudget", "error_budget"]

Array = NDArray[np.float64]

_REFERENCES = 100  # draws at which the response is computed
_FRAMES = 20_000  # that this may cost
_FEWEST = 20
_STRAIGHT = 0.1  # share of the response that the next order adds, below which the first is all
_THINNED = 4  # of them one is followed further
# errors that are followed beyond the first order at draws: to tell whether that is of any size, and
# of what size, which few far draws decide
_TRIED, _MEASURED = 24, 200
_AT_ONCE = 20_000  # draws that are moved
# what linear response is taken for at most: e-folds of a range, and standard deviations of a prior
_FARTHEST_RANGE, _FARTHEST = 1.0, 3.0


@dataclasses.dataclass(frozen=True, eq=False)
class ErrorBudget:
    """How the draws of an answer move with the errors of its model.

    Attributes
    ----------
    z : ndarray, shape (m, d)
        Draws at which the response was computed.
    log_r : ndarray, shape (m, frames)
        Their ranges; nan for a frame without object.
    by_z : ndarray, shape (m, d, 1 + k)
        Change of z, and with each of k independent standard normal errors.
    by_log_r : ndarray, shape (m, frames, 1 + k)
        Change of log r likewise.
    of_z, of_log_r : ErrorParts of ndarray, shape (d,) and (frames,)
        Shares of the standard deviation; their squares add up to one.
    curvature : float
        What the next order would add to the response to the errors of flux and shadow, as a share
        of it, root mean square over ranges and draws; 0 where the flux's was integrated out.
    """

    z: Array
    log_r: Array
    by_z: Array
    by_log_r: Array
    of_z: ErrorParts
    of_log_r: ErrorParts
    curvature: float

    @functools.cached_property
    def _tree(self) -> "tuple[scipy.spatial.KDTree, Array]":
        sd = self.z.std(axis=0)
        unit = np.where(sd > 0, sd, 1.0)
        return scipy.spatial.KDTree(self.z / unit), unit

    def errors(self, count: int, rng: np.random.Generator) -> Array:
        """Draw errors for draws, shape (count, 1 + k): the first is a constant one."""
        errors = rng.standard_normal((count, self.by_z.shape[2]))
        errors[:, 0] = 1.0
        return errors

    def moved(self, z: Array, errors: Array) -> Array:
        """Move parameters, shape (n, d), each by the response of the draw nearest to it."""
        if z.shape[1] == 0:
            return z
        result = np.empty_like(z)
        tree, unit = self._tree
        for start in range(0, len(z), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            near = tree.query(z[part] / unit)[1]
            shift = np.einsum("ndk,nk->nd", self.by_z[near], errors[part])
            result[part] = z[part] + _bounded(shift, _FARTHEST)
        return result

    def moved_ranges(self, log_r: Array, errors: Array, ends: Array) -> Array:
        """Move ranges by the same errors, inside the ends of their prior.

        Parameters
        ----------
        log_r : ndarray, shape (n, frames)
            Draws; nan for a frame without object.
        errors : ndarray, shape (n, 1 + k)
            Of each draw.
        ends : ndarray, shape (n, 2)
            Lowest and highest log r of the prior at each draw.

        Returns
        -------
        ndarray, shape (n, frames)
            Each range follows the response at the nearest of its own draws: of its own mode.
        """
        result = log_r.copy()
        for j in np.flatnonzero(np.isfinite(log_r).all(axis=0)):
            order = np.argsort(self.log_r[:, j])
            places = self.log_r[order, j]
            right = np.clip(np.searchsorted(places, log_r[:, j]), 1, max(len(places) - 1, 1))
            right = np.minimum(right, len(places) - 1)
            left = np.maximum(right - 1, 0)
            nearer = log_r[:, j] - places[left] < places[right] - log_r[:, j]
            near = order[np.where(nearer, left, right)]
            shift = np.einsum("nk,nk->n", self.by_log_r[near, j], errors)
            result[:, j] += _bounded(shift, _FARTHEST_RANGE)
        return np.clip(result, ends[:, :1], ends[:, 1:])


def _bounded(shift: Array, limit: float) -> Array:
    return np.asarray(limit * np.tanh(shift / limit))


def error_budget(
    job: Job,
    density: CollapsedDensity,
    z: Array,
    log_r: Array,
    larger: LargerDiscrepancy | None,
    sensitivity: PriorSensitivity | None,
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
    """
    error = job.scene.model_error
    count = int(np.clip(_FRAMES // max(log_r.shape[1], 1), _FEWEST, _REFERENCES))
    chosen = np.linspace(0, len(z) - 1, min(count, len(z))).astype(np.intp)
    flux = 0.0 if error.integrated else error.flux
    rates = rates_of(density.frames)
    shadow = error.shadow if density.parameters.has_background else 0.0
    integrated = isinstance(density, DiscrepantDensity)
    experiments = [
        Experiment(
            density.sensor,
            density.parameters,
            z[i],
            log_r[i],
            gains_of(density.frames),
            discrepancy=flux or None,
            shadow=0.0 if integrated else shadow,
            common_range=job.scene.motion == "static",
            rates=rates,
        )
        for i in chosen
    ]
    readings = density.frames[:, [0, 1] if rates is None else [0, 1, RANGE, DISPLACEMENT]]
    responses = [model_response(each, readings) for each in experiments]
    erring = responses[0].parameters.shape[1] > 0
    curvature = _curvature(experiments, responses, _TRIED, rng) if erring else 0.0
    pull = common_pull(responses)
    further = erring and job.scene.motion != "static"
    bent = further and (curvature > _STRAIGHT or bool(pull.any()))
    if bent:
        fewer = slice(None, None, _THINNED)
        chosen, experiments = chosen[fewer], experiments[fewer]
        responses = [model_response(each, readings, pull) for each in experiments]
        measured = int(np.clip(_FRAMES // max(log_r.shape[1], 1), len(experiments), _MEASURED))
        curvature = _curvature(experiments, responses, measured, rng)
    stretch = np.hypot(1.0, min(curvature, 1.0))  # what the next order may add is no less wide
    by_z = [
        np.array([each.shift[0] for each in responses])[:, :, None],
        stretch * np.array([each.parameters for each in responses]),
    ]
    by_log_r = [
        np.array([each.shift[1] for each in responses])[:, :, None],
        stretch * np.array([each.log_r for each in responses]),
    ]
    if bent and experiments[0].shadow > 0:
        follow = where_bent(
            best_ends(experiments, readings),
            z + np.median(by_z[0][:, :, 0], axis=0),
            log_r + np.median(by_log_r[0][:, :, 0], axis=0),
        )
        for by, moved in zip((by_z, by_log_r), follow, strict=True):
            by.append(np.broadcast_to(moved[:, None], (len(chosen), moved.size, 1)))
    if larger is not None:
        by_z.append(np.broadcast_to(larger.of_z[:, None], (*z[chosen].shape, 1)))
        by_log_r.append(np.broadcast_to(larger.of_log_r[:, None], (*log_r[chosen].shape, 1)))
    if error.range_m > 0 and rates is not None:
        follow = where_known(density, experiments, readings, error.range_m, larger)
        for by, moved in zip((by_z, by_log_r), follow, strict=True):
            by[0] = by[0] + moved[:, :, :1]
            by.append(moved[:, :, 1:])
    elif error.range_m > 0:
        moved = _range_error(density, log_r[chosen], responses, error.range_m)
        by_z.append(np.zeros((*z[chosen].shape, moved.shape[2])))
        by_log_r.append(moved)
    if isinstance(density, DiscrepantDensity) and shadow > 0:
        follow = shadow_beside(with_shadow(density, experiments, shadow), readings)
        for by, moved in zip((by_z, by_log_r), follow, strict=True):
            by[0] = by[0] + moved[:, :, :1]
            by.append(moved[:, :, 1:])
    if sensitivity is not None:
        by_z.append(np.broadcast_to(sensitivity.of_z[:, None], (*z[chosen].shape, 1)))
        moved = np.broadcast_to(sensitivity.of_log_r[:, None], (*log_r[chosen].shape, 1))
        by_log_r.append(moved)
    of_z, of_log_r = np.concatenate(by_z, axis=2), np.concatenate(by_log_r, axis=2)
    return ErrorBudget(
        z[chosen],
        log_r[chosen],
        of_z,
        of_log_r,
        *error_shares(
            z,
            log_r,
            responses,
            (of_z, of_log_r),
            integrated=larger is not None,
            leaning=sensitivity is not None,
        ),
        curvature,
    )


def _curvature(
    experiments: Sequence[Experiment],
    responses: Sequence[ModelResponse],
    tried: int,
    rng: np.random.Generator,
) -> float:
    """Return the share of the response that the next order would add, by so many random errors."""
    missed, size = 0.0, 0.0
    for i in np.linspace(0, len(experiments) - 1, tried).astype(int):
        of = responses[i]
        normal = rng.standard_normal(of.log_r.shape[1])
        present = np.isfinite(experiments[i].log_r)
        if not present.any():
            return 0.0
        # what is wildly off counts as wholly off, and no more
        moved = float(np.mean(np.square((of.log_r @ normal + of.shift[1])[present])))
        off = curvature_of_response(experiments[i], of, normal)
        missed += min(off**2, moved)
        size += moved
    return float(np.sqrt(missed / size)) if size > 0 else 0.0


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
