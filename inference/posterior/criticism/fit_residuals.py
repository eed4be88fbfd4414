"""Residuals of frames across the curve that the range draws, the parameters fitted once more."""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity, with_discrepancy
from inference.density.static import StaticDensity
from inference.density.whitened import Whitened, whitened
from inference.frame.known_range import beside, free_of_range, rates_of
from inference.frame.shadow_error import shadow_at
from inference.frame.warmth import gains_of
from inference.posterior.answer.replicate import replicate_frames
from inference.posterior.criticism.refit import Refit
from inference.posterior.job import Job
from simulator.discrepancy import NEGLECTED, discrepancy_basis

__all__ = ["FitResiduals", "fit_residuals", "followed_part", "left_out"]

_AT_END = 1e-6  # log range between the best range and an end of its prior
_SEEN = 0.3  # standard deviations of a frame's noise by which what is left out may move it
_NEXT_TO_NOTHING = 1e-10  # share of the variance

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class FitResiduals:
    """Residuals of the frames and of replicates of them, each after a fit of its own.

    Attributes
    ----------
    across : ndarray, shape (1 + replicates, n)
        Signed residual of each frame with an object across its curve, in standard deviations,
        by ascending range; the frames themselves first.
    squared : ndarray, shape (1 + replicates, m)
        Squared residual of every frame, in the order of the frames.
    log_r : ndarray, shape (n,)
        Best ranges of the frames with an object, ascending.
    error : ndarray, shape (1 + replicates,)
        Sum of the squared coefficients of the flux's error that the frames ask for, which are
        standard normal by what the scene allows; zero where it allows for none.
    refit : Refit or None
        Of the frames themselves; None where it is not linear in rows of single frames.
    """

    across: Array
    squared: Array
    log_r: Array
    error: Array
    refit: Refit | None = None


def _with_flux_error(job: Job, density: CollapsedDensity) -> CollapsedDensity:
    """Return the density with all that the flux may err by, sampled or not."""
    error = job.model_error
    if isinstance(density, DiscrepantDensity | StaticDensity) or error.flux == 0:
        return density  # at rest it is no different from another c2
    return with_discrepancy(density, error.flux)


def _without_flux_error(density: CollapsedDensity) -> CollapsedDensity:
    if not isinstance(density, DiscrepantDensity):
        return density
    fields = {f.name: getattr(density, f.name) for f in dataclasses.fields(CollapsedDensity)}
    return CollapsedDensity(**fields)


def _stacked(density: CollapsedDensity, readings: Array) -> CollapsedDensity:
    """Return the density of many sets of frames, shape (sets, n, 3 or 7), one behind the other."""
    sets, n, m = readings.shape
    frames = readings.reshape(sets * n, m)
    present = None if density.present is None else np.tile(density.present, sets)
    return dataclasses.replace(density, frames=frames, present=present)


def _known_beside(density: CollapsedDensity) -> NDArray[np.bool_]:
    """Return of which frames something is known of the range beside the readings."""
    rates = rates_of(density.frames)
    if rates is None:
        return np.zeros(len(density.frames), dtype=bool)
    return np.asarray((rates > 0).any(axis=1))


def _off_known(at: Whitened, columns: Array | None = None) -> Array:
    """Return what no range makes up for between readings and what is known beside them, (n, 2, k).

    Of the residuals, or of derivatives of the readings, shape (m, 2, k), m <= n, of which the first
    are along z.
    """
    if at.beside is None:
        return np.zeros((len(at.residual), 2, 1 if columns is None else columns.shape[2]))
    if columns is None:
        own, other = at.residual[:, :, None], at.beside.residual[:, :, None]
        return free_of_range(at.along, at.beside.along, own, other)
    n = len(columns)
    other = np.zeros_like(columns)
    other[:, :, : at.by_offset.size] = at.beside_jacobian[:n]
    return free_of_range(at.along[:n], at.beside.along[:n], columns, other)


def left_out(
    density: DiscrepantDensity,
    log_r: Array,
    light: Array,
    replicates: int,
    rng: np.random.Generator,
) -> Array:
    """Draw what the functions of the flux's error leave out of it, shape (replicates, n).

    Those that are fitted leave out a hundredth of the error's size, which frames show that are so
    much brighter than their noise: the frames have it, and replicates of them do too.

    Parameters
    ----------
    log_r, light : ndarray, shape (n,)
        Range of each frame, and by how many standard deviations its light alone moves it across.

    Returns
    -------
    ndarray
        In standard deviations; zero where no frame would show it.
    """
    size = density.discrepancy * np.abs(light)
    if not size.max(initial=0.0) * math.sqrt(NEGLECTED) > _SEEN:
        return np.zeros((replicates, log_r.size))
    all_of_it = discrepancy_basis(*density.parameters.reach_m, _NEXT_TO_NOTHING)
    rest = all_of_it.values(log_r)[:, density.basis.size :]
    normal = rng.standard_normal((replicates, rest.shape[1]))
    return np.asarray(density.discrepancy * light * (normal @ rest.T))


