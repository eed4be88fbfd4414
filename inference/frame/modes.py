"""The modes of the density of a block of frames along its range."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import FrameScene, Pair
from inference.frame.blocks import Block, Frame, Known, frame_count, frame_of
from inference.frame.gaussian import gaussian
from inference.frame.known_range import known_log_density
from inference.frame.log_density import log_density, slope_and_curvature
from inference.frame.table import LOG_PRIOR, LOG_RANGE, MEAN_1, MEAN_2, SIGNAL_1, SIGNAL_2
from simulator.compiled import compiled

__all__ = [
    "LEFT",
    "LOG_MASS",
    "POSITION",
    "RIGHT",
    "SD",
    "TOP",
    "UNFINISHED",
    "find_modes",
    "room_for_modes",
]

Array = NDArray[np.float64]

# columns of modes: log r, log density there, standard deviation in log r, the ends of the interval
# between valleys; and what an integral fills: the log of the mass in it, and how many panels of it
# were taken as they are
POSITION, TOP, SD, LEFT, RIGHT, LOG_MASS, UNFINISHED = 0, 1, 2, 3, 4, 5, 6
_COLUMNS = 7
_KNOT = SD  # while a mode is still a knot of the table


@compiled
def room_for_modes(table: Array) -> Array:
    """Return an array that holds as many modes as a table may show."""
    return np.empty((table.shape[1] // 2 + 1, _COLUMNS))


@compiled
def _crosstalk(crosstalk: Pair | None) -> Pair:
    """Return crosstalk, zero where there is none."""
    if crosstalk is not None:
        return crosstalk
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return 0.0, 0.0


@compiled
def _scan(
    values: Array,
    before: Array,
    table: Array,
    frame: Frame,
    scene: FrameScene,
    shot: float | None,
    relative: float | None,
) -> None:
    """Fill log densities at every knot: what was there before, and one frame's."""
    c1, c2 = _crosstalk(scene.crosstalk)
    first, second, gain = frame.first - c1, frame.second - c2, frame.gain
    instrument = scene.instrument
    if shot is not None or relative is not None:
        for k in range(table.shape[1]):
            m1, m2 = gain * table[MEAN_1, k], gain * table[MEAN_2, k]
            values[k] = before[k] + gaussian(
                (first - m1, second - m2),
                (m1 + c1, m2 + c2),
                (gain * table[SIGNAL_1, k], gain * table[SIGNAL_2, k]),
                instrument,
            )
    else:
        i1, i2 = 1.0 / instrument.read[0], 1.0 / instrument.read[1]
        for k in range(table.shape[1]):
            e1 = (first - gain * table[MEAN_1, k]) * i1
            e2 = (second - gain * table[MEAN_2, k]) * i2
            values[k] = before[k] - 0.5 * (e1 * e1 + e2 * e2)
    _add_known(values, table, frame.known, scene.offset)


@compiled
def _add_known(values: Array, table: Array, known: Known | None, offset: float | None) -> None:
    """Add what is known of a frame's range at every knot."""
    if known is not None:
        for k in range(table.shape[1]):
            values[k] += known_log_density(math.exp(table[LOG_RANGE, k]), known, offset)


@compiled
def _tops(modes: Array, values: Array, knots: Array) -> int:
    """Fill knot, value and interval of every local maximum of the values; count them."""
    n = values.size
    count = 0
    valley = 0
    for k in range(n):
        if values[k] < values[valley]:
            valley = k
        rises = k == 0 or values[k] > values[k - 1]
        falls = k == n - 1 or values[k] >= values[k + 1]
        if not (rises and falls):
            continue
        modes[count, POSITION], modes[count, TOP], modes[count, _KNOT] = knots[k], values[k], k
        modes[count, LEFT], modes[count, RIGHT] = knots[valley], knots[n - 1]
        if count == 0:
            modes[count, LEFT] = knots[0]
        else:
            modes[count - 1, RIGHT] = knots[valley]
        count += 1
        valley = k
    return count


@compiled
def _top_value(u: float, value: float, block: Block, scene: FrameScene) -> float:
    """Return the density at a knot: a table holds another frame's reference prior."""
    return log_density(u, block, scene) if scene.range_prior.resolves else value


@compiled
def _refine(mode: Array, lower: float, upper: float, block: Block, scene: FrameScene) -> None:
    """Move a mode from its knot to the top by Gauss-Newton steps within a bracket."""
    u = mode[POSITION]
    density = _top_value(u, mode[TOP], block, scene)
    slope, curvature = slope_and_curvature(u, block, scene)
    bend = curvature
    moved = upper - lower
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
        value = log_density(trial, block, scene)
        if not value >= density:
            # beyond a dip, as noise that grows with the signal makes them: the top lies nearer
            if trial > u:
                upper = trial
            else:
                lower = trial
            continue
        last_slope, last_u = slope, u
        u, density = trial, value
        slope, curvature = slope_and_curvature(u, block, scene)
        bend = (last_slope - slope) / (u - last_u)
        if not bend > 0.0:
            bend = curvature
    mode[POSITION], mode[TOP] = u, density
    mode[SD] = 1.0 / math.sqrt(curvature) if curvature > 0.0 else math.inf


@compiled
def find_modes(modes: Array, values: Array, table: Array, block: Block, scene: FrameScene) -> int:
    """Find the local maxima of the density of a block of frames.

    Parameters
    ----------
    modes : ndarray
        From `room_for_modes`; filled but for `LOG_MASS` and `UNFINISHED`.
    values : ndarray, shape (knots,)
        Work space.
    table : ndarray, shape (6, knots)
        From `inference.frame.table.tabulate`.
    block, scene
        As for `inference.frame.log_density.log_density`.

    Returns
    -------
    int
        Number of modes; 0 where the density is nowhere finite.
    """
    shot, relative = scene.instrument.shot, scene.instrument.relative
    for j in range(frame_count(block)):
        before = table[LOG_PRIOR] if j == 0 else values
        _scan(values, before, table, frame_of(block, j), scene, shot, relative)
    best = -math.inf
    for k in range(values.size):
        best = max(best, values[k])
    if not math.isfinite(best):
        return 0
    knots = table[LOG_RANGE]
    count = _tops(modes, values, knots)
    for m in range(count):
        k = int(modes[m, _KNOT])
        lower, upper = knots[max(k - 1, 0)], knots[min(k + 1, values.size - 1)]
        _refine(modes[m], lower, upper, block, scene)
    return count
