"""The inner integral: the range of a block of frames integrated out, adaptively.

Every local maximum of the density on the table of the curve of mean readings is refined by
a bracketed Gauss-Newton iteration and integrated on its own interval between valleys: by a short
rule where the peak is narrow, interior and passes its checks, by a longer one where it leans and
vanishes on both sides, otherwise by Gauss-Legendre panels that march outward.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import FrameScene, Pair
from inference.frame.blocks import Block, frame_count
from inference.frame.gaussian import log_top
from inference.frame.log_density import log_density, rounding, slope_and_curvature
from inference.frame.modes import LEFT, LOG_MASS, POSITION, RIGHT, SD, TOP, UNFINISHED
from inference.frame.noise import has_shot
from simulator.compiled import compiled

__all__ = ["best_mode", "falls_off", "integrate_range"]

Array = NDArray[np.float64]

_NEGLIGIBLE = 30.0  # nats below the best: exp(-30) of a mass changes no digit that counts
_STEP = 0.7  # of the trapezoidal rule, in standard deviations
_HALF = 10  # its points on either side of the mode

_FAR = 12.0  # standard deviations at which a peak must have vanished
_MOST_PANELS = 300
_MOST_HALVINGS = 30
_ROUNDINGS = 4.0  # of the density at a panel's start, by which two rules for it may differ
_NEARLY_GAUSSIAN = 3e-3  # standard deviation of log r

_GONE = 22.0  # nats below its top, at which a peak has vanished: what lies beyond is 1e-8 of it
_LEANING_STEP = 0.6  # of the trapezoidal rule, in standard deviations
_HIGHER = 0.1  # nats above the mode, where it is none
_LONGEST = 80  # its points on either side of the mode
_LEFT_OVER = 2e-7  # of the integral: what is left of its error at most

_HERMITE_NODES, _HERMITE_WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


@compiled
def falls_off(mode: Array, block: Block, scene: FrameScene) -> bool:
    """Tell whether nothing is left beyond the reach of the short rules.

    The density falls all the way to the valleys, but it may do so slowly over a long interval: it
    is looked at once more farther out.
    """
    reach = _STEP * _HALF * mode[SD]
    for sign in (-1.0, 1.0):
        length = mode[RIGHT] - mode[POSITION] if sign > 0.0 else mode[POSITION] - mode[LEFT]
        if length < reach:
            return False
        excess = log_density(mode[POSITION] + sign * reach, block, scene) - mode[TOP]
        near = math.exp(min(excess, 1.0))
        distance = min(_FAR * mode[SD], length)
        excess = log_density(mode[POSITION] + sign * distance, block, scene) - mode[TOP]
        far = math.exp(min(excess, 1.0))
        if not near * (distance - reach) + far * (length - distance) < 1e-6 * mode[SD]:
            return False
    return True


@compiled
def _narrow(mode: Array, block: Block, scene: FrameScene) -> float:
    """Integrate a narrow interior peak, relative to its top; -1 where a check fails.

    At a standard deviation below 0.003 of log r the skewness is of the same order, and seven
    Gauss-Hermite nodes leave an error below 1e-7; their outer nodes find the exceptions.
    """
    u, top, sd = mode[POSITION], mode[TOP], mode[SD]
    if not sd < 1.0 or not falls_off(mode, block, scene):
        return -1.0
    if sd < _NEARLY_GAUSSIAN:
        total, largest = 0.0, 0.0
        for j in range(_HERMITE_NODES.size):
            x = _HERMITE_NODES[j]
            excess = log_density(u + x * sd, block, scene) - top + 0.5 * x * x
            largest = max(largest, abs(excess))
            total += _HERMITE_WEIGHTS[j] * math.exp(min(excess, 1.0))
        if largest < 0.5:
            return float(sd * total)
    even, odd = 1.0, 0.0
    for j in range(1, _HALF + 1):
        for sign in (-1.0, 1.0):
            excess = log_density(u + sign * j * _STEP * sd, block, scene) - top
            value = math.exp(min(excess, 1.0))
            if j % 2 == 0:
                even += value
            else:
                odd += value
    # the error of the whole rule is about the fourth power of this, but not across the kinks
    # that shot noise has where a mean reading changes sign
    allowed = 1e-5 if has_shot(scene.instrument.shot) else 2e-3
    if not abs(even - odd) <= allowed * (even + odd):
        return -1.0
    return float(_STEP * sd * (even + odd))


@compiled
def _leaning(mode: Array, block: Block, scene: FrameScene) -> float:
    """Integrate a peak that leans, relative to its top; -1 where it does not vanish, or is sharp.

    The trapezoidal rule goes on to where nothing is left. From every fourth point to every second
    the integral changes by a, to every point by b: the rule converges faster than any power of the
    step, so that less than b^2/a is left of its error.
    """
    top, sd = mode[TOP], mode[SD]
    if not sd < 1.0 or has_shot(scene.instrument.shot):
        return -1.0
    for end in (mode[LEFT], mode[RIGHT]):
        if not log_density(end, block, scene) < top - _GONE:
            return -1.0
    every, second, fourth = 1.0, 1.0, 1.0
    for sign in (-1.0, 1.0):
        ended = False
        for j in range(1, _LONGEST + 1):
            u = mode[POSITION] + sign * j * _LEANING_STEP * sd
            ended = not mode[LEFT] < u < mode[RIGHT]
            if ended:
                break
            excess = log_density(u, block, scene) - top
            ended = excess < -_GONE
            if ended:
                break
            if not excess < _HIGHER:
                return -1.0
            value = math.exp(excess)
            every += value
            if j % 2 == 0:
                second += value
            if j % 4 == 0:
                fourth += value
        if not ended:
            return -1.0
    before, last = abs(4.0 * fourth - 2.0 * second) / every, abs(2.0 * second - every) / every
    if not last * last <= _LEFT_OVER * before:
        return -1.0
    return float(_LEANING_STEP * sd * every)


@compiled
def _panel(
    start: float,
    width: float,
    block: Block,
    scene: FrameScene,
) -> Pair:
    """Integrate from start over a signed width by 8 Gauss-Legendre nodes.

    Returns
    -------
    (float, float)
        Log integral and the highest log density met.
    """
    total = 0.0
    highest = -math.inf
    for j in range(_NODES.size):
        value = log_density(start + width * 0.5 * (1.0 + _NODES[j]), block, scene)
        if value > highest:
            total *= math.exp(highest - value)
            highest = value
        if highest > -math.inf:
            total += _WEIGHTS[j] * math.exp(value - highest)
    return highest + math.log(0.5 * abs(width) * total), highest


@compiled
def _log_add(first: float, second: float) -> float:
    """Return log(exp(first) + exp(second))."""
    large, small = max(first, second), min(first, second)
    return large + math.log1p(math.exp(small - large)) if small > -math.inf else large


@compiled
def _march(
    mode: Array,
    best: float,
    block: Block,
    scene: FrameScene,
) -> Pair:
    """Integrate a mode's interval by panels from the mode outward.

    Returns
    -------
    (float, float)
        Log of the mass, and how many panels were taken as they are: there are no more, or halves
        of halves still contradicted them.
    """
    # halves of a smooth panel are 2^-16 of its error off
    smooth = 1e-8 if has_shot(scene.instrument.shot) else 1e-4
    total, unfinished = -math.inf, 0.0
    for sign in (-1.0, 1.0):
        end = mode[LEFT] if sign < 0.0 else mode[RIGHT]
        edge = mode[POSITION]
        width = min(1.7 * mode[SD], 0.4, mode[RIGHT] - mode[LEFT])
        ended = False
        # at 1e20 nats the density is rounding noise, which never falls off: panels are bounded
        for _ in range(_MOST_PANELS):
            if not (end - edge) * sign > 0.0:
                ended = True
                break
            slope = slope_and_curvature(edge, block, scene)[0]
            if abs(slope) * width > 8.0:
                width = 8.0 / abs(slope)
            # the slope may grow within the panel: it is looked at from the far end as well
            while True:
                width = min(max(width, 1e-15 * (1.0 + abs(edge))), (end - edge) * sign)
                slope = slope_and_curvature(edge + sign * width, block, scene)[0]
                if abs(slope) * width < 16.0 or width < 1e-13 * (1.0 + abs(edge)):
                    break
                width *= 0.5
            last = (end - edge) * sign <= 1.25 * width
            if last:
                width = (end - edge) * sign
            mass, highest = _panel(edge, sign * width, block, scene)
            # no rule knows a panel better than the density on it is rounded
            allowed = smooth + _ROUNDINGS * rounding(edge, block, scene)
            # a panel can be wider than the peak, whose curvature says little of a flat top; and the
            # variance of shot noise has a kink where a mean reading changes sign
            settled = False
            for _ in range(_MOST_HALVINGS):
                if mass < total - 20.0:
                    settled = True
                    break
                half = 0.5 * sign * width
                near, high1 = _panel(edge, half, block, scene)
                far, high2 = _panel(edge + half, half, block, scene)
                both = _log_add(near, far)
                error = abs(math.expm1(both - mass)) if mass > -math.inf else 0.0
                mass, highest = both, max(high1, high2)
                # a log mass of a million nats is itself known to no better than its rounding, and a
                # panel of a few roundings is as short as it can be
                if error <= allowed + 1e-14 * abs(mass) or abs(half) < 1e-14 * (1.0 + abs(edge)):
                    settled = True
                    break
                width, mass, highest, last = 0.5 * width, near, high1, False
            if not settled:
                unfinished += 1.0
            total = _log_add(total, mass)
            edge += sign * width
            if last or highest < best - _NEGLIGIBLE:
                ended = True
                break
            width = min(1.6 * width, 0.7)
        if not ended:
            unfinished += 1.0
    return total, unfinished


@compiled
def best_mode(modes: Array, count: int) -> int:
    """Return the mode whose top is the highest, the first of equal ones; -1 where there is none."""
    best = -1
    for k in range(count):
        if modes[k, TOP] > -math.inf and (best < 0 or modes[k, TOP] > modes[best, TOP]):
            best = k
    return best


@compiled
def integrate_range(modes: Array, count: int, block: Block, scene: FrameScene) -> float:
    """Integrate the density of a block of frames over their range, given its modes.

    Parameters
    ----------
    modes : ndarray
        From `inference.frame.modes.find_modes`; `LOG_MASS` and `UNFINISHED` are filled.
    count : int
        Number of modes.
    block, scene
        As for `inference.frame.log_density.log_density`.

    Returns
    -------
    float
        log p(readings of the block | theta).
    """
    best = -math.inf
    for j in range(count):
        best = max(best, modes[j, TOP])
    total = -math.inf
    for j in range(count):
        mass, unfinished = -math.inf, 0.0
        if modes[j, TOP] > best - _NEGLIGIBLE:
            peak = _narrow(modes[j], block, scene)
            if not peak > 0.0:
                peak = _leaning(modes[j], block, scene)
            if peak > 0.0:
                mass = modes[j, TOP] + math.log(peak)
            else:
                mass, unfinished = _march(modes[j], best, block, scene)
        modes[j, LOG_MASS], modes[j, UNFINISHED] = mass, unfinished
        total = _log_add(total, mass)
    return float(frame_count(block) * log_top(scene.instrument.read) + total)
