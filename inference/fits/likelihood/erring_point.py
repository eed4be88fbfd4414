"""Readings of a model that errs, linearised along unknowns, ranges and errors."""

import functools
import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS
from inference.fits.likelihood.linearisation import whitened_slopes
from inference.fits.likelihood.model_error import (
    erring_flux,
    left_at_places,
    own_share_left,
    shadow_of,
)
from inference.fits.likelihood.pairs import cholesky, solved, solved_by_root
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.told import Told, told_at, with_column
from inference.frame.delayed import delayed
from inference.frame.sensitivity import Value
from inference.identifiability.elimination import eliminate
from simulator.object_arrays import quadratics

__all__ = [
    "Point",
    "brighter_by",
    "left_of_frames",
    "linearised",
    "moved_by_errors",
    "own_change",
    "point_at",
    "slopes_of_priors",
    "standard",
    "standard_and_slopes",
    "whitened_of",
]

Array = NDArray[np.float64]

_FARTHEST = 30.0  # standard deviations of the priors, beyond which no slope is
_DIFFERENCE = 1e-4
_INSIDE = 2e-9  # of log r from its ends, where kernels still tell its slope
_EACH = np.eye(SLOTS)


class Point(NamedTuple):
    """Unknowns, ranges and errors, and the readings linearised there; whitened by ``root``.

    ``volume`` is the part of the deviance that is no sum of squares.
    """

    x: Array
    u: Array
    a: Array
    z: Array
    deviance: float
    residual: Array
    jacobian: Array
    along: Array
    errors: Array
    told: Told | None
    root: Array
    volume: float

    def deviance_weighted_as(self, other: "Point") -> float:
        """Return its deviance with the covariances of another point.

        Steps are computed with covariances that stay. Of many frames these differ between points
        by enough to hide what a step gains, so that it is judged as it was computed.
        """
        if self.errors.shape[2] == 0:  # noise alone, which is the same everywhere
            return self.deviance
        bare = self.root @ self.residual[:, :, None]
        square = np.square(solved_by_root(other.root, bare)).sum()
        change = float(square - np.square(self.residual).sum())
        return self.deviance - self.volume + other.volume + change


def moved_by_errors(problem: FitProblem, x: Array, u: Array, of_x: Array) -> tuple[Array, Array]:
    """Return what errors of the model do to ranges if the unknowns follow them as is given.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x, u : ndarray, shape (d,), (n,)
        Coordinates, and log r.
    of_x : ndarray, shape (d, k)
        Change of the coordinates with every error.

    Returns
    -------
    (ndarray, ndarray), shape (n,)
        Standard deviation of log r, and chi-square of every frame with the errors allowed for.
    """
    residual, jacobian, along, errors, _ = linearised(problem, x, u)
    seen = eliminate(problem.names, jacobian, along, errors)
    model = np.linalg.norm(seen.response @ of_x - seen.error_response, axis=1)
    more = errors - jacobian @ of_x
    return model, left_of_frames(problem, u, residual, along, errors, more)


def standard(problem: FitProblem, points: Array) -> Array:
    """Return coordinates as standard normal ones of the priors, or of the law, shape (m, d)."""
    columns = problem.columns
    natural = np.empty_like(points)
    natural[:, columns] = problem.naturals(points)
    with np.errstate(all="ignore"):
        z = problem.parameters.standard(natural)
        if problem.mode is not None:
            off = (z - problem.mode.centre).T
            z = scipy.linalg.solve_triangular(
                problem.mode.factor, off, lower=True, check_finite=False
            ).T
        z = z[:, columns]
    z = np.where(np.isnan(z), _FARTHEST, z)
    return np.minimum(np.maximum(z, -_FARTHEST), _FARTHEST)


