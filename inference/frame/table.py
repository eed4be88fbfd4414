"""The curve of mean readings, tabulated once for all frames of a parameter vector."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import FrameScene, Instrument, Pair
from inference.frame.gaussian import precision_product
from inference.frame.mean_readings import light_along, light_at, with_crosstalk
from inference.frame.noise import has_shot
from inference.frame.range_prior import LEAST_INFORMATION, log_range_density, log_resolved
from simulator.compiled import compiled

__all__ = [
    "KNOT_SPACING",
    "LOG_PRIOR",
    "LOG_RANGE",
    "MEAN_1",
    "MEAN_2",
    "SIGNAL_1",
    "SIGNAL_2",
    "TURN",
    "even_spacing",
    "tabulate",
]

Array = NDArray[np.float64]

# rows of a table
LOG_RANGE, LOG_PRIOR, SIGNAL_1, SIGNAL_2, MEAN_1, MEAN_2 = 0, 1, 2, 3, 4, 5
_ROWS = 6

KNOT_SPACING = 0.0365  # 192 knots over the default prior's seven e-folds
_FEWEST_KNOTS = 192
_MOST_KNOTS = 16384
TURN = 0.7  # cosine of the largest turn of the curve at a knot
_VISIBLE = 0.3  # standard deviations of a reading below which a turn of the curve is not seen


@compiled
def _fill(table: Array, k: int, u: float, strongest: float, scene: FrameScene) -> None:
    """Fill one column of a table."""
    r, prior = math.exp(u), scene.range_prior
    law = log_range_density(r, u, prior)
    if prior.resolves:
        signal, _, mean, slope = light_along(u, r, 1.0, scene)
        law += _log_resolution(signal, mean, slope, strongest, scene)
    else:
        signal, mean = light_at(u, r, 1.0, scene)
    table[LOG_RANGE, k], table[LOG_PRIOR, k] = u, law
    table[SIGNAL_1, k], table[SIGNAL_2, k] = signal
    table[MEAN_1, k], table[MEAN_2, k] = mean


@compiled
def _log_resolution(
    signal: Pair, mean: Pair, slope: Pair, strongest: float, scene: FrameScene
) -> float:
    """Return the log of a reference prior, that of the strongest frame."""
    r0, wave, read, shot, _, _ = scene.instrument
    # noise that does not depend on the object's part of the readings
    instrument = Instrument(r0, wave, read, shot, None, False)
    signal = strongest * signal[0], strongest * signal[1]
    slope = strongest * slope[0], strongest * slope[1]
    mean = with_crosstalk(mean, strongest, scene)
    told = precision_product(slope, slope, mean, signal, instrument)
    return log_resolved(told / LEAST_INFORMATION, scene.range_prior.dark)


@compiled
def _changes_sign(before: float, after: float, unit: float) -> bool:
    """Tell whether a quantity changes sign over a visible step."""
    return (before < 0.0) != (after < 0.0) and abs(after - before) > unit


@compiled
def _too_coarse(
    split: NDArray[np.bool_],
    table: Array,
    offset: Pair,
    unit: Pair,
    pulsed: bool,
    shot: float | None,
) -> int:
    """Mark the segments of a table that want a knot in their middle; count them."""
    split[:] = False
    x1 = (table[MEAN_1, 1] - table[MEAN_1, 0]) / unit[0]
    y1 = (table[MEAN_2, 1] - table[MEAN_2, 0]) / unit[1]
    length1 = x1 * x1 + y1 * y1
    for k in range(1, table.shape[1] - 1):
        x2 = (table[MEAN_1, k + 1] - table[MEAN_1, k]) / unit[0]
        y2 = (table[MEAN_2, k + 1] - table[MEAN_2, k]) / unit[1]
        length2 = x2 * x2 + y2 * y2
        along = x1 * x2 + y1 * y2
        if max(length1, length2) > _VISIBLE * _VISIBLE and (
            along <= 0.0 or along * along < TURN * TURN * length1 * length2
        ):
            split[k - 1] = split[k - 1] or length1 > _VISIBLE * _VISIBLE
            split[k] = length2 > _VISIBLE * _VISIBLE
        x1, y1, length1 = x2, y2, length2
    if has_shot(shot):
        # shot noise vanishes where a mean reading does, and the difference's where both are equal
        for k in range(split.size):
            a1, a2 = table[MEAN_1, k] + offset[0], table[MEAN_1, k + 1] + offset[0]
            b1, b2 = table[MEAN_2, k] + offset[1], table[MEAN_2, k + 1] + offset[1]
            crosses = _changes_sign(a1, a2, unit[0]) or _changes_sign(b1, b2, unit[1])
            if pulsed:
                crosses = crosses or _changes_sign(a1 - b1, a2 - b2, min(unit[0], unit[1]))
            split[k] = split[k] or crosses
    count = 0
    for k in range(split.size):
        # a segment of a few roundings is as short as it can be
        width = table[LOG_RANGE, k + 1] - table[LOG_RANGE, k]
        split[k] = split[k] and width > 1e-12 * (1.0 + abs(table[LOG_RANGE, k]))
        count += split[k]
    return count


@compiled
def _offset(crosstalk: Pair | None, strongest: float) -> Pair:
    """Return crosstalk in units of the gain factor, zero where there is none."""
    if crosstalk is not None:
        return crosstalk[0] / strongest, crosstalk[1] / strongest
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return 0.0, 0.0


@compiled
def _knots(first: float, last: float) -> int:
    """Return how many knots a table begins with, evenly spaced."""
    return max(_FEWEST_KNOTS, math.ceil((last - first) / KNOT_SPACING) + 1)


@compiled
def even_spacing(table: Array) -> float:
    """Return the spacing of a table's knots along log r; 0 where the curve turns between some."""
    n = table.shape[1]
    first, last = table[LOG_RANGE, 0], table[LOG_RANGE, n - 1]
    return (last - first) / (n - 1) if n == _knots(first, last) else 0.0


