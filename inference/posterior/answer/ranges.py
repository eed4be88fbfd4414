"""Draws of every range from p(r_i | theta, y_i), and readings replicated at them."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.curve_table import integration_bounds, tabulate
from inference.density.frame_integral import falls_off, frame_log_likelihood
from inference.density.gaussian import Pair
from inference.density.integrand import SceneArguments, Triple, log_integrand
from inference.density.range_modes import find_modes
from inference.density.rows import background_of, crosstalk_of, curve_of, law_of
from inference.density.static import StaticDensity
from simulator.compiled import compiled
from simulator.readings import background_readings, noise_parts, object_readings

__all__ = ["draw_ranges", "replicate"]

Array = NDArray[np.float64]

_SIDE = 40  # grid points on either side of a mode
_FAR = 8.5  # standard deviations at which the grid ends where nothing is left


@compiled
def _invert(
    mode: Array, probability: float, frame: Triple, scene: SceneArguments, grid: Array
) -> float:
    """Invert the cumulative density of a mode's interval on a grid graded away from its top."""
    reach = _FAR * mode[2] if mode[2] < 1.0 and falls_off(mode, frame, scene) else math.inf
    for side in range(2):
        sign = -1.0 if side == 0 else 1.0
        length = min(mode[0] - mode[3] if side == 0 else mode[4] - mode[0], reach)
        scale = min(mode[2], length)
        growth = math.asinh(length / scale) if scale > 0.0 else 0.0
        for j in range(_SIDE + 1):
            u = mode[0] + sign * scale * math.sinh(growth * j / _SIDE)
            k = _SIDE + (j if side == 1 else -j)
            grid[k, 0] = min(max(u, mode[3]), mode[4])
            grid[k, 1] = math.exp(min(log_integrand(grid[k, 0], frame, *scene) - mode[1], 50.0))
    total = 0.0
    for k in range(1, 2 * _SIDE + 1):
        total += 0.5 * (grid[k, 0] - grid[k - 1, 0]) * (grid[k, 1] + grid[k - 1, 1])
    if not total > 0.0:
        return float(mode[0])
    wanted = probability * total
    for k in range(1, 2 * _SIDE + 1):
        width, left, right = grid[k, 0] - grid[k - 1, 0], grid[k - 1, 1], grid[k, 1]
        mass = 0.5 * width * (left + right)
        if wanted <= mass or k == 2 * _SIDE:
            # density linear in the cell: the root of a quadratic, in its stable form
            wanted = min(wanted, mass)
            if not mass > 0.0:
                return float(grid[k - 1, 0])
            slope = (right - left) / width
            root = math.sqrt(max(left * left + 2.0 * slope * wanted, 0.0))
            return float(grid[k - 1, 0] + 2.0 * wanted / (left + root))
        wanted -= mass
    return float(mode[0])


