"""The mass of one peak along the range, as one Gaussian or as several."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.curve import Curve, Prior, log_density
from inference.tracking.peaks import edge
from simulator.compiled import compiled

__all__ = ["CHOICE_COLUMNS", "integrate"]

Array = NDArray[np.float64]

CHOICE_COLUMNS = 6  # log mass, mean, standard deviation, mode, its scale, parent
_GAUSSIAN = 0.3  # nats by which a peak may leave its parabola at sqrt(3) standard deviations
_PIECES = 2  # windows on either side of the middle one
_NEGLIGIBLE_PIECE = 1e-3  # share of a mode below which a piece is left out
_INTERVALS = 32  # of Simpson's rule on either side of a mode
_ROOT3 = math.sqrt(3.0)
_LOG_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)


@compiled
def _place(choices: Array, count: int) -> int:
    """Return where the next choice goes: the end, or the place of the lightest one."""
    if count < choices.shape[0]:
        return count
    lightest = 0
    for j in range(count):
        if choices[j, 0] < choices[lightest, 0]:
            lightest = j
    return lightest


@compiled
def _add(
    choices: Array,
    count: int,
    log_mass: float,
    mean: float,
    sd: float,
    mode: float,
    scale: float,
    parent: float,
) -> int:
    """Append a choice; the new length."""
    place = _place(choices, count)
    choices[place, 0], choices[place, 1], choices[place, 2] = log_mass, mean, sd
    choices[place, 3], choices[place, 4], choices[place, 5] = mode, scale, parent
    return max(count, place + 1)


@compiled
def _divide(
    choices: Array,
    count: int,
    parent: float,
    u: float,
    scale: float,
    low: float,
    high: float,
    first: float,
    second: float,
    prior: Prior,
    spread: Array,
    curve: Curve,
) -> int:
    """Append one mode that is not near a Gaussian, as at folds and ends of the support.

    Simpson's rule gives its moments. It is then divided by smooth windows, a standard deviation
    apart, into pieces that are near enough to Gaussians.
    """
    top = log_density(u, first, second, prior, spread, curve)
    begin = edge(u, top, low, scale, first, second, prior, spread, curve)
    end = edge(u, top, high, scale, first, second, prior, spread, curve)
    nodes = np.empty((2 * _INTERVALS + 2, 2))
    total, mean, square = 0.0, 0.0, 0.0
    for side in range(2):
        width = ((begin if side == 0 else end) - u) / _INTERVALS
        for k in range(_INTERVALS + 1):
            weight = 1.0 if k in (0, _INTERVALS) else (4.0 if k % 2 == 1 else 2.0)
            away = k * width
            density = log_density(u + away, first, second, prior, spread, curve)
            part = weight * abs(width) / 3.0 * math.exp(min(density - top, 50.0))
            row = side * (_INTERVALS + 1) + k
            nodes[row, 0], nodes[row, 1] = away, part
            total += part
            mean += part * away
            square += part * away * away
    if not total > 0.0:
        return count
    mean /= total
    sd = math.sqrt(max(square / total - mean * mean, 0.0))
    if not sd > 0.0:
        return _add(choices, count, top + math.log(total), u + mean, sd, u + mean, scale, parent)
    for piece in range(-_PIECES, _PIECES + 1):
        share, shift, square = 0.0, 0.0, 0.0
        for row in range(nodes.shape[0]):
            x = (nodes[row, 0] - mean) / sd
            windows = 0.0
            for other in range(-_PIECES, _PIECES + 1):
                windows += math.exp(-0.5 * (x - other) ** 2)
            part = nodes[row, 1] * math.exp(-0.5 * (x - piece) ** 2) / windows
            share += part
            shift += part * x
            square += part * x * x
        if share > _NEGLIGIBLE_PIECE * total:
            shift /= share
            own = sd * math.sqrt(max(square / share - shift * shift, 0.0))
            at = u + mean + sd * shift
            count = _add(choices, count, top + math.log(share), at, own, at, own, parent)
    return count


@compiled
def integrate(
    choices: Array,
    count: int,
    parent: float,
    u: float,
    scale: float,
    low: float,
    high: float,
    first: float,
    second: float,
    prior: Prior,
    spread: Array,
    curve: Curve,
    linear: bool,
) -> int:
    """Append one mode between its valleys, with its log mass, mean and standard deviation.

    Three Gauss-Hermite nodes where the peak is near a Gaussian, which is exact to the fifth power
    of the distance.

    Where u is wide because globals or crosstalk are uncertain, only the mode is taken. What they do
    to the readings is linear here, and the curve is not: integrated over a wide density, the
    difference would pass for knowledge of the range, a little in every frame.

    Parameters
    ----------
    choices : ndarray, shape (capacity, CHOICE_COLUMNS)
        The list; where it is full, its lightest member gives way.
    count : int
        Its length so far.
    parent : float
        What the last column says.
    u, scale, low, high : float
        The mode, its scale, and the valleys on either side, log range.
    first, second, prior, spread, curve
        As for `log_density`.
    linear : bool
        Whether u is wide because globals or crosstalk are uncertain.

    Returns
    -------
    int
        The new length.
    """
    if linear:
        top = log_density(u, first, second, prior, spread, curve)
        log_mass = top + math.log(scale) + _LOG_ROOT_2PI
        return _add(choices, count, log_mass, u, 0.0, u, scale, parent)
    if u - _ROOT3 * scale >= low and u + _ROOT3 * scale <= high:
        top = log_density(u, first, second, prior, spread, curve)
        left = log_density(u - _ROOT3 * scale, first, second, prior, spread, curve) - top + 1.5
        right = log_density(u + _ROOT3 * scale, first, second, prior, spread, curve) - top + 1.5
        if abs(left) < _GAUSSIAN and abs(right) < _GAUSSIAN:
            left, right = math.exp(left), math.exp(right)
            mass = (4.0 + left + right) / 6.0
            shift = _ROOT3 * (right - left) / (6.0 * mass)
            sd = scale * math.sqrt(0.5 * (left + right) / mass - shift * shift)
            log_mass = top + math.log(mass * scale) + _LOG_ROOT_2PI
            return _add(choices, count, log_mass, u + shift * scale, sd, u, scale, parent)
    return _divide(choices, count, parent, u, scale, low, high, first, second, prior, spread, curve)