@compiled
def tabulate(bounds: Pair, scene: FrameScene, strongest: float) -> Array:
    """Tabulate the curve of mean readings, knots closer where it turns.

    Between knots the distance of a reading from the curve has one minimum as long as the curve is
    near straight there. Evenly spaced knots miss the turns of a sine wave over many wavelengths,
    the narrow peak of a flux with c1 near -2 sqrt(c0), and the place where shot noise vanishes.

    Parameters
    ----------
    bounds : (float, float)
        From `inference.frame.range_prior.integration_bounds`.
    scene : FrameScene
        The parameters.
    strongest : float
        Largest gain factor of the frames: what a turn of the curve is held against.

    Returns
    -------
    ndarray, shape (6, knots)
        u, log prior, object's readings, scene's readings; readings without gain factor and
        crosstalk. A reference prior is that of the strongest frame under read and shot noise.
    """
    instrument = scene.instrument
    wave, read, shot = instrument.wave, instrument.read, instrument.shot
    n = _knots(bounds[0], bounds[1])
    unit = (read[0] / strongest, read[1] / strongest)
    offset = _offset(scene.crosstalk, strongest)
    table = np.empty((_ROWS, n))
    for k in range(n):
        u = bounds[0] + (bounds[1] - bounds[0]) * k / (n - 1)
        _fill(table, k, u, strongest, scene)
    while True:
        split = np.empty(n - 1, dtype=np.bool_)
        more = _too_coarse(split, table, offset, unit, wave is None, shot)
        if more == 0 or n + more > _MOST_KNOTS:
            break
        finer = np.empty((_ROWS, n + more))
        k = 0
        for j in range(n):
            for i in range(_ROWS):
                finer[i, k] = table[i, j]
            k += 1
            if j < n - 1 and split[j]:
                middle = 0.5 * (table[LOG_RANGE, j] + table[LOG_RANGE, j + 1])
                _fill(finer, k, middle, strongest, scene)
                k += 1
        table, n = finer, n + more
    return table