def fit_residuals(
    job: Job, density: CollapsedDensity, z: Array, replicates: int, rng: np.random.Generator
) -> FitResiduals:
    """Compare the frames with replicates of them.

    Replicates are made at the parameters z and the best ranges for them. Frames and replicates
    alike get their best ranges, and z moves by one Gauss-Newton step towards each of them, held by
    the prior's unit scale: what parameters can follow is no misfit, nor is an error of flux or
    shadow that the scene allows for.

    Parameters
    ----------
    z : ndarray, shape (d,)
        A draw of the parameters.
    replicates : int
        How many.
    """
    n, d = len(density.frames), z.size
    density = _with_flux_error(job, density)
    plain = _without_flux_error(density)
    seen = plain.best_ranges(z[None])[0, :, 0]
    many = np.broadcast_to(z, (replicates, d))
    anew = replicate_frames(density, many, np.broadcast_to(seen, (replicates, n)).copy(), rng)
    readings = np.concatenate([density.frames[None], anew])
    if isinstance(density, StaticDensity):
        return _of_one_range(density, z, seen, readings)
    stacked = _stacked(plain, readings)
    best = stacked.best_ranges(z[None])[0, :, 0]
    at = whitened(density.sensor, density.parameters, stacked.frames, z, best)
    sets = replicates + 1
    across = np.einsum("ni,ni->n", at.across, at.residual).reshape(sets, n)
    square = np.sum(at.residual**2, axis=1).reshape(sets, n)
    present = np.isfinite(seen)
    told = present & _known_beside(density)
    known = _off_known(at)[:, :, 0].reshape(sets, n, 2)[:, told].reshape(sets, -1)
    # what is left along a curve, at the ends of the prior, stays as it is; that of a range which is
    # known beside the readings is among the rows
    along = np.where(told, 0.0, square - across**2)[:, present]
    # rows of the frames themselves stand for those of the replicates: only noise lies between
    own, of_z = at.jacobian[:n], d
    if isinstance(density, DiscrepantDensity):
        # the error's coefficients, whose prior has unit scale too, are fitted like parameters
        functions = density.functions_at(seen)[0]
        own = np.concatenate([own, at.signal[:n, :, None] * functions[:, None, :]], axis=2)
        light = np.einsum("ni,ni->n", at.across[:n], at.signal[:n])
        across[1:, present] += left_out(density, seen[present], light[present], replicates, rng)
    of_flux = own.shape[2]
    shadow = job.scene.model_error.shadow
    if density.parameters.has_background and shadow > 0:
        gains, reach = gains_of(density.frames), density.parameters.reach_m
        terms = density.parameters.terms(z[None])
        behind = shadow_at(density.sensor, terms, seen, gains, reach, shadow)
        own = np.concatenate([own, at.whitener[:n] @ behind.columns], axis=2)
    d = own.shape[2]
    rows = np.concatenate(
        [
            np.einsum("ni,nid->nd", at.across[:n], own)[present],
            own[~present].reshape(2 * int((~present).sum()), d),
            _off_known(at, own)[:n][told].reshape(2 * int(told.sum()), d),
        ]
    )
    empty = at.residual.reshape(sets, n, 2)[:, ~present].reshape(sets, -1)
    before = np.concatenate([across[:, present], empty, known], axis=1)
    followed, found = followed_part(before, rows)
    fitted = before - followed
    count = int(present.sum())
    squared = np.empty((sets, n))
    squared[:, present] = fitted[:, :count] ** 2 + np.maximum(along, 0.0)
    rest = np.sum(fitted[:, count:].reshape(sets, -1, 2) ** 2, axis=2)
    squared[:, ~present] = rest[:, : n - count]
    squared[:, told] += rest[:, n - count :]
    order = np.argsort(seen[present])
    error = np.square(found[:, of_z:of_flux]).sum(axis=1)
    frame = [
        np.flatnonzero(present),
        *(np.repeat(np.flatnonzero(of), 2) for of in (~present, told)),
    ]
    beside = np.zeros(n)
    beside[present] = np.maximum(along[0], 0.0)
    return FitResiduals(
        fitted[:, :count][:, order],
        squared,
        seen[present][order],
        error,
        Refit(before[0], rows, np.concatenate(frame), beside),
    )


def _of_one_range(density: StaticDensity, z: Array, seen: Array, readings: Array) -> FitResiduals:
    """Do the same where all frames have one range, which is fitted like a parameter."""
    sets, n, _ = readings.shape
    at = whitened(density.sensor, density.parameters, density.frames, z, seen)
    off = readings[:, :, :2] - (
        density.frames[:, :2] - np.linalg.solve(at.whitener, at.residual[..., None])[..., 0]
    )
    residuals = np.einsum("nij,snj->sni", at.whitener, off)
    _, direction, rows = at.rows
    m = direction.shape[1]
    if m > 2:
        known = [beside(frames, seen, density.parameters.terms(z[None])) for frames in readings]
        residuals = np.concatenate([residuals, [each.residual for each in known if each]], axis=2)
    residuals, rows = residuals.reshape(sets, m * n), rows.reshape(m * n, z.size)
    law = density.parameters.terms(z[None]).ranges[0]
    with np.errstate(divide="ignore"):
        at_end = np.abs(np.nanmax(seen) - np.log(law[6:8])) < _AT_END
    if not at_end.any():
        rows = np.concatenate([rows, direction.reshape(m * n, 1)], axis=1)
    # a range at an end of its prior cannot follow what lies beyond
    fitted = residuals - followed_part(residuals, rows, free=0 if at_end.any() else 1)[0]
    squared = np.sum(fitted.reshape(sets, n, m) ** 2, axis=2)
    return FitResiduals(np.empty((sets, 0)), squared, np.empty(0), np.zeros(sets))


def followed_part(residuals: Array, rows: Array, free: int = 0) -> tuple[Array, Array]:
    """Return the part of residuals that the parameters follow, and how far they go.

    The last few are without a prior.
    """
    d = rows.shape[1]
    if d == 0:
        return np.zeros_like(residuals), np.zeros((len(residuals), 0))
    prior = np.eye(d)[: d - free]
    basis, triangle = scipy.linalg.qr(np.concatenate([rows, prior]), mode="economic")
    seen = residuals @ basis[: len(rows)]
    gone = scipy.linalg.solve_triangular(triangle, seen.T).T
    return np.asarray(seen @ basis[: len(rows)].T), np.asarray(gone)
