"""The likelihood with every range at its best value, and its linearisation: for starting points."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, empty_frame_log_likelihood
from inference.density.curve_table import integration_bounds, tabulate
from inference.density.discrepant import DiscrepantDensity
from inference.density.gaussian import Pair, log_top
from inference.density.range_modes import find_modes
from inference.density.rows import background_of, crosstalk_of, law_of
from inference.density.static import StaticDensity
from inference.density.whitened import whitened
from simulator.compiled import compiled

__all__ = ["Linearisation", "best_ranges", "fill_best_ranges", "linearise"]

Array = NDArray[np.float64]


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
    flux_error = basis = None
    coefficients = np.empty(0)
    if isinstance(density, DiscrepantDensity):
        coefficients = density.best(z[None])[1][0]
        basis, slope = density.functions(positions)
        flux_error = (basis @ coefficients, slope @ coefficients)
    at = whitened(density.sensor, density.parameters, density.frames, z, positions, flux_error)
    residual, jacobian, direction = at.residual, -at.jacobian, at.along
    length = np.linalg.norm(direction, axis=1)
    # a frame at the edge of its prior, or without object, has no range to give way
    bounds = density.parameters.terms(z[None]).ranges[0, 6:8]
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
    flux = -at.signal
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
