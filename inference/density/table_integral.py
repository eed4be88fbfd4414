"""The integral over a range by the table of the curve alone, where the density is broad on it.

A frame in the dark tells its range to some knots of the table or worse. By the trapezoidal rule on
the knots, with Gregory's corrections at the far end, its integral costs no evaluation of the
density beside the table, which all frames share; to march over it in panels takes two hundred.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import FrameScene, Instrument, Pair
from inference.frame.blocks import DISPLACEMENT_RATE, GAIN, RATE, Block, Data, Told
from inference.frame.log_density import log_density
from inference.frame.modes import SD, TOP
from inference.frame.table import LOG_RANGE, even_spacing
from simulator.compiled import compiled
from simulator.readings import late_rate
from simulator.sensor import Reach

__all__ = ["has_sharp_mode", "integrate_table", "is_tabled", "table_step", "value_at_end"]

Array = NDArray[np.float64]

_NOTHING = 37.0  # nats below the highest knot: what is less is rounding
_SHARPEST = 1.1  # steps, that the standard deviation of a top is at least
_FOURTH = 0.025  # of the integral, by which those over every fourth knot may differ
_THIRD = 2.0  # times that to the power of 4/3, or
_LEAST = 1e-6  # of the integral, by which those over every third knot may
_CORRECTED = 3e-7  # of the integral, that corrections of the highest differences are at most
_BEFORE = 1e-10  # along log r, a step before the far end
_ROUNDING = 1e-12  # of a range, where the table ends where a kink is
# Gregory's corrections to fourth differences: weights less one, of the last knot first
_END = np.array([-193 / 288, 77 / 240, -7 / 30, 73 / 720, -3 / 160])
# what those to sixth differences have besides
_MORE = np.array([-3101, 16880, -37885, 44760, -29255, 9976, -1375]) / 120960
# integral over the last cell of a polynomial through five knots (Adams and Moulton)
_CELL = np.array([251 / 720, 646 / 720, -264 / 720, 106 / 720, -19 / 720])


@compiled
def table_step(table: Array, data: Data, instrument: Instrument) -> float:
    """Return the spacing of a table's knots where it may hold densities of frames, else 0.

    That of noise that grows with the signal has kinks, and so has that of a pulse where its echo is
    all late; frames with one range in common are as narrow as all of them together.
    """
    if _has_more(data.starts, instrument.shot, instrument.relative):
        return 0.0
    ends = math.exp(table[LOG_RANGE, 0]), math.exp(table[LOG_RANGE, -1])
    if _has_kink(ends, instrument.r0, instrument.wave):
        return 0.0
    return even_spacing(table)


@compiled
def _has_more(starts: NDArray[np.int64] | None, shot: float | None, relative: float | None) -> bool:
    return starts is not None or shot is not None or relative is not None


@compiled
def _has_kink(ends: Pair, r0: Reach, wave: Pair | None) -> bool:
    if wave is not None:
        return False
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        near, far = ends[0] * (1.0 + _ROUNDING), ends[1] * (1.0 - _ROUNDING)
        return not (late_rate(near, r0) > 0.0 and late_rate(far, r0) > 0.0)


@compiled
def is_tabled(data: Data, b: int) -> bool:
    """Tell whether a table, of the strongest frames and of readings alone, is that of frame b."""
    same: bool = data.frames[b, GAIN] == data.strongest
    return same and not _is_known(data.frames, data.told, b)


@compiled
def _is_known(frames: Array, told: Told | None, b: int) -> bool:
    if told is not None:
        return bool(frames[b, RATE] != 0.0 or frames[b, DISPLACEMENT_RATE] != 0.0)
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return False


@compiled
def value_at_end(table: Array, block: Block, scene: FrameScene) -> float:
    """Return the log density just before the far end.

    At a pulse's r0 itself the slope of the curve is that of an echo that is all late: a law that
    goes by it jumps there by up to some ten thousandths.
    """
    return float(log_density(table[LOG_RANGE, -1] - _BEFORE, block, scene))


@compiled
def _by_every(shares: Array, last: int, stride: int) -> float:
    """Integrate over every so many knots up to one, in steps between knots."""
    total = 0.0
    for k in range(last, -1, -stride):
        total += shares[k]
    for j in range(_END.size):
        total += _END[j] * shares[last - j * stride]
    return stride * total


@compiled
def _spread(shares: Array, stride: int, whole: float) -> float:
    """Return by how much of the whole integrals over every so many knots differ from their mean."""
    low, high, beyond = math.inf, -math.inf, 0.0
    last = shares.size - 1
    for j in range(stride):
        one = _by_every(shares, last - j, stride) + beyond
        low, high = min(low, one), max(high, one)
        for i in range(_CELL.size):
            beyond += _CELL[i] * shares[last - j - i]
    return 0.5 * (high - low) / whole


@compiled
def has_sharp_mode(modes: Array, count: int, step: float) -> bool:
    """Tell whether some mode that counts is no wider than knots show."""
    least = -math.inf
    for j in range(count):
        least = max(least, modes[j, TOP] - _NOTHING)
    for j in range(count):  # noqa: SIM110  # kernels have no generators
        if modes[j, TOP] > least and not modes[j, SD] > _SHARPEST * step:
            return True
    return False


@compiled
def _has_sharp_knot(values: Array, least: float) -> bool:
    """Tell whether the density bends as sharply at the top of some knots that counts."""
    for k in range(1, values.size - 1):
        before, here, after = values[k - 1], values[k], values[k + 1]
        bend = (before - 2.0 * here + after) * _SHARPEST * _SHARPEST
        if here > least and here > before and here >= after and not bend > -1.0:
            return True
    return False


@compiled
def integrate_table(modes: Array, count: int, values: Array, shares: Array, step: float) -> float:
    """Integrate a density that is broad on even knots.

    Parameters
    ----------
    modes : ndarray
        Of the density, from `inference.frame.modes.find_modes`: also those between knots.
    count : int
        Number of modes.
    values : ndarray, shape (knots,)
        Log density at the knots, along log r.
    shares : ndarray, shape (knots,)
        Work space.
    step : float
        Spacing of the knots.

    Returns
    -------
    float
        Log of the integral; nan where a top is sharper than knots show, where something is left at
        the near end, or where too much of its error may be.

    Notes
    -----
    The rule errs by the density's Fourier components whose period is a step over whole numbers.
    Integrals over every fourth knot, from each of four on, differ by the component of four steps
    whatever its phase, those over every third by that of three. Without kinks these fall off as a
    geometric series at least, where nothing is small and sharp beside a broad top: that of one step
    is the fourth power of that of four, 4e-7 of the integral at most. Of a normal density it is the
    sixteenth. At the far end the corrections that count last are held to 3e-7: those left out are
    smaller, and a jump of the last knot's value, as where a kink is, shows in them by a twelfth of
    its error.
    """
    if has_sharp_mode(modes, count, step):
        return math.nan
    n, best = values.size, -math.inf
    for k in range(n):
        best = max(best, values[k])
    least = best - _NOTHING
    if not (math.isfinite(best) and values[0] < least):
        return math.nan
    if _has_sharp_knot(values, least):
        return math.nan
    for k in range(n):
        shares[k] = 0.0 if values[k] < least else math.exp(values[k] - best)
    every = _by_every(shares, n - 1, 1)
    corrected = 0.0
    for j in range(_MORE.size):
        corrected += _MORE[j] * shares[n - 1 - j]
    every += corrected
    if not abs(corrected) <= _CORRECTED * every:
        return math.nan
    fourth = _spread(shares, 4, every)
    if not (
        fourth <= _FOURTH
        and _spread(shares, 3, every) <= max(_THIRD * fourth ** (4.0 / 3.0), _LEAST)
    ):
        return math.nan
    return best + math.log(step * every)
