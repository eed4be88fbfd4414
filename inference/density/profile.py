"""The likelihood with every range at its best value, and its linearisation: for starting points."""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, empty_frame_log_likelihood
from inference.density.curve_table import integration_bounds, tabulate
from inference.density.discrepant import DiscrepantDensity
from inference.density.gaussian import Pair, log_top
from inference.density.range_modes import find_modes
from inference.density.rows import background_of, crosstalk_of, law_of
from inference.density.static import StaticDensity
from inference.identifiability.sensitivity import whitener_of
from simulator.compiled import compiled
from simulator.readings import (
    background_readings,
    background_slopes,
    noise_parts,
    object_readings,
    object_slopes,
)

__all__ = ["Linearisation", "best_ranges", "fill_best_ranges", "linearise"]

Array = NDArray[np.float64]

# in z, whose prior has unit scale: the truncation error of a central difference is then 1e-10
_DIFFERENCE = 1e-5


@compiled
def fill_best_ranges(
    out: Array,
    shapes: Array,
    crosstalks: Array | None,
    backgrounds: Array | None,
    laws: Array,
    frames: Array,
    present: NDArray[np.bool_] | None,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
) -> None:
    """Fill out[i, j] with u, log density and standard deviation of frame j's best mode."""
    strongest = frames[:, 2].max()
    for i in range(shapes.shape[0]):
        shape = (shapes[i, 0], shapes[i, 1], shapes[i, 2])
        crosstalk = crosstalk_of(crosstalks, i)
        background = background_of(backgrounds, i)
        law = law_of(laws, i)
        bounds = integration_bounds(law)
        out[i, :, 0], out[i, :, 1], out[i, :, 2] = math.nan, -math.inf, math.nan
        if not bounds[1] > bounds[0] or not math.isfinite(law[0]):
            continue
        table = tabulate(bounds, shape, crosstalk, background, law, r0, wave, read, shot, strongest)
        values = np.empty(table.shape[1])
        modes = np.empty((values.size // 2 + 1, 6))
        scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, None)
        for j in range(frames.shape[0]):
            frame = (frames[j, 0], frames[j, 1], frames[j, 2])
            if present is not None and not present[j]:
                out[i, j, 1] = empty_frame_log_likelihood(
                    frame, crosstalk, background, r0, wave, read, shot
                )
                continue
            count = find_modes(modes, values, table, frame, scene)
            for k in range(count):
                if modes[k, 1] > out[i, j, 1]:
                    out[i, j, 0], out[i, j, 1], out[i, j, 2] = (
                        modes[k, 0],
                        modes[k, 1],
                        modes[k, 2],
                    )
            out[i, j, 1] += log_top(read)


@compiled
def _moments(
    means: Array,
    slopes: Array,
    parts: Array,
    shapes: Array,
    crosstalks: Array | None,
    backgrounds: Array | None,
    positions: Array,
    frames: Array,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    warps: Array | None,
) -> None:
    """Fill means (n, frames, 2), and for the first vector slopes (frames, 2) and noise parts."""
    for i in range(shapes.shape[0]):
        crosstalk = crosstalk_of(crosstalks, i)
        background = background_of(backgrounds, i)
        for j in range(frames.shape[0]):
            gain = frames[j, 2]
            o1, o2, t1, t2 = 0.0, 0.0, 0.0, 0.0
            r = math.inf
            if math.isfinite(positions[j]):
                r = math.exp(positions[j])
                strength = gain * shapes[i, 0]
                if warps is not None:
                    strength *= math.exp(warps[j, 0])
                o1, o2 = object_readings(r, r0, wave, strength, shapes[i, 1], shapes[i, 2])
                t1, t2 = object_slopes(r, r0, wave, strength, shapes[i, 1], shapes[i, 2])
                if warps is not None:
                    t1, t2 = t1 + warps[j, 1] * o1, t2 + warps[j, 1] * o2
            m1, m2 = o1, o2
            if backgrounds is not None and background is not None:
                b1, b2 = background_readings(r, r0, wave, background)
                m1, m2 = m1 + gain * b1, m2 + gain * b2
                if math.isfinite(r):
                    a1, a2 = background_slopes(r, r0, wave, background)
                    t1, t2 = t1 + gain * a1, t2 + gain * a2
            if crosstalks is not None and crosstalk is not None:
                m1, m2 = m1 + crosstalk[0], m2 + crosstalk[1]
            means[i, j, 0], means[i, j, 1] = m1, m2
            if i == 0:
                slopes[j, 0], slopes[j, 1] = t1, t2
                part = noise_parts(read, shot, relative, wave is None, (m1, m2), (o1, o2))
                for k in range(5):
                    parts[j, k] = part[k]


def best_ranges(density: CollapsedDensity, z: Array) -> Array:
    """Find each frame's best range for given parameters.

    Parameters
    ----------
    density : CollapsedDensity
        The density.
    z : ndarray, shape (n, d)
        Parameter vectors.

    Returns
    -------
    ndarray, shape (n, frames, 3)
        log r, log p(y, log r | z) and its standard deviation in log r; nan, log likelihood and
        nan for a frame without object.
    """
    if isinstance(density, StaticDensity):
        return density.best(z)
    if isinstance(density, DiscrepantDensity):
        return density.best(z)[0]
    terms = density.parameters.terms(z)
    out = np.empty((z.shape[0], density.frames.shape[0], 3))
    fill_best_ranges(out, *density.arguments(terms))
    return out


@dataclasses.dataclass(frozen=True, eq=False)
class Linearisation:
    """Whitened residuals of all frames at their best ranges, linear in z.

    Attributes
    ----------
    residual : ndarray, shape (frames, 2)
        Whitened, the direction along the range projected out; with a discrepancy more rows, those
        of its coefficients, and their directions projected out, too.
    jacobian : ndarray, shape (frames, 2, d)
        Derivative of the residual along z, projected likewise.
    """

    residual: Array
    jacobian: Array


def linearise(density: CollapsedDensity, z: Array, positions: Array) -> Linearisation:
    """Linearise the readings in z, ranges eliminated (variable projection).

    Parameters
    ----------
    density : CollapsedDensity
        The density.
    z : ndarray, shape (d,)
        Where.
    positions : ndarray, shape (frames,)
        log r of every frame; nan for a frame without object.

    Returns
    -------
    Linearisation
    """
    d = z.size
    steps = np.concatenate([np.zeros((1, d)), _DIFFERENCE * np.eye(d), -_DIFFERENCE * np.eye(d)])
    arguments = density.arguments(density.parameters.terms(z + steps))
    n = density.frames.shape[0]
    means = np.empty((2 * d + 1, n, 2))
    slopes, parts = np.empty((n, 2)), np.empty((n, 5))
    warps = basis = None
    coefficients = np.empty(0)
    if isinstance(density, DiscrepantDensity):
        coefficients = density.best(z[None])[1][0]
        basis, slope = density.functions(positions)
        warps = np.column_stack([basis @ coefficients, slope @ coefficients])
    everything: list[Any] = [*arguments[:3], positions, density.frames, *arguments[6:], warps]
    _moments(means, slopes, parts, *everything)
    whitener = whitener_of(*parts.T)
    residual = np.einsum("nij,nj->ni", whitener, density.frames[:, :2] - means[0])
    change = (means[1 : d + 1] - means[d + 1 :]) / (2 * _DIFFERENCE)
    jacobian = -np.einsum("nij,dnj->nid", whitener, change)
    direction = np.einsum("nij,nj->ni", whitener, slopes)
    length = np.linalg.norm(direction, axis=1)
    # a frame at the edge of its prior, or without object, has no range to give way
    bounds = arguments[3][0, 6:8]
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = (np.exp(positions) > bounds[0] * (1 + 1e-9)) & (
            np.exp(positions) < bounds[1] * (1 - 1e-9)
        )
    usable = inside & (length > 0)
    unit = np.where(usable[:, None], direction / np.where(usable, length, 1.0)[:, None], 0.0)
    if isinstance(density, StaticDensity):
        # one range gives way for all frames together
        together = np.where(usable[:, None], direction, 0.0)
        together = together / max(float(np.linalg.norm(together)), 1e-300)
        residual = residual - together * np.sum(together * residual)
        jacobian = jacobian - together[:, :, None] * np.einsum("ni,nid->d", together, jacobian)
        return Linearisation(residual, jacobian)
    residual = residual - unit * np.einsum("ni,ni->n", unit, residual)[:, None]
    jacobian = jacobian - unit[:, :, None] * np.einsum("ni,nid->nd", unit, jacobian)[:, None, :]
    if basis is None:
        return Linearisation(residual, jacobian)
    dark: list[Any] = [np.zeros_like(arguments[0][:1]), *everything[1:]]
    dark[0][:, 1:] = arguments[0][:1, 1:]
    rest = np.empty((1, n, 2))
    _moments(rest, np.empty((n, 2)), np.empty((n, 5)), *dark)
    flux = -np.einsum("nij,nj->ni", whitener, means[0] - rest[0])
    flux = flux - unit * np.einsum("ni,ni->n", unit, flux)[:, None]
    return _eliminate(residual, jacobian, flux[:, :, None] * basis[:, None, :], coefficients)


def _eliminate(
    residual: Array, jacobian: Array, other: Array, coefficients: Array
) -> Linearisation:
    """Project out coefficients with standard normal priors, which add residuals of their own.

    Parameters
    ----------
    residual, jacobian : ndarray, shape (frames, 2) and (frames, 2, d)
        Of what stays.
    other : ndarray, shape (frames, 2, k)
        Derivative of the residual along the coefficients.
    coefficients : ndarray, shape (k,)
        Where.

    Returns
    -------
    Linearisation
        With half as many rows more as there are coefficients.
    """
    d, k = jacobian.shape[2], coefficients.size
    q = np.linalg.qr(np.concatenate([other.reshape(-1, k), np.eye(k)]))[0]
    pad = k % 2
    rows = np.concatenate([residual.ravel(), coefficients])
    rows = rows - q @ (q.T @ rows)
    matrix = np.concatenate([jacobian.reshape(-1, d), np.zeros((k, d))])
    matrix = matrix - q @ (q.T @ matrix)
    return Linearisation(
        np.concatenate([rows, np.zeros(pad)]).reshape(-1, 2),
        np.concatenate([matrix, np.zeros((pad, d))]).reshape(-1, 2, d),
    )
