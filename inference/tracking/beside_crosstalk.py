"""What a hypothesis errs in log r, and what its crosstalk then adds to the readings.

Where crosstalk is learnt a frame is looked for along what u errs by itself, which is motion mostly.
What it errs with the crosstalk leaves the readings as they are, and no frame has a mode along it.
Looked for along all of u, the curve was taken where the object is in the mean of all that leads to
that u, and what the frame says of the motion was read off the tangent there. By the bend of the
curve that is another reading at every u, though it is the same motion: across the curve noise moved
the mode along what is in common, frame after frame to the same side, and the crosstalk took over
what light the motion had changed.

Not where a frame shows less of the motion than is known before it: there what u errs by itself is,
at every u, what it is in the mean. Nor of a known range, or where the ranges end: all of u is one
number there.

docs/model.md, learnt-own, has the derivation.
"""

from typing import NamedTuple

from inference.tracking.hypotheses import (
    ANCHOR,
    CROSSTALK1,
    CROSSTALK2,
    Hypotheses,
    U,
    variance_of,
)
from inference.tracking.readings_table import ReadingsTable, mean_at
from inference.tracking.roots import Root, add_factor, add_root, solve
from inference.tracking.shared_error import shared_part
from simulator.compiled import compiled

__all__ = ["Beside", "beside_of"]

_LEAST = 1e-300  # variance
# information of a frame about what u errs by itself, times its variance before the frame, from
# which on the frame shows it
_SHOWN = 4.0


class Beside(NamedTuple):
    """A normal error of u, and what is added to the readings given that error."""

    variance: float  # of u, or of what it errs by itself
    # change of the readings with it, beside the curve's own
    slope1: float
    slope2: float
    root: Root  # of the covariance of what is added to the readings
    share: float  # of the variance of u that comes from crosstalk, where that is part of the error


@compiled
def _beside_own(of: Hypotheses, row: int, gain: float, table: ReadingsTable) -> Beside:
    """Return what u errs by itself, and what crosstalk and the rest of u add to the readings.

    They add little: the rest of u is straight along the tangent at the anchor.
    """
    X = of.X
    back1, back2, _ = shared_part(of, row)
    _, _, d1, d2 = mean_at(of.x[row, ANCHOR], table)
    along1, along2 = gain * d1, gain * d2
    variance, slope1, slope2 = 0.0, 0.0, 0.0
    for j in range(X.shape[1]):
        first, second = X[row, CROSSTALK1, j], X[row, CROSSTALK2, j]
        common = back1 * first + back2 * second
        own = X[row, U, j] - common
        variance += own * own
        slope1 += (first + along1 * common) * own
        slope2 += (second + along2 * common) * own
    variance = max(variance, _LEAST)
    slope1, slope2, root = slope1 / variance, slope2 / variance, Root(0.0, 0.0, 0.0)
    for j in range(X.shape[1]):
        first, second = X[row, CROSSTALK1, j], X[row, CROSSTALK2, j]
        common = back1 * first + back2 * second
        own = X[row, U, j] - common
        first, second = first + along1 * common, second + along2 * common
        root = add_factor(root, first - slope1 * own, second - slope2 * own)
    return Beside(variance, slope1, slope2, root, 0.0)


@compiled
def _beside_all(of: Hypotheses, row: int, gain: float, table: ReadingsTable) -> Beside:
    """Return all that u errs, and what crosstalk adds to the readings."""
    X, variance = of.X, max(variance_of(of, row, U), _LEAST)
    _, _, share = shared_part(of, row)
    _, _, d1, d2 = mean_at(of.x[row, ANCHOR], table)
    slope1, slope2 = 0.0, 0.0
    for j in range(X.shape[1]):
        slope1 += X[row, CROSSTALK1, j] * X[row, U, j]
        slope2 += X[row, CROSSTALK2, j] * X[row, U, j]
    slope1, slope2, root = slope1 / variance, slope2 / variance, Root(0.0, 0.0, 0.0)
    for j in range(X.shape[1]):
        own = X[row, U, j]
        first = X[row, CROSSTALK1, j] - slope1 * own
        root = add_factor(root, first, X[row, CROSSTALK2, j] - slope2 * own)
    slope1, slope2 = slope1 + gain * share * d1, slope2 + gain * share * d2
    return Beside(variance, slope1, slope2, root, share)


@compiled
def beside_of(
    of: Hypotheses, row: int, gain: float, noise: Root, known: bool, table: ReadingsTable
) -> Beside:
    """Return along which error of u a hypothesis is held against a frame, and what comes beside it.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis.
    gain : float
        The frame's factor on the sensor's gain.
    noise : Root
        Of the covariance of the frame's noise.
    known : bool
        Whether the frame's range is known beside its readings.
    table : ReadingsTable
        Mean readings.
    """
    u = of.x[row, U]
    if not known and table.start <= u <= table.end:
        beside = _beside_own(of, row, gain, table)
        _, _, d1, d2 = mean_at(u, table)
        pull1, pull2 = solve(add_root(noise, beside.root), gain * d1, gain * d2)
        if gain * (pull1 * d1 + pull2 * d2) * beside.variance > _SHOWN:
            return beside
    return _beside_all(of, row, gain, table)
