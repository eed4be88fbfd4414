"""All ranges that explain a frame, given everything else, and how far its noise reaches."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import Fit
from inference.fits.likelihood.deviance import open_values
from inference.fits.likelihood.problem import FitProblem
from inference.frame.arguments import scene_of
from inference.frame.blocks import block_of, is_empty
from inference.frame.modes import POSITION, TOP, find_modes, room_for_modes
from inference.frame.range_prior import integration_bounds
from inference.frame.table import LOG_RANGE, tabulate
from simulator.assign import assign
from simulator.compiled import compiled

__all__ = ["MOST", "frame_modes", "frame_reaches", "nearest_modes"]

Array = NDArray[np.float64]

DEVIANCE, REACH = 1, 2  # in a frame's modes, beside `POSITION`
MOST = 8  # modes of a frame that are kept, the best
_NEAR = 0.5  # of log r, within which a range is that of a mode
_BAND = 3.0  # standard deviations of noise that are followed, as in single frames
_FALL = 0.5 * _BAND * _BAND  # of the log density there


@compiled
def _keep(out: Array, position: float, deviance: float, reach: float) -> None:
    """Put a mode into its place among the best of a frame."""
    for place in range(MOST):
        if deviance < out[place, DEVIANCE]:
            for later in range(MOST - 1, place, -1):
                assign(out[later], out[later - 1])
            out[place, POSITION], out[place, DEVIANCE] = position, deviance
            out[place, REACH] = reach
            break


@compiled
def _end(u: float, top: float, density: Array, knots: Array, step: int) -> float:
    """Return where the density has fallen to what noise reaches, or where the ranges end."""
    k = np.searchsorted(knots, u)
    if step < 0:
        k -= 1
    last, fallen = u, 0.0  # the root of a fall is near straight along log r
    while 0 <= k < knots.size:
        root = math.sqrt(max(top - density[k], 0.0))
        if root * root >= _FALL:
            share = (math.sqrt(_FALL) - fallen) / (root - fallen)
            return float(last + share * (knots[k] - last))
        last, fallen = knots[k], root
        k += step
    return float(last)


@compiled
def _reach(u: float, top: float, density: Array, knots: Array) -> float:
    """Return the larger move of a range by `_BAND` standard deviations, over these and it."""
    nearer = -math.expm1(_end(u, top, density, knots, -1) - u)
    farther = math.expm1(_end(u, top, density, knots, 1) - u)
    return max(nearer, farther) / _BAND


@compiled
def _fill_modes(out: Array, values: Array, fit: Fit) -> None:
    """Fill out[j, k] with log r, deviance and reach of the modes of frame j, the best first."""
    open_values(values, fit)
    data = fit.data
    scene = scene_of(fit.rows, fit.instrument, 0)
    bounds = integration_bounds(scene.range_prior)
    out[:, :, POSITION], out[:, :, DEVIANCE], out[:, :, REACH] = np.nan, np.inf, np.nan
    if not bounds[1] > bounds[0]:
        return
    table = tabulate(bounds, scene, data.strongest)
    knots = np.empty(table.shape[1])
    modes = room_for_modes(table)
    for j in range(out.shape[0]):
        if is_empty(data, j):
            continue
        for k in range(find_modes(modes, knots, table, block_of(data, j), scene)):
            u, top = modes[k, POSITION], modes[k, TOP]
            _keep(out[j], u, -2.0 * top, _reach(u, top, knots, table[LOG_RANGE]))


def frame_modes(problem: FitProblem, x: Array) -> tuple[Array, Array]:
    """Find the modes of every frame.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x : ndarray, shape (d,)
        Coordinates.

    Returns
    -------
    (ndarray, ndarray), each of shape (n, MOST)
        log r, nan-padded, and deviance (-2 log likelihood relative to no residual under read
        noise alone), inf-padded, the best first.
    """
    out = _modes_of(problem, x)
    return out[:, :, POSITION], out[:, :, DEVIANCE]


def nearest_modes(problem: FitProblem, x: Array, u: Array) -> Array:
    """Return ranges that explain frames at x, each the nearest to where it was, if that is none.

    Beyond the last range that light tells, nothing leads a climb back.

    Parameters
    ----------
    x : ndarray, shape (d,)
        Coordinates.
    u : ndarray, shape (n,)
        log r; nan without an object.

    Returns
    -------
    ndarray, shape (n,)
        As ``u`` where that is near a mode, or there is none.
    """
    modes, _ = frame_modes(problem, x)
    away = np.abs(modes - u[:, None])
    away = np.where(np.isfinite(away), away, np.inf)
    nearest = np.take_along_axis(modes, away.argmin(axis=1)[:, None], axis=1)[:, 0]
    least = away.min(axis=1)
    return np.where(np.isfinite(least) & (least > _NEAR), nearest, u)


def frame_reaches(problem: FitProblem, x: Array) -> tuple[Array, Array, Array]:
    """Find the modes of every frame, and how far its noise reaches from each.

    Parameters
    ----------
    problem, x
        As for `frame_modes`.

    Returns
    -------
    three ndarray, each of shape (n, MOST)
        As of `frame_modes`, and the larger of the moves of the range, relative, to where the log
        likelihood has fallen by as much as three standard deviations of the noise make it fall,
        over three; to the end of the ranges where it does not (docs/model.md, reach).
    """
    out = _modes_of(problem, x)
    return out[:, :, POSITION], out[:, :, DEVIANCE], out[:, :, REACH]


def _modes_of(problem: FitProblem, x: Array) -> Array:
    out = np.empty((problem.frames.shape[0], MOST, 3))
    _fill_modes(out, problem.values(x), problem.kernel_fit())
    return out