def deviations_of(problem: FitProblem, x: Array) -> Array:
    """Return `standard` of one point, no farther from zero than where the priors are dense.

    Returns
    -------
    ndarray, shape (d,)
        As `Parameters.deviations`, with the signs of `standard`.
    """
    z = standard(problem, x[None])[0]
    if problem.mode is not None:
        return np.asarray(z)
    columns = problem.columns
    whole = np.empty((1, len(columns)))
    whole[0, columns] = z
    return np.asarray(np.copysign(problem.parameters.deviations(whole)[0, columns], z))


def slopes_of_priors(problem: FitProblem, x: Array) -> Array:
    """Return the derivatives of `standard` along the coordinates, shape (d, d)."""
    return standard_and_slopes(problem, x)[1]


def standard_and_slopes(problem: FitProblem, x: Array) -> tuple[Array, Array]:
    """Return `standard` of one point, shape (d,), and its derivatives, at the cost of one call."""
    z = standard(problem, x + _aside(x.size))
    return np.asarray(z[0]), np.asarray((z[1:] - z[0]).T / _DIFFERENCE)


@functools.lru_cache(maxsize=32)
def _units(n: int) -> Array:
    """Return a unit matrix for each frame, shape (n, 2, 2); not to be written to."""
    return np.broadcast_to(np.eye(2), (n, 2, 2))


@functools.lru_cache(maxsize=32)
def _aside(size: int) -> Array:
    """Return a point and those a difference aside, shape (size + 1, size); not to be written to."""
    return np.vstack([np.zeros(size), _DIFFERENCE * np.eye(size)])


