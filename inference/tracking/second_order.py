"""What a filter that is linear in range and nuisance parameters leaves out of a frame.

An object whose light is a factor stronger than expected moves its readings by that factor further
when it moves. The filter carries what the factor does to the readings, but not what it does to
their change along the range: the product of an error of u and a nuisance parameter. Left out, the
turn of the readings passes for knowledge of the crosstalk, and ranges were up to 200 standard
deviations off.
"""

from inference.tracking.borrowed import borrowed
from inference.tracking.readings_table import ReadingsTable, cell_of, nuisance_at, nuisance_count
from inference.tracking.roots import Root, add_factor
from simulator.compiled import compiled

__all__ = ["add_products", "slope_variance"]

# Standard deviations at which a nuisance parameter is taken. It is the same in all frames, so that
# its square does not average out as that of noise does: nineteen of twenty scenes are within two.
_TAKEN_AT = 2.0


@borrowed
@compiled
def add_products(root: Root, u: float, gain: float, sd: float, table: ReadingsTable) -> Root:
    """Add the products of an error of u and every nuisance parameter to the noise of a frame.

    Errors of u come anew with every frame, by what motion adds.

    Parameters
    ----------
    root : Root
        Of the covariance of the readings without them.
    u : float
        log r at which the readings are taken.
    gain : float
        The frame's factor on the sensor's gain.
    sd : float
        Standard deviation of u before the frame.
    table : ReadingsTable
        The scene.
    """
    i, _ = cell_of(u, table)
    size = _TAKEN_AT * gain * sd / table.step
    for j in range(nuisance_count(table)):
        here1, here2 = nuisance_at(i, 0.0, j, table)
        next1, next2 = nuisance_at(i, 1.0, j, table)
        root = add_factor(root, size * (next1 - here1), size * (next2 - here2))
    return root


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
        here1, here2 = nuisance_at(i, 0.0, j, table)
        next1, next2 = nuisance_at(i, 1.0, j, table)
        away1, away2 = size * (next1 - here1), size * (next2 - here2)
        square += away1 * away1 + away2 * away2
    whole = slope1 * slope1 + slope2 * slope2
    return square / whole if whole > 0.0 else 0.0
