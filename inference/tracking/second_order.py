"""What a filter that is linear in range and nuisance parameters leaves out of a frame.

An object whose light is a factor stronger than expected moves its readings by that factor further
when it moves. The filter carries what the factor does to the readings, but not what it does to
their change along the range: the product of an error of u and a nuisance parameter. Left out, the
turn of the readings passes for knowledge of the crosstalk, and ranges were up to 200 standard
deviations off. Taken of all that nuisance parameters leave open before the frame, a frame beside
crosstalk that is known would tell no range by its phase or ratio: it tells the light as well, and
the mode and the slope there are taken at that light (`inference.tracking.mode_refinement`).

docs/model.md, learnt-products, has the derivation.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import felt_at
from inference.tracking.hypotheses import CROSSTALK1, CROSSTALK2
from inference.tracking.readings_table import ReadingsTable, cell_of, nuisance_at, nuisance_count
from inference.tracking.roots import Root, add_factor, solve
from simulator.compiled import compiled

__all__ = ["add_products", "slope_variance"]

Array = NDArray[np.float64]

# Standard deviations at which a nuisance parameter is taken. It is the same in all frames, so that
# its square does not average out as that of noise does: nineteen of twenty scenes are within two.
_TAKEN_AT = 2.0


@compiled
def _turn(i: int, j: int, table: ReadingsTable) -> tuple[float, float]:
    """Return how what nuisance parameter j does to the readings changes over a cell."""
    here1, here2 = nuisance_at(i, 0.0, j, table)
    next1, next2 = nuisance_at(i, 1.0, j, table)
    return next1 - here1, next2 - here2


@borrowed
@compiled
def add_products(
    root: Root,
    frame: Root,
    u: float,
    gain: float,
    variance: float,
    told: float,
    slopes: tuple[float, float],
    X: Array,
    table: ReadingsTable,
) -> Root:
    """Add the products of an error of u and every nuisance parameter to the noise of a frame.

    Errors of u come anew with every frame, by what motion adds. As far as crosstalk is known the
    frame says with what light, and what it leaves open of that counts. Of crosstalk that is open,
    and along what u errs with it, no frame says so, and all of the light counts.

    Parameters
    ----------
    root : Root
        Of the covariance of the readings without them.
    frame : Root
        Of that by noise alone, beside which, and crosstalk, a frame tells nuisance parameters.
    u : float
        log r at which the readings are taken.
    gain : float
        The frame's factor on the sensor's gain.
    variance : float
        Of u before the frame.
    told : float
        Part of it along which the frame says what light there is, as by `Prior`.
    slopes, X
        As for `felt_at`.
    table : ReadingsTable
        The scene.
    """
    count = nuisance_count(table)
    if count == 0:
        return root
    i, t = cell_of(u, table)
    for j in range(X.shape[0]):
        frame = add_factor(frame, X[CROSSTALK1, j], X[CROSSTALK2, j])
    all_of, b11, b12, b21, b22 = frame, 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        f1, f2 = felt_at(j, i, t, gain, slopes, X, table)
        turn1, turn2 = _turn(i, j, table)
        all_of = add_factor(all_of, f1, f2)
        b11, b12 = b11 + turn1 * f1, b12 + turn1 * f2
        b21, b22 = b21 + turn2 * f1, b22 + turn2 * f2
    # regression of what the parameters change along u on the readings
    k11, k12 = solve(all_of, b11, b12)
    k21, k22 = solve(all_of, b21, b22)
    scale = _TAKEN_AT * gain / table.step
    own = scale * math.sqrt(told * variance)
    common = scale * math.sqrt((1.0 - told) * variance)
    for j in range(count):
        f1, f2 = felt_at(j, i, t, gain, slopes, X, table)
        turn1, turn2 = _turn(i, j, table)
        left1, left2 = turn1 - k11 * f1 - k12 * f2, turn2 - k21 * f1 - k22 * f2
        root = add_factor(root, own * left1, own * left2)
        root = add_factor(root, common * turn1, common * turn2)
    first1, first2 = k11 * frame.r11 + k12 * frame.r21, k21 * frame.r11 + k22 * frame.r21
    root = add_factor(root, own * first1, own * first2)
    return add_factor(root, own * k12 * frame.r22, own * k22 * frame.r22)


@compiled
def slope_variance(
    u: float, gain: float, slope1: float, slope2: float, table: ReadingsTable
) -> float:
    """Return the variance that nuisance parameters give the derivatives of the readings along u.

    Parameters
    ----------
    u, gain, table
        As for `add_products`.
    slope1, slope2 : float
        The derivatives, relative to whose squares it is.
    """
    i, _ = cell_of(u, table)
    size, square = _TAKEN_AT * gain / table.step, 0.0
    for j in range(nuisance_count(table)):
        turn1, turn2 = _turn(i, j, table)
        square += size * turn1 * (size * turn1) + size * turn2 * (size * turn2)
    whole = slope1 * slope1 + slope2 * slope2
    return square / whole if whole > 0.0 else 0.0
