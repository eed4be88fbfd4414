"""The nuisance Jacobian: what everything uncertain in the scene does to the readings."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.tracking.model_error import model_changes
from inference.tracking.nuisance import Nuisance
from inference.tracking.tabulate import Knots, empty_readings, means_over
from simulator.model_error import ModelError
from simulator.parameters import Terms
from simulator.sensor import Sensor

__all__ = ["NuisanceJacobian", "crosstalk_root", "nuisance_jacobian"]

Array = NDArray[np.float64]

_FELT = 1e-3  # standard deviations of a reading that a direction must change to be carried along


@dataclasses.dataclass(frozen=True, eq=False)
class NuisanceJacobian:
    """Change of the readings with p independent standard normal nuisance parameters."""

    along: Array  # (knots, 2 p): of the readings along the range, in units of the noise
    empty: Array  # (2, p): of those of an empty scene
    from_scene: int  # how many, the first, are of the scene; the others are errors of the model


def nuisance_jacobian(
    sensor: Sensor,
    error: ModelError,
    known: Nuisance,
    knots: Knots,
    scale: Array,
    with_crosstalk: bool,
) -> NuisanceJacobian:
    """Return what each uncertain direction does to the readings, a standard deviation along it.

    By the secant over both sides, not by a derivative: it is as far as the uncertainty goes.

    Parameters
    ----------
    error : ModelError
        Errors of the model, which add their shapes.
    known : Nuisance
        Centre and directions of what is uncertain.
    knots : Knots
        Where the readings are tabulated.
    scale : ndarray, shape (2,)
        From readings to units of the noise.
    with_crosstalk : bool
        Whether the crosstalk's own share is part of the change.
    """
    along, empty = [], []
    for plus, minus in zip(known.plus, known.minus, strict=True):
        difference = means_over(knots.positions, sensor, plus, False) - means_over(
            knots.positions, sensor, minus, False
        )
        change = (0.5 * difference)[:, :2] * scale
        bare = empty_readings(sensor, plus, False) - empty_readings(sensor, minus, False)
        bare = 0.5 * bare * scale
        if with_crosstalk:
            own = _crosstalk_change(plus, minus) * scale
            change, bare = change + own, bare + own
        if max(np.abs(change).max(), np.abs(bare).max()) > _FELT:
            along.append(change)
            empty.append(bare)
    from_scene = len(along)
    for change in model_changes(sensor, error, known.centre, knots, scale):
        if np.abs(change).max() > _FELT:
            along.append(change)
            empty.append(np.zeros(2))
    if not along:
        return NuisanceJacobian(np.zeros((knots.positions.size, 0)), np.zeros((2, 0)), 0)
    return NuisanceJacobian(np.concatenate(along, axis=1), np.stack(empty, axis=1), from_scene)


def crosstalk_root(known: Nuisance, scale: Array) -> Array:
    """Return a root of the crosstalk's covariance, shape (2, k), in units of the noise.

    Parameters
    ----------
    known : Nuisance
        With k directions.
    scale : ndarray, shape (2,)
        From readings to units of the noise.
    """
    pairs = zip(known.plus, known.minus, strict=True)
    return np.array([_crosstalk_change(*pair) * scale for pair in pairs]).reshape(-1, 2).T


def _crosstalk_change(plus: Terms, minus: Terms) -> Array:
    """Return what one direction does to the crosstalk, shape (2,) [reading units]."""
    if plus.crosstalk is None or minus.crosstalk is None:
        return np.zeros(2)
    return np.asarray(0.5 * (plus.crosstalk[0] - minus.crosstalk[0]))
