"""A static object: one range for all frames, integrated out of their joint density.

Taken as independent, the ranges of an object that does not move would be as uncertain as a single
frame leaves them, and the parameters would be told nothing by the frames' agreement.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import empty_frame_log_likelihood
from inference.density.curve_table import integration_bounds, tabulate
from inference.density.frame_integral import log_add
from inference.density.gaussian import Pair, log_top
from inference.density.integrand import (
    SceneArguments,
    log_integrand,
    log_range_density,
    range_slope,
    slope_and_curvature,
)
from inference.density.rows import background_of, crosstalk_of, law_of
from simulator.compiled import compiled

__all__ = ["integrate_common_range"]

Array = NDArray[np.float64]

_NEGLIGIBLE = 30.0  # nats below the best
_MOST_PANELS = 300
_SIDE = 40  # grid points on either side of a mode
_REACH = 9.0  # standard deviations that the grid of a draw reaches
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


@compiled
def _joint(u: float, frames: Array, scene: SceneArguments) -> float:
    """Return log p(all frames, u | theta) less `log_top` of each."""
    prior = log_range_density(math.exp(u), u, scene[3])
    total = prior
    for j in range(frames.shape[0]):
        frame = (frames[j, 0], frames[j, 1], frames[j, 2])
        total += log_integrand(u, frame, *scene) - prior
    return total


@compiled
def _joint_slope(u: float, frames: Array, scene: SceneArguments) -> Pair:
    """Return the slope of `_joint` along u and its Gauss-Newton curvature."""
    r = math.exp(u)
    law = scene[3]
    prior = range_slope(r, u, law)
    bend = law[5] * law[5] + r * r * law[3] * law[3]
    slope, curvature = prior, bend
    for j in range(frames.shape[0]):
        frame = (frames[j, 0], frames[j, 1], frames[j, 2])
        one = slope_and_curvature(u, frame, *scene)
        slope += one[0] - prior
        curvature += one[1] - bend
    return slope, curvature


@compiled
def _find_modes(modes: Array, knots: Array, frames: Array, scene: SceneArguments) -> int:
    """Fill u, log density, standard deviation and interval of every local maximum; count them."""
    n = knots.size
    values = np.empty(n)
    for k in range(n):
        values[k] = _joint(knots[k], frames, scene)
    count, valley = 0, 0
    for k in range(n):
        if values[k] < values[valley]:
            valley = k
        rises = k == 0 or values[k] > values[k - 1]
        falls = k == n - 1 or values[k] >= values[k + 1]
        if not (rises and falls) or not math.isfinite(values[k]):
            continue
        modes[count, 3] = knots[0] if count == 0 else knots[valley]
        modes[count, 4] = knots[n - 1]
        if count > 0:
            modes[count - 1, 4] = knots[valley]
        lower, upper = knots[max(k - 1, 0)], knots[min(k + 1, n - 1)]
        u, top = knots[k], values[k]
        slope, curvature = _joint_slope(u, frames, scene)
        for _ in range(100):
            if slope > 0.0:
                lower = u
            else:
                upper = u
            trial = u + slope / curvature if curvature > 0.0 else u
            if not lower < trial < upper:
                trial = 0.5 * (lower + upper)
            moved = abs(trial - u)
            if moved * math.sqrt(curvature) < 1e-4 or upper - lower < 1e-14 * (1.0 + abs(u)):
                break
            value = _joint(trial, frames, scene)
            if not value >= top:
                # beyond a dip: the top lies nearer
                if trial > u:
                    upper = trial
                else:
                    lower = trial
                continue
            u, top = trial, value
            slope, curvature = _joint_slope(u, frames, scene)
        modes[count, 0], modes[count, 1] = u, top
        sd = 1.0 / math.sqrt(curvature) if curvature > 0.0 else math.inf
        modes[count, 2] = min(sd, knots[n - 1] - knots[0])
        count += 1
        valley = k
    return count


@compiled
def _panel(start: float, width: float, frames: Array, scene: SceneArguments) -> Pair:
    """Integrate over a signed width: the log integral and the highest log density met."""
    total, highest = 0.0, -math.inf
    for j in range(_NODES.size):
        value = _joint(start + width * 0.5 * (1.0 + _NODES[j]), frames, scene)
        if value > highest:
            total *= math.exp(highest - value)
            highest = value
        if highest > -math.inf:
            total += _WEIGHTS[j] * math.exp(value - highest)
    return highest + math.log(0.5 * abs(width) * total), highest


@compiled
def _integrate(mode: Array, best: float, frames: Array, scene: SceneArguments) -> float:
    """Integrate a mode's interval by panels that march outward, each checked by its halves."""
    total = -math.inf
    for sign in (-1.0, 1.0):
        end = mode[3] if sign < 0.0 else mode[4]
        edge, width = mode[0], 1.7 * mode[2]
        for _ in range(_MOST_PANELS):
            left = (end - edge) * sign
            if not left > 0.0:
                break
            width = min(max(width, 1e-15 * (1.0 + abs(edge))), left)
            mass, highest = _panel(edge, sign * width, frames, scene)
            for _ in range(40):
                if mass < total - 20.0 and highest < best - _NEGLIGIBLE:
                    break
                half = 0.5 * sign * width
                near, high1 = _panel(edge, half, frames, scene)
                far, high2 = _panel(edge + half, half, frames, scene)
                both = log_add(near, far)
                error = abs(math.expm1(both - mass)) if mass > -math.inf else 0.0
                mass, highest = both, max(high1, high2)
                if error <= 1e-6 + 1e-14 * abs(mass) or abs(half) < 1e-14 * (1.0 + abs(edge)):
                    break
                width, mass, highest = 0.5 * width, near, high1
            total = log_add(total, mass)
            edge += sign * width
            if highest < best - _NEGLIGIBLE:
                break
            width = 1.6 * width
    return total


