"""The modes of a frame's density along its range."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.gaussian import Pair, gaussian
from inference.density.integrand import SceneArguments, Triple, log_integrand, slope_and_curvature
from simulator.compiled import compiled

__all__ = ["find_modes"]

Array = NDArray[np.float64]


@compiled
def _scan(
    values: Array,
    table: Array,
    frame: Triple,
    crosstalk: Pair | None,
    pulsed: bool,
    read: Pair,
    shot: float | None,
    relative: float | None,
) -> None:
    """Fill the frame's log density at every knot."""
    first, second, gain = frame
    c1, c2 = 0.0, 0.0
    if crosstalk is not None:
        c1, c2 = crosstalk[0], crosstalk[1]
        first, second = first - c1, second - c2
    if shot is not None or relative is not None:
        for k in range(table.shape[1]):
            m1, m2 = gain * table[4, k], gain * table[5, k]
            values[k] = table[1, k] + gaussian(
                (first - m1, second - m2),
                (m1 + c1, m2 + c2),
                (gain * table[2, k], gain * table[3, k]),
                read,
                shot,
                relative,
                pulsed,
            )
    else:
        i1, i2 = 1.0 / read[0], 1.0 / read[1]
        for k in range(table.shape[1]):
            e1 = (first - gain * table[4, k]) * i1
            e2 = (second - gain * table[5, k]) * i2
            values[k] = table[1, k] - 0.5 * (e1 * e1 + e2 * e2)


@compiled
def find_modes(
    modes: Array,
    values: Array,
    table: Array,
    frame: Triple,
    scene: SceneArguments,
) -> int:
    """Find the local maxima of a frame's density.

    Parameters
    ----------
    modes : ndarray, shape (at least half of the knots, 6)
        Filled with u, log density, standard deviation, left and right end of the mode's interval;
        the last column is left for `frame_log_likelihood`.
    values : ndarray, shape (knots,)
        Work space.
    table : ndarray, shape (6, knots)
        From `tabulate`.
    frame, scene
        As for `log_integrand`.

    Returns
    -------
    int
        Number of modes; 0 where the density is nowhere finite.
    """
    _scan(values, table, frame, scene[1], scene[5] is None, scene[6], scene[7], scene[8])
    n = values.size
    best = -math.inf
    for k in range(n):
        best = max(best, values[k])
    if not math.isfinite(best):
        return 0
    count = 0
    valley = 0
    for k in range(n):
        if values[k] < values[valley]:
            valley = k
        rises = k == 0 or values[k] > values[k - 1]
        falls = k == n - 1 or values[k] >= values[k + 1]
        if not (rises and falls):
            continue
        modes[count, 0], modes[count, 1], modes[count, 2] = table[0, k], values[k], k
        modes[count, 3], modes[count, 4] = table[0, valley], table[0, n - 1]
        if count == 0:
            modes[count, 3] = table[0, 0]
        else:
            modes[count - 1, 4] = table[0, valley]
        count += 1
        valley = k
    for j in range(count):
        k = int(modes[j, 2])
        lower = table[0, max(k - 1, 0)]
        upper = table[0, min(k + 1, n - 1)]
        u = modes[j, 0]
        density = modes[j, 1]
        slope, curvature = slope_and_curvature(u, frame, *scene)
        bend = curvature
        moved = upper - lower
        if len(scene[3]) == 9:  # decided at compile time
            # the table holds the reference prior of the strongest frame under read and shot noise
            density = log_integrand(u, frame, *scene)
        for _ in range(100):
            if slope > 0.0:
                lower = u
            else:
                upper = u
            trial = u + slope / bend if bend > 0.0 else u
            # Gauss-Newton overshoots where residuals are large: steps must shrink, or halve
            if not lower < trial < upper or abs(trial - u) > 0.7 * moved:
                trial = 0.5 * (lower + upper)
            moved = abs(trial - u)
            if moved * math.sqrt(curvature) < 1e-3 or upper - lower < 1e-14 * (1.0 + abs(u)):
                break
            value = log_integrand(trial, frame, *scene)
            if not value >= density:
                # beyond a dip, as noise that grows with the signal makes them: the top lies nearer
                if trial > u:
                    upper = trial
                else:
                    lower = trial
                continue
            last_slope, last_u = slope, u
            u, density = trial, value
            slope, curvature = slope_and_curvature(u, frame, *scene)
            bend = (last_slope - slope) / (u - last_u)
            if not bend > 0.0:
                bend = curvature
        modes[j, 0], modes[j, 1] = u, density
        modes[j, 2] = 1.0 / math.sqrt(curvature) if curvature > 0.0 else math.inf
    return count