@compiled
def _draw_ranges(
    out: Array,
    uniforms: Array,
    shapes: Array,
    crosstalks: Array | None,
    backgrounds: Array | None,
    laws: Array | tuple[Array],
    frames: Array,
    present: NDArray[np.bool_] | None,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    curves: Array | None,
    grid: Pair | None,
) -> None:
    """Fill out[i, j] with log r."""
    cells = np.empty((2 * _SIDE + 1, 2))
    strongest = frames[:, 2].max()
    for i in range(shapes.shape[0]):
        shape = (shapes[i, 0], shapes[i, 1], shapes[i, 2])
        crosstalk = crosstalk_of(crosstalks, i)
        background = background_of(backgrounds, i)
        law = law_of(laws, i)
        bounds = integration_bounds(law)
        delta = curve_of(curves, grid, i)
        table = tabulate(
            bounds, shape, crosstalk, background, law, r0, wave, read, shot, strongest, delta
        )
        values = np.empty(table.shape[1])
        modes = np.empty((values.size // 2 + 1, 6))
        scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, delta)
        for j in range(frames.shape[0]):
            out[i, j] = math.nan
            if present is not None and not present[j]:
                continue
            frame = (frames[j, 0], frames[j, 1], frames[j, 2])
            count = find_modes(modes, values, table, frame, scene)
            frame_log_likelihood(modes, count, frame, scene)
            best, total = -math.inf, 0.0
            for k in range(count):
                best = max(best, modes[k, 5])
            for k in range(count):
                total += math.exp(modes[k, 5] - best)
            left = uniforms[i, j, 0] * total
            for k in range(count):
                mass = math.exp(modes[k, 5] - best)
                if left <= mass or k == count - 1:
                    out[i, j] = _invert(modes[k], uniforms[i, j, 1], frame, scene, cells)
                    break
                left -= mass


@compiled
def _replicate(
    out: Array,
    normals: Array,
    shapes: Array,
    crosstalks: Array | None,
    backgrounds: Array | None,
    positions: Array,
    gains: Array,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    errors: Array | None,
) -> None:
    """Fill out[i, j] with readings drawn at the log ranges positions[i, j]."""
    for i in range(positions.shape[0]):
        crosstalk = crosstalk_of(crosstalks, i)
        background = background_of(backgrounds, i)
        for j in range(positions.shape[1]):
            gain, r, o1, o2 = gains[j], math.inf, 0.0, 0.0
            if math.isfinite(positions[i, j]):
                r = math.exp(positions[i, j])
                strength = gain * shapes[i, 0]
                if errors is not None:
                    strength *= math.exp(errors[i, j])
                o1, o2 = object_readings(r, r0, wave, strength, shapes[i, 1], shapes[i, 2])
            m1, m2 = o1, o2
            if backgrounds is not None and background is not None:
                b1, b2 = background_readings(r, r0, wave, background)
                m1, m2 = m1 + gain * b1, m2 + gain * b2
            if crosstalks is not None and crosstalk is not None:
                m1, m2 = m1 + crosstalk[0], m2 + crosstalk[1]
            own1, own2, shared, s1, s2 = noise_parts(
                read, shot, relative, wave is None, (m1, m2), (o1, o2)
            )
            common = math.sqrt(shared) * normals[i, j, 2]
            out[i, j, 0] = m1 + math.sqrt(own1) * normals[i, j, 0] + common + s1 * normals[i, j, 3]
            out[i, j, 1] = m2 + math.sqrt(own2) * normals[i, j, 1] + common + s2 * normals[i, j, 3]


def draw_ranges(density: CollapsedDensity, z: Array, rng: np.random.Generator) -> Array:
    """Draw the range of every frame given each parameter vector.

    Parameters
    ----------
    density : CollapsedDensity
        The density.
    z : ndarray, shape (n, d)
        Draws of the parameters, of positive density.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    ndarray, shape (n, frames)
        log r; nan for a frame without object.
    """
    if isinstance(density, StaticDensity):
        return density.draw_log_ranges(z, rng)
    n, frames = z.shape[0], density.frames.shape[0]
    out = np.empty((n, frames))
    curves = density.curves(z, rng)
    everything: list[Any] = [*density.integrals(density.parameters.terms(z)), *curves]
    _draw_ranges(out, rng.random((n, frames, 2)), *everything)
    return out


def replicate(
    density: CollapsedDensity, z: Array, positions: Array, rng: np.random.Generator
) -> Array:
    """Draw readings anew at given parameters and log ranges.

    A smooth error of the object's flux is drawn anew, too, from its prior.

    Parameters
    ----------
    density : CollapsedDensity
        The density.
    z : ndarray, shape (n, d)
        Parameters.
    positions : ndarray, shape (n, frames)
        log r; nan for a frame without object.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    ndarray, shape (n, frames, 2)
        Readings.
    """
    out = np.empty((*positions.shape, 2))
    arguments = density.arguments(density.parameters.terms(z))
    errors = density.flux_errors(positions, rng)
    normals = rng.standard_normal((*positions.shape, 4))
    gains = np.ascontiguousarray(density.frames[:, 2])
    everything: list[Any] = [*arguments[:3], positions, gains, *arguments[6:], errors]
    _replicate(out, normals, *everything)
    return out
