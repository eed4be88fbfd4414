"""Fewer hypotheses: those that say the same become one, and what is too many is dropped."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import Hypotheses, U, V, copy, learns_crosstalk, variance_of
from inference.tracking.square_root import triangularise
from simulator.compiled import compiled

__all__ = ["merge", "merge_equals", "prune"]

Array = NDArray[np.float64]

_UNLIKE = 1.0  # nats at which hypotheses are no longer merged for want of room


@borrowed
@compiled
def merge(of: Hypotheses, into: int, other: int, share: float, first: int, work: Array) -> None:
    """Replace one hypothesis by the mean and covariance of two.

    Parameters
    ----------
    of : Hypotheses
        Changed in place.
    into, other : int
        The hypotheses; ``into`` is overwritten.
    share : float
        Weight of ``other`` in the mixture of the two.
    first : int
        Only the states from this one on are merged.
    work : ndarray, shape (n, at least 3 n + p + 1)
        Overwritten.
    """
    x, X = of.x, of.X
    _, n, m = X.shape
    left, right = math.sqrt(1.0 - share), math.sqrt(share)
    for i in range(first, n):
        gap = x[other, i] - x[into, i]
        x[into, i] += share * gap
        # a place of its own for every column: triangularise reads from column ``first`` on
        for j in range(n):
            work[i, j] = 0.0
            work[i, n + j] = left * X[into, i, j]
            work[i, 2 * n + j] = right * X[other, i, j]
        work[i, 3 * n] = left * right * gap
        for j in range(n, m):
            change = X[other, i, j] - X[into, i, j]
            work[i, 2 * n + 1 + j] = left * right * change
            X[into, i, j] += share * change
    triangularise(work, first, n, 2 * n + 1 + m)
    for i in range(first, n):
        for j in range(n):
            X[into, i, j] = work[i, j] if j >= first else 0.0


@compiled
def _log_determinant(of: Hypotheses, one: int, other: int, share: float) -> float:
    """Return the log determinant of the covariance of (u, du/dt) of a mixture of two hypotheses."""
    x, X = of.x, of.X
    p11, p12, p22 = 0.0, 0.0, 0.0
    for row, weight in ((one, 1.0 - share), (other, share)):
        if weight == 0.0:
            continue
        for j in range(X.shape[-1]):
            p11 += weight * X[row, U, j] * X[row, U, j]
            p12 += weight * X[row, U, j] * X[row, V, j]
            p22 += weight * X[row, V, j] * X[row, V, j]
    spread = share * (1.0 - share)
    gap1, gap2 = x[other, U] - x[one, U], x[other, V] - x[one, V]
    p11 += spread * gap1 * gap1
    p12 += spread * gap1 * gap2
    p22 += spread * gap2 * gap2
    if p22 == 0.0:  # an object at rest has no rate to be told apart by
        return math.log(p11) if p11 > 0.0 else -math.inf
    rest = max(p22 - p12 * (p12 / p11), 1e-14 * p22) if p11 > 0.0 else 0.0
    return math.log(p11 * rest) if p11 * rest > 0.0 else -math.inf


@borrowed
@compiled
def _whole_log_determinant(
    of: Hypotheses, one: int, other: int, share: float, work: Array
) -> float:
    """Return the same of all states, the crosstalk too: roots on a curve must not become a line.

    What nuisance parameters do to both alike is left out.
    """
    x, X = of.x, of.X
    _, n, m = X.shape
    left, right = math.sqrt(1.0 - share), math.sqrt(share)
    for i in range(n):
        for j in range(n):
            work[i, j] = left * X[one, i, j]
            work[i, n + j] = right * X[other, i, j]
        work[i, 2 * n] = left * right * (x[other, i] - x[one, i])
        for j in range(n, m):
            work[i, n + 1 + j] = left * right * (X[other, i, j] - X[one, i, j])
    triangularise(work, 0, n, n + 1 + m)
    value = 0.0
    for i in range(n):
        if i == V and work[i, i] == 0.0:  # at rest
            continue
        if not work[i, i] > 0.0:
            return -math.inf
        value += 2.0 * math.log(work[i, i])
    return value


@borrowed
@compiled
def _loss(of: Hypotheses, heavy: int, light: int, share: float, work: Array) -> float:
    """Return the bound of the information that a merger loses [nats] (Runnalls 2007)."""
    if learns_crosstalk(of):
        both = _whole_log_determinant(of, heavy, light, share, work)
        one = _whole_log_determinant(of, heavy, light, 0.0, work)
        other = _whole_log_determinant(of, light, heavy, 0.0, work)
        return 0.5 * (both - (1.0 - share) * one - share * other)
    both = _log_determinant(of, heavy, light, share)
    one = _log_determinant(of, heavy, light, 0.0)
    other = _log_determinant(of, light, heavy, 0.0)
    return 0.5 * (both - (1.0 - share) * one - share * other)


@borrowed
@compiled
def _are_apart(of: Hypotheses, one: int, other: int, share: float, most: float) -> bool:
    """Tell whether the distance along u alone says that a merger loses too much, without a root.

    With W the mean of two covariances and d the distance of the means, that of the mixture has the
    determinant |W| (1 + s (1 - s) d'W^-1 d) at least. log |W| is at least the mean of both
    logarithms, and d'W^-1 d at least what one state has of it.
    """
    if not learns_crosstalk(of):
        return False
    gap = of.x[other, U] - of.x[one, U]
    mean = (1.0 - share) * variance_of(of, one, U) + share * variance_of(of, other, U)
    return (
        0.5 * math.log1p(share * (1.0 - share) * gap * gap / mean) >= most if mean > 0.0 else False
    )


@borrowed
@compiled
def _replace(of: Hypotheses, row: int, other: int) -> None:
    """Put one hypothesis in the place of another."""
    of.weight[row] = of.weight[other]
    copy(of, row, of, other)


@borrowed
@compiled
def _drop_lightest(of: Hypotheses, count: int) -> int:
    """Drop the lightest of the hypotheses in rows 1 to count; how many are left."""
    lightest = 1
    for j in range(2, count + 1):
        if of.weight[j] < of.weight[lightest]:
            lightest = j
    _replace(of, lightest, count)
    return count - 1


@borrowed
@compiled
def merge_equals(of: Hypotheses, count: int, same: float, work: Array) -> int:
    """Merge hypotheses that say the same.

    The information that a merger loses has a bound; here it is held against the weight of the
    lighter one, so that a light root far from a heavy one stays.

    Parameters
    ----------
    of : Hypotheses
        In rows 1 to count; changed in place.
    count : int
        Their number.
    same : float
        Bound [nats per weight of the lighter one].
    work : ndarray
        As for `merge`.

    Returns
    -------
    int
        How many are left.
    """
    weight = of.weight
    j = 1
    while j <= count:
        k = j + 1
        while k <= count:
            heavy, light = (j, k) if weight[j] >= weight[k] else (k, j)
            share = weight[light] / (weight[j] + weight[k])
            if _are_apart(of, heavy, light, share, same * share):
                k += 1
                continue
            if not _loss(of, heavy, light, share, work) < same * share:
                k += 1
                continue
            # the mixture is symmetric in the two: merged into j, whichever is heavier
            merge(of, j, k, weight[k] / (weight[j] + weight[k]), 0, work)
            weight[j] += weight[k]
            _replace(of, k, count)
            count -= 1
            k = j + 1  # the merged one may equal others now
        j += 1
    return count


@borrowed
@compiled
def prune(of: Hypotheses, count: int, room: int, same: float, work: Array) -> int:
    """Merge equals, then what is more and more unlike, then drop, until all have room.

    Parameters
    ----------
    of, count, same, work
        As for `merge_equals`.
    room : int
        Most hypotheses that may be left.

    Returns
    -------
    int
        How many are left.
    """
    count = merge_equals(of, count, same, work)
    while count > room and same < _UNLIKE:
        same *= 3.0
        count = merge_equals(of, count, same, work)
    while count > room:
        count = _drop_lightest(of, count)
    return count