@compiled
def _draw(mode: Array, probability: float, frames: Array, scene: SceneArguments) -> float:
    """Invert the cumulative density of a mode's interval on a grid graded away from its top."""
    grid = np.empty((2 * _SIDE + 1, 2))
    for side in range(2):
        sign = -1.0 if side == 0 else 1.0
        length = mode[0] - mode[3] if side == 0 else mode[4] - mode[0]
        near = min(_REACH * mode[2], length)
        if _joint(mode[0] + sign * near, frames, scene) < mode[1] - _NEGLIGIBLE:
            length = near
        scale = min(mode[2], length)
        growth = math.asinh(length / scale) if scale > 0.0 else 0.0
        for j in range(_SIDE + 1):
            k = _SIDE + (j if side == 1 else -j)
            u = mode[0] + sign * scale * math.sinh(growth * j / _SIDE)
            grid[k, 0] = min(max(u, mode[3]), mode[4])
            grid[k, 1] = math.exp(min(_joint(grid[k, 0], frames, scene) - mode[1], 50.0))
    total = 0.0
    for k in range(1, 2 * _SIDE + 1):
        total += 0.5 * (grid[k, 0] - grid[k - 1, 0]) * (grid[k, 1] + grid[k - 1, 1])
    wanted = probability * total
    for k in range(1, 2 * _SIDE + 1):
        width, left, right = grid[k, 0] - grid[k - 1, 0], grid[k - 1, 1], grid[k, 1]
        mass = 0.5 * width * (left + right)
        if mass > 0.0 and (wanted <= mass or k == 2 * _SIDE):
            # density linear in the cell: the root of a quadratic, in its stable form
            wanted = min(wanted, mass)
            slope = (right - left) / width
            root = math.sqrt(max(left * left + 2.0 * slope * wanted, 0.0))
            return float(grid[k - 1, 0] + 2.0 * wanted / (left + root))
        wanted -= mass
    return float(mode[0])


@compiled
def integrate_common_range(
    out: Array,
    tops: Array,
    uniforms: Array | None,
    shapes: Array,
    crosstalks: Array | None,
    backgrounds: Array | None,
    laws: Array,
    seen: Array,
    vacant: Array,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
) -> None:
    """Integrate the common range out of the joint density of all frames.

    Parameters
    ----------
    out : ndarray, shape (n,)
        Filled with log p(all frames | theta).
    tops : ndarray, shape (n, 4)
        Filled with log r of the best mode, the joint log density there, the mode's standard
        deviation in log r, and a draw of log r; nan where no frame holds an object.
    uniforms : ndarray, shape (n, 2), or None
        For the draw; None: no draw.
    seen, vacant : ndarray, shape (frames, 3)
        Frames with the object and frames without.
    shapes, crosstalks, backgrounds, laws, r0, wave, read, shot, relative
        As `CollapsedDensity.arguments` returns them.
    """
    strongest = seen[:, 2].max() if seen.shape[0] > 0 else 1.0
    for i in range(shapes.shape[0]):
        shape = (shapes[i, 0], shapes[i, 1], shapes[i, 2])
        crosstalk = crosstalk_of(crosstalks, i)
        background = background_of(backgrounds, i)
        law = law_of(laws, i)
        bounds = integration_bounds(law)
        out[i], tops[i, :], tops[i, 1] = -math.inf, math.nan, -math.inf
        if not bounds[1] > bounds[0] or not math.isfinite(law[0]):
            continue
        empty = 0.0
        for j in range(vacant.shape[0]):
            frame = (vacant[j, 0], vacant[j, 1], vacant[j, 2])
            empty += empty_frame_log_likelihood(frame, crosstalk, background, r0, wave, read, shot)
        if seen.shape[0] == 0:
            out[i], tops[i, 1] = empty, empty
            continue
        table = tabulate(bounds, shape, crosstalk, background, law, r0, wave, read, shot, strongest)
        scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, None)
        modes = np.empty((table.shape[1] // 2 + 1, 6))
        count = _find_modes(modes, table[0], seen, scene)
        best = 0
        for k in range(count):
            if modes[k, 1] > modes[best, 1]:
                best = k
        if count == 0:
            continue
        total = -math.inf
        for k in range(count):
            modes[k, 5] = -math.inf
            if modes[k, 1] > modes[best, 1] - _NEGLIGIBLE:
                modes[k, 5] = _integrate(modes[k], modes[best, 1], seen, scene)
            total = log_add(total, modes[k, 5])
        constant = seen.shape[0] * log_top(read) + empty
        out[i] = total + constant
        tops[i, 0], tops[i, 2] = modes[best, 0], modes[best, 2]
        tops[i, 1] = modes[best, 1] + constant
        if uniforms is not None:
            left = uniforms[i, 0]
            for k in range(count):
                share = math.exp(modes[k, 5] - total)
                if left <= share or k == count - 1:
                    tops[i, 3] = _draw(modes[k], uniforms[i, 1], seen, scene)
                    break
                left -= share
