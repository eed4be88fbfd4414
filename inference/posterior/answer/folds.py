"""Folds: where the readings turn back along the range, so that two ranges become one and vanish."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.whitened import Whitened, whitened
from inference.frame.coordinates import some_of
from inference.frame.known_range import free_of_range, rates_of
from inference.frame.sensitivity import sensitivity
from inference.frame.warmth import gains_of
from inference.posterior.job import Job
from simulator.parameters import Terms

__all__ = ["near_fold"]

Array = NDArray[np.float64]

_DRAWS = 8  # that are looked at
_SHARE = 0.25  # of them that must be near a fold
_REACH = 3.0  # standard deviations of the readings
_TURN = 2.0 * math.pi / 3.0  # of the curve within them
_STEPS = np.geomspace(1e-7, 1.5, 50)  # in log r, to either side


def near_fold(job: Job, density: CollapsedDensity, z: Array, log_r: Array) -> NDArray[np.bool_]:
    """Tell which frames' readings turn back within their own noise.

    As the object moves, a frame's two readings draw a curve. Where it turns round within three
    standard deviations, as a hump's top does that one of two unknowns lifts, noise makes one mode
    of the range into two or two into one, and no linearisation holds. Along what other frames
    leave open of the parameters a reading tells nothing: that uncertainty counts as noise of the
    frame.

    Parameters
    ----------
    z : ndarray, shape (m, d)
        Draws of the parameters.
    log_r : ndarray, shape (m, usable frames)
        Draws of the ranges given them; nan for a frame without object.

    Returns
    -------
    ndarray of bool, shape (frames,)
        False for saturated frames and those without object.
    """
    chosen = np.linspace(0, len(z) - 1, min(_DRAWS, len(z))).astype(np.intp)
    turned = np.array([_turned(density, z[k], log_r[k]) for k in chosen])
    near = np.zeros(len(job.frames), dtype=bool)
    near[job.usable] = turned.mean(axis=0) >= _SHARE
    return near


def _turned(density: CollapsedDensity, z: Array, log_r: Array) -> NDArray[np.bool_]:
    """Whether the curve of each frame turns round, for one draw."""
    present = np.isfinite(log_r)
    at = whitened(density.sensor, density.parameters, density.frames, z, log_r)
    offsets = np.concatenate([-_STEPS[::-1], [0.0], _STEPS])
    terms = some_of(density.parameters.terms(z[None]), slice(0, 1))
    low, high = _support(terms)
    u = np.where(present, log_r, 0.0)[:, None] + offsets
    gain = np.repeat(gains_of(density.frames), offsets.size, axis=0)
    path = sensitivity(density.sensor, terms, u.ravel(), gain)
    scale = _with_unknowns(at, present)
    mean = path.mean.reshape(*u.shape, 2)
    way = np.einsum("nij,nkj->nki", scale, mean - mean[:, [_STEPS.size]])
    direction = np.einsum("nij,nkj->nki", scale, path.by_range.reshape(*u.shape, 2))
    off = np.sum(way**2, axis=2)
    with np.errstate(invalid="ignore", over="ignore"):
        rates = rates_of(density.frames)
        if rates is not None:  # of what is known beside the readings no curve turns back
            moved = np.exp(u) - np.exp(u[:, [_STEPS.size]])
            off = off + np.square(moved[:, :, None] * rates[:, None, :]).sum(axis=2)
        near = (off < _REACH**2) & (u >= low) & (u <= high)
    # only what hangs together with the frame's own range
    middle = _STEPS.size
    near[:, middle] = True
    near[:, middle:] = np.logical_and.accumulate(near[:, middle:], axis=1)
    near[:, middle::-1] = np.logical_and.accumulate(near[:, middle::-1], axis=1)
    angle = np.arctan2(direction[..., 1], direction[..., 0])
    turn = np.diff(angle, axis=1)
    turn = np.where(near[:, 1:] & near[:, :-1], (turn + math.pi) % (2 * math.pi) - math.pi, 0.0)
    angle = np.concatenate([np.zeros((len(u), 1)), np.cumsum(turn, axis=1)], axis=1)
    return np.asarray(present & (np.ptp(angle, axis=1) > _TURN))


def _support(terms: Terms) -> tuple[float, float]:
    """Return the ends of the prior of log r."""
    low, high = terms.ranges[0, 6:8]
    return math.log(low) if low > 0 else -math.inf, math.log(high)


def _with_unknowns(at: Whitened, present: NDArray[np.bool_]) -> Array:
    """Return what whitens a frame's readings if the other frames alone tell the parameters."""
    d = at.jacobian.shape[2]
    if d == 0:
        return at.whitener
    rows = np.einsum("ni,nid->nd", at.across, at.jacobian)
    told = [np.eye(d), rows, at.jacobian[~present].reshape(-1, d)]
    if at.beside is not None:
        own, other = at.jacobian, at.beside_jacobian
        told.append(free_of_range(at.along, at.beside.along, own, other).reshape(-1, d))
    triangle = scipy.linalg.qr(np.concatenate(told), mode="economic")[1]
    # rows R^-1: the posterior covariance of all frames is R^-1 R^-T
    reduced = np.linalg.solve(triangle.T, at.jacobian.reshape(-1, d).T).T.reshape(-1, 2, d)
    own = np.einsum("ni,nid->nd", at.across, reduced)
    leverage = np.sum(own**2, axis=1)
    shared = np.einsum("nid,njd->nij", reduced, reduced)
    taken = np.einsum("nid,nd->ni", reduced, own)
    rest = np.maximum(1.0 - leverage, 1e-12)  # without this frame: a rank-one downdate
    more = shared + taken[:, :, None] * taken[:, None, :] / rest[:, None, None]
    factor = np.linalg.cholesky(np.eye(2) + more)
    return np.asarray(np.linalg.solve(factor, at.whitener))