def linearised(
    problem: FitProblem, x: Array, u: Array, a: Array | None = None, inside: bool = False
) -> tuple[Array, ...]:
    """Return residuals, derivatives along unknowns, log r and errors, and from readings to noise.

    All but the last in units of the noise. With ``a``, of the light as it is with these errors:
    where many frames leave little of what errors do not take up, derivatives of the bare light end
    a climb away from its top. With ``inside`` a range at an end of what is possible has the slope
    beside it, so that a step knows where it leads; else it has none.
    """
    n, (values, chain) = u.size, problem.opened(x)
    by_value, along, residual = np.empty((n, 2, SLOTS)), np.empty((n, 2)), np.empty((n, 2))
    fit = problem.kernel_fit()
    at = np.ascontiguousarray(u)
    if inside:
        low, high = problem.log_ends(x)
        at = np.clip(at, low + _INSIDE, high - _INSIDE)
    whitened_slopes(by_value, along, residual, values, _EACH, at, fit)
    # crosstalk moves the readings themselves
    whitener = by_value[:, :, list(CROSSTALK)]
    if not (problem.object_errs or problem.shadow_errs or problem.places is not None):
        errors = with_column(problem.known, np.zeros((n, 2, 0)))
        return residual, by_value @ chain, along, errors, whitener
    signal = by_value[:, :, Value.C2] * values[Value.C2]
    light = solved(whitener, signal[:, :, None])[:, :, 0]
    erring = erring_flux(problem, u)
    parts = [erring.of_light(light)]
    smooth = parts[0].shape[2]
    if a is not None and smooth > 0:  # what is brighter is late by more light
        brighter = 1.0 + problem.error.flux * (erring.values @ a[: smooth // 2])
        parts[0][:, :, smooth // 2 :] *= brighter[:, None, None]
    shadow = shadow_of(problem, values, u)
    if shadow is not None:
        parts.append(shadow.columns)
    errors = whitener @ np.concatenate([*parts, left_at_places(problem, light, u)], axis=2)
    errors = np.where(np.isnan(errors), 0.0, errors)
    if a is not None and smooth > 0:
        errs = erring.by(a[:smooth])

        def noised(change: Array) -> Array:
            bare = np.where(np.isnan(change), 0.0, change)
            return np.asarray((whitener @ bare[:, :, None])[:, :, 0])

        columns = [Value.C0, Value.C1, Value.C2]
        bare = solved(whitener, by_value[:, :, columns])
        for k, column in enumerate(columns):
            by_value[:, :, column] += noised(errs.change(bare[:, :, k]))
        slope = _slope_of_light(problem, values, light, u)
        moves = along.any(axis=1, keepdims=True)  # not at an end of what is possible
        along = along + np.where(moves, noised(errs.change_of_slopes(light, slope)), 0.0)
    if a is not None and shadow is not None:
        more, further = shadow.changes(a[smooth : smooth + parts[1].shape[2]])
        by_value += whitener @ np.nan_to_num(more)
        further = (whitener @ np.nan_to_num(further)[:, :, None])[:, :, 0]
        along = along + np.where(along.any(axis=1, keepdims=True), further, 0.0)
    return (
        residual,
        by_value @ chain,
        along,
        with_column(problem.known, errors),
        whitener,
    )


def _slope_of_light(problem: FitProblem, values: Array, light: Array, u: Array) -> Array:
    """Return the derivative of the object's readings along log r (docs/model.md, 4.13, 4.17)."""
    r, c0, c1 = np.exp(u), values[Value.C0], values[Value.C1]
    steep = -2.0 - r * (2.0 * r + c1) / quadratics(r, c0, c1)
    late = delayed(light, u, problem.instrument.r0, problem.instrument.wave)
    return np.asarray(steep[:, None] * light + r[:, None] * late)


def whitened_of(problem: FitProblem, u: Array, errors: Array, parts: Array) -> Array:
    """Divide by the noise and what is left of errors."""
    return solved_by_root(_root_of_covariance(problem, u, errors), parts)


def _root_of_covariance(problem: FitProblem, u: Array, errors: Array) -> Array:
    """Return the Cholesky factor of noise and what is left of errors, in units of the noise."""
    if errors.shape[2] == 0:
        return _units(u.size)
    with np.errstate(over="ignore", invalid="ignore"):
        left = np.einsum("n,nik,njk->nij", own_share_left(problem, u), errors, errors)
    return _root_of(np.where(np.isfinite(left).all(axis=(1, 2), keepdims=True), left, 0.0))


def _root_of(left: Array) -> Array:
    """Return the Cholesky factor of the noise's 1 and of what is left besides, shape (n, 2, 2)."""
    # beside errors of 1e8 the noise's own 1 would be lost
    own = 1.0 + 1e-12 * np.trace(left, axis1=1, axis2=2)
    return cholesky(own[:, None, None] * np.eye(2) + left)


def own_change(problem: FitProblem, u: Array, residual: Array, errors: Array) -> Array:
    """Return the likeliest of what is left of errors in each frame's own residual, shape (n, k).

    Of a covariance 1 + S, S = s E E^T, S takes up the share S (1 + S)^-1; in coefficients of the
    errors E that is s E^T (1 + S)^-1 of the residual.
    """
    root = _root_of_covariance(problem, u, errors)
    pull = solved(root.transpose(0, 2, 1), solved_by_root(root, residual[:, :, None]))
    share = own_share_left(problem, u)[:, None]
    return np.asarray(share * (errors.transpose(0, 2, 1) @ pull)[:, :, 0])


def brighter_by(problem: FitProblem, u: Array, a: Array, own: Array) -> Array:
    """Return by what factor each frame's own change makes the light brighter, shape (n,)."""
    values = erring_flux(problem, u).values
    flux, count = problem.error.flux, values.shape[1]
    smooth = 1.0 + flux * (values @ a[:count])
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = 1.0 + flux * (values * own[:, :count]).sum(axis=1) / smooth
    return np.where(np.isfinite(factor), factor, 1.0)


def left_of_frames(
    problem: FitProblem, u: Array, residual: Array, along: Array, errors: Array, more: Array
) -> Array:
    """Return chi-squares of frames across their ranges, shape (n,).

    What is left of errors is allowed for, and what ``more``, shape (n, 2, m), moves. Where a range
    cannot give way both readings count, each way by what moves it.
    """
    move = np.where(np.isfinite(along), along, 0.0)
    length = np.linalg.norm(move, axis=1)
    unit = move / np.where(length > 0.0, length, 1.0)[:, None]
    normal = np.column_stack([-unit[:, 1], unit[:, 0]])

    def across(part: Array) -> Array:
        return np.asarray(np.square(np.einsum("ni,nik->nk", normal, part)).sum(axis=1))

    share = own_share_left(problem, u)
    left = across(residual[:, :, None]) / (1.0 + share * across(errors) + across(more))
    held = length == 0.0
    moved = np.concatenate([np.sqrt(share)[:, None, None] * errors, more], axis=2)[held]
    bare = solved_by_root(_root_of(moved @ moved.transpose(0, 2, 1)), residual[held, :, None])
    left[held] = np.square(bare).sum(axis=(1, 2))
    return left


def _volume(root: Array, along: Array, white: Array) -> float:
    """Return the log determinant of what is left of errors, across the range of every frame.

    Without it more light, which makes the share of errors larger, would make every residual less;
    along a range that is free there is none.
    """
    bare, divided = (np.square(part).sum(axis=1) for part in (along, white))
    free = (bare > 0.0) & (divided > 0.0) & np.isfinite(bare)
    whole = 2.0 * float(np.log(np.diagonal(root, axis1=1, axis2=2)).sum())
    return whole + float((np.log(divided[free]) - np.log(bare[free])).sum())


def _shared_volume(problem: FitProblem, along: Array, errors: Array) -> float:
    """Return that of what frames at one place share."""
    if problem.places is None:
        return 0.0
    last = errors.shape[2] - (problem.known is not None and problem.known.offset_sd > 0.0)
    shared = errors[:, :, last - 2 * problem.places.number : last]
    length = np.linalg.norm(along, axis=1)
    free = (length > 0.0) & np.isfinite(length)
    normal = np.column_stack([-along[free, 1], along[free, 0]]) / length[free, None]
    flux, ranges = np.split(np.einsum("ni,nik->nk", normal, shared[free]), 2, axis=1)
    own = np.square(flux).sum(axis=0), np.square(ranges).sum(axis=0)
    both = np.square((flux * ranges).sum(axis=0))
    return float(np.log1p(own[0] + own[1] + np.maximum(own[0] * own[1] - both, 0.0)).sum())


def point_at(problem: FitProblem, x: Array, u: Array, a: Array, z: Array | None = None) -> Point:
    """Linearise in units of the noise and of what is left of errors; ``z`` is `standard` of x."""
    residual, jacobian, along, errors, _ = linearised(problem, x, u, a, inside=True)
    root = _root_of_covariance(problem, u, errors)
    at, volume = (jacobian, along, errors), 0.0
    if errors.shape[2] > 0:  # else the root is 1
        parts = [(residual - errors @ a)[:, :, None], jacobian, along[:, :, None], errors]
        white, d = solved_by_root(root, np.concatenate(parts, axis=2)), x.size
        volume = _volume(root, along, white[:, :, d + 1]) + _shared_volume(problem, along, errors)
        residual = white[:, :, 0]
        at = white[:, :, 1 : d + 1], white[:, :, d + 1], white[:, :, d + 2 :]
    z = standard(problem, x[None])[0] if z is None else z
    told = told_at(problem.known, u, a)
    with np.errstate(over="ignore", invalid="ignore"):
        deviance = float(np.square(residual).sum() + a @ a + z @ z) + volume
        if told is not None:
            deviance += float(np.square(told.residual).sum())
        if problem.mode is not None:
            deviance += problem.mode.deviance
        known = math.isfinite(deviance + float(np.abs(at[0]).sum() + np.abs(at[2]).sum()))
    deviance = deviance if known else math.inf
    return Point(x, u, a, z, deviance, residual, *at, told, root, volume)
