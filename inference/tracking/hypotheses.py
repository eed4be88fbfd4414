"""One hypothesis and one frame: what it expects, and what it becomes."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.curve import (
    Curve,
    Prior,
    add_factor,
    cell_of,
    column_at,
    mean_at,
    noise_root,
    object_at,
)
from inference.tracking.motion import Rules
from inference.tracking.shared_error import (
    ANCHOR,
    follow,
    shared_part,
    straighten,
    turn_of,
)
from inference.tracking.square_root import solve, update
from simulator.compiled import compiled

__all__ = ["born_prior", "expected_readings", "learn", "learn_empty", "log_outlier", "prior_of"]

Array = NDArray[np.float64]

_LOG_2PI = math.log(2.0 * math.pi)
_BROAD = 10.0  # standard deviation of log r before the first frame: vague, but no more


@compiled
def prior_of(x: Array, X: Array, row: int, gain: float, log_weight: float, curve: Curve) -> Prior:
    """Return what a hypothesis says of the next frame, as a density of u and the rest given u."""
    n, m = X.shape[1], X.shape[2]
    variance = 0.0
    for j in range(n):
        variance += X[row, 0, j] * X[row, 0, j]
    precision = 1.0 / max(variance, 1e-300)
    log_scale = log_weight + 0.5 * (math.log(precision) - _LOG_2PI)
    centre = x[row, 0]
    offset1, offset2 = curve.crosstalk1, curve.crosstalk2
    slope1, slope2 = 0.0, 0.0
    root = (0.0, 0.0, 0.0)
    share = 0.0
    if n > 2:
        offset1, offset2 = offset1 + x[row, 2], offset2 + x[row, 3]
        for j in range(n):
            slope1 += X[row, 2, j] * X[row, 0, j] * precision
            slope2 += X[row, 3, j] * X[row, 0, j] * precision
        for j in range(n):
            own = X[row, 0, j]
            root = add_factor(root, X[row, 2, j] - slope1 * own, X[row, 3, j] - slope2 * own)
        _, _, share = shared_part(X, row, n)
        _, _, d1, d2 = mean_at(x[row, ANCHOR], curve)
        slope1, slope2 = slope1 + gain * share * d1, slope2 + gain * share * d2
    if m > n:
        # the filter runs at the centre of the globals: what they do to the readings beyond what
        # they have already done to the range is noise to it
        i, t = cell_of(centre, curve)
        _, _, d1, d2 = mean_at(centre, curve)
        for j in range(n, m):
            f1, f2 = column_at(i, t, j - n, curve)
            f1, f2 = gain * (f1 + d1 * X[row, 0, j]), gain * (f2 + d2 * X[row, 0, j])
            if n > 2:
                f1, f2 = f1 + X[row, 2, j], f2 + X[row, 3, j]
            root = add_factor(root, f1, f2)
    rate_slope, rate_sd = 0.0, 0.0
    if curve.by_rate:
        for j in range(m):
            rate_slope += X[row, 0, j] * X[row, 1, j] * precision
        for j in range(m):
            rate_sd += (X[row, 1, j] - rate_slope * X[row, 0, j]) ** 2
        rate_sd = math.sqrt(rate_sd)
    return Prior(
        False,
        centre,
        precision,
        log_scale,
        offset1,
        offset2,
        slope1,
        slope2,
        root[0],
        root[1],
        root[2],
        x[row, 1],
        rate_slope,
        rate_sd,
        gain,
        share,
    )


@compiled
def born_prior(
    x: Array, X: Array, gain: float, log_weight: float, rate_sd: float, curve: Curve
) -> Prior:
    """Return what is known of an object that has just come: the law of ranges, and the crosstalk.

    Row 0 holds the crosstalk as the empty scene has it.
    """
    n, m = X.shape[1], X.shape[2]
    offset1, offset2 = curve.crosstalk1, curve.crosstalk2
    root = (0.0, 0.0, 0.0)
    if n > 2:
        offset1, offset2 = offset1 + x[0, 2], offset2 + x[0, 3]
        for j in range(m):
            root = add_factor(root, X[0, 2, j], X[0, 3, j])
    return Prior(
        True,
        0.0,
        0.0,
        log_weight,
        offset1,
        offset2,
        0.0,
        0.0,
        root[0],
        root[1],
        root[2],
        0.0,
        0.0,
        rate_sd,
        gain,
        0.0,
    )


@compiled
def expected_readings(x: Array, row: int, gain: float, curve: Curve) -> tuple[float, float]:
    """Return the readings at the mean of a hypothesis."""
    value1, value2, _, _ = mean_at(x[row, 0], curve)
    if curve.by_rate:
        return gain * value1 * x[row, 1], gain * value2 * x[row, 1]
    m1, m2 = gain * value1 + curve.crosstalk1, gain * value2 + curve.crosstalk2
    if x.shape[1] > 2:
        m1, m2 = m1 + x[row, 2], m2 + x[row, 3]
    return m1, m2


@compiled
def log_outlier(
    first: float, second: float, mean1: float, mean2: float, rules: Rules, curve: Curve
) -> float:
    """Return the log density of readings that have nothing to do with the scene.

    A Cauchy law around what was expected: its tails forgive any reading, in whatever unit.
    """
    e1, e2 = (first - mean1) / rules.breadth, (second - mean2) / rules.breadth
    square = 1.0 + e1 * e1 + e2 * e2
    if curve.channels == 1:
        return 0.5 * math.log(2.0 / math.pi) - math.log(rules.breadth * square)
    return -2.0 * math.log(rules.breadth) - 1.5 * math.log(square)


@compiled
def learn(
    x: Array,
    X: Array,
    row: int,
    choices: Array,
    choice: int,
    first: float,
    second: float,
    prior: Prior,
    curve: Curve,
    columns: Array,
    work: Array,
    factors: Array,
) -> float:
    """Update a hypothesis at one mode of a frame.

    A Kalman step, linear at the mode, says what the frame tells about rate and crosstalk; the mean
    and standard deviation of u are then those that were integrated along the curve, if they were.

    Parameters
    ----------
    x, X : ndarray
        As in `square_root.move`; the row holds the prediction and is changed in place.
    row : int
        The hypothesis.
    choices, choice : ndarray, int
        List from `find_choices`, and the one that is taken.
    first, second, prior, curve
        As there.
    columns : ndarray, shape (2, p)
        Overwritten.
    work, factors : ndarray
        As in `square_root.update`.

    Returns
    -------
    float
        Normalised innovation squared.
    """
    n, m = X.shape[1], X.shape[2]
    u, gain = choices[choice, 3], prior.gain
    # where the curve is taken: as far as the error that u shares with the crosstalk goes, at u's
    # prediction
    at = u if prior.born else prior.centre + (1.0 - prior.share) * (u - prior.centre)
    value1, value2, d1, d2 = mean_at(at, curve)
    value1, value2, d1, d2 = gain * value1, gain * value2, gain * d1, gain * d2
    back, turn = (0.0, 0.0), (0.0, 0.0)
    before = (x[row, 0], 0.0, 0.0)
    if n > 2 and not prior.born:
        back1, back2, _ = shared_part(X, row, n)
        _, _, s1, s2 = mean_at(x[row, ANCHOR], curve)
        back, turn = (back1, back2), turn_of((back1, back2), gain * s1 - d1, gain * s2 - d2)
        before = (x[row, 0], x[row, 2], x[row, 3])
        straighten(X, row, n, back, turn)
    if prior.born:
        # before the frame: anywhere near, so vaguely that the frame alone speaks
        x[row, 0], x[row, 1] = u, 0.0
        if n > 2:
            x[row, ANCHOR] = u
        for j in range(m):
            X[row, 0, j], X[row, 1, j] = 0.0, 0.0
        X[row, 0, 0], X[row, 1, 1] = _BROAD, prior.rate_sd
    noise = (1.0, 0.0, 1.0)
    if curve.by_rate:
        away = 0.0 if prior.born else u - prior.centre
        expected = prior.rate + prior.rate_slope * away
        square = prior.rate_sd * prior.rate_sd
        along = value1 * (first - value1 * expected) + value2 * (second - value2 * expected)
        size = value1 * value1 + value2 * value2
        rate = expected + square * along / (1.0 + square * size)
        slopes = (d1 * rate, d2 * rate, value1, value2)
        e1 = first - value1 * x[row, 1] - slopes[0] * (x[row, 0] - u)
        e2 = second - value2 * x[row, 1] - slopes[1] * (x[row, 0] - u)
    else:
        m1, m2 = value1 + prior.offset1, value2 + prior.offset2
        slopes = (d1, d2, 0.0, 0.0)
        if not curve.plain:
            o1, o2 = object_at(u, curve)
            noise = noise_root(m1, m2, gain * o1, gain * o2, curve)
        i, t = cell_of(u, curve)
        for j in range(m - n):
            g1, g2 = column_at(i, t, j, curve)
            columns[0, j], columns[1, j] = gain * g1, gain * g2
        e1 = first - m1 - d1 * (x[row, 0] - at)
        e2 = second - m2 - d2 * (x[row, 0] - at)
    surprise = update(x, X, row, e1, e2, slopes, noise, columns, work, factors)
    if n > 2 and not prior.born:
        follow(x, X, row, before, back, turn, gain, curve)
    variance = 0.0
    for j in range(n):
        variance += X[row, 0, j] * X[row, 0, j]
    if variance > 0.0 and choices[choice, 2] > 0.0:
        stretch = choices[choice, 2] / math.sqrt(variance) - 1.0
        shift = choices[choice, 1] - x[row, 0]
        for i in range(n - 1, -1, -1):
            slope = 0.0
            for j in range(n):
                slope += X[row, i, j] * X[row, 0, j]
            slope /= variance
            x[row, i] += slope * shift
            for j in range(n):
                X[row, i, j] += slope * stretch * X[row, 0, j]
    return surprise + 1.0 if prior.born else surprise


@compiled
def learn_empty(
    x: Array,
    X: Array,
    first: float,
    second: float,
    gain: float,
    curve: Curve,
    empty: Array,
    columns: Array,
    work: Array,
    factors: Array,
    change: bool,
) -> tuple[float, float, float, float]:
    """Hold a frame against the empty scene, and learn the crosstalk from it.

    Parameters
    ----------
    x, X, columns, work, factors
        As for `learn`; row 0 is the empty scene.
    first, second, gain : float
        The frame.
    curve : Curve
        The curve.
    empty : ndarray, shape (2, 1 + p)
        Readings of the empty scene without crosstalk, and their change with the globals.
    change : bool
        Whether to learn from the frame, or only to weigh it.

    Returns
    -------
    (float, float, float, float)
        Log density without the log of 2 pi, normalised innovation squared, and what was expected.
    """
    n, m = X.shape[1], X.shape[2]
    m1 = gain * empty[0, 0] + curve.crosstalk1
    m2 = gain * empty[1, 0] + curve.crosstalk2
    if n > 2:
        m1, m2 = m1 + x[0, 2], m2 + x[0, 3]
    noise = (1.0, 0.0, 1.0)
    if not curve.plain and not curve.by_rate:
        noise = noise_root(m1, m2, 0.0, 0.0, curve)
    root = noise
    for j in range(m):
        f1, f2 = 0.0, 0.0
        if n > 2:
            f1, f2 = X[0, 2, j], X[0, 3, j]
        if j >= n:
            columns[0, j - n] = gain * empty[0, 1 + j - n]
            columns[1, j - n] = gain * empty[1, 1 + j - n]
            f1, f2 = f1 + columns[0, j - n], f2 + columns[1, j - n]
        root = add_factor(root, f1, f2)
    e1, e2 = first - m1, second - m2
    pull1, pull2 = solve(root, e1, e2)
    surprise = e1 * pull1 + e2 * pull2
    density = -0.5 * surprise - math.log(root[0] * root[2])
    if change and n > 2:
        update(x, X, 0, e1, e2, (0.0, 0.0, 0.0, 0.0), noise, columns, work, factors)
    return density, surprise, m1, m2
