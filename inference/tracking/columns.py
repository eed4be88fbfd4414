"""What everything uncertain in the scene does to the readings, along the range."""

import numpy as np
from numpy.typing import NDArray

from inference.tracking.globals import Globals
from inference.tracking.tabulate import Knots, empty_readings, means_over
from simulator.discrepancy import matern
from simulator.parameters import Terms
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["columns_of", "crosstalk_change", "discrepancy_shapes"]

Array = NDArray[np.float64]

_FELT = 1e-3  # standard deviations of a reading that a global must change to be carried along


def columns_of(
    sensor: Sensor,
    scene: Scene,
    known: Globals,
    knots: Knots,
    factors: Array,
    with_crosstalk: bool,
) -> tuple[Array, Array]:
    """Return what each uncertain direction does to the readings, a standard deviation along it.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        The scene; a discrepancy adds its shapes.
    known : Globals
        Centre and directions of what is uncertain.
    knots : Knots
        Where the curve is tabulated.
    factors : ndarray, shape (8,)
        From readings to units of the read noise.
    with_crosstalk : bool
        Whether the crosstalk's own share is part of the readings' columns.

    Returns
    -------
    (ndarray, ndarray), shapes (knots, 2 k), (2, k)
        Of the readings along the range, of those of an empty scene.
    """
    full, empty = [], []
    for plus, minus in zip(known.plus, known.minus, strict=True):
        change = 0.5 * (
            means_over(knots.positions, sensor, plus, False)
            - means_over(knots.positions, sensor, minus, False)
        )
        change = (change * factors)[:, :2]
        bare = empty_readings(sensor, plus, False) - empty_readings(sensor, minus, False)
        bare = 0.5 * bare * factors[:2]
        if with_crosstalk:
            own = crosstalk_change(plus, minus) * factors[:2]
            change, bare = change + own, bare + own
        if max(np.abs(change).max(), np.abs(bare).max()) > _FELT:
            full.append(change)
            empty.append(bare)
    if scene.discrepancy is not None:
        for shape in discrepancy_shapes(knots.positions, scene.discrepancy):
            full.append(knots.means[:, 4:6] * shape[:, None])
            empty.append(np.zeros(2))
    if not full:
        return np.zeros((knots.positions.size, 0)), np.zeros((2, 0))
    return np.concatenate(full, axis=1), np.stack(empty, axis=1)


def crosstalk_change(plus: Terms, minus: Terms) -> Array:
    """Return what one direction does to the crosstalk, shape (2,) [reading units].

    Parameters
    ----------
    plus, minus : Terms
        A standard deviation along it on either side.
    """
    if plus.crosstalk is None or minus.crosstalk is None:
        return np.zeros(2)
    return np.asarray(0.5 * (plus.crosstalk[0] - minus.crosstalk[0]))


def discrepancy_shapes(positions: Array, sd: float) -> Array:
    """Return the principal shapes of a smooth relative error of the object's flux.

    Its covariance is `simulator.discrepancy.matern`. The shapes hold all but a thousandth of its
    variance.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        u = log r.
    sd : float
        Standard deviation of the error.

    Returns
    -------
    ndarray, shape (k, n)
    """
    nodes = np.linspace(positions[0], positions[-1], 200)
    values, vectors = np.linalg.eigh(matern(nodes[:, None] - nodes))
    values, vectors = values[::-1], vectors[:, ::-1]
    kept = int(np.searchsorted(np.cumsum(values), 0.999 * values.sum())) + 1
    shapes = sd * np.sqrt(values[:kept]) * vectors[:, :kept]
    return np.array([np.interp(positions, nodes, shape) for shape in shapes.T])
