"""Coordinates without units of all that a frame's readings depend on, and how they move with z."""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.frame.sensitivity import Value
from simulator.parameters import Parameters, Terms

__all__ = [
    "COORDINATES",
    "DRIFT_COORDINATES",
    "SENSOR_COORDINATES",
    "coordinate_slopes",
    "has_sensor",
    "some_of",
    "term_changes",
]

Array = NDArray[np.float64]

COORDINATES = (
    "object.c0",
    "object.c1",
    "object.c2",
    "crosstalk.0",
    "crosstalk.1",
    "background.strength",
    "background.distance_m",
    "background.shadow.c0",
    "background.shadow.c1",
)
"""Columns of `inference.frame.sensitivity.Sensitivity.by_term`, in the order of `Value`.

Derivatives are along log c0, c1 / sqrt(c0) with c0 held, log c2, the crosstalk [reading units],
log B, log R, log c0' and c1' / sqrt(c0') with c0' held, everything else held. A term
that the scene lacks has columns of zeros. Behind them, where something of the sensor is unknown,
are its `SENSOR_COORDINATES`, and behind these, of a sensor that follows its temperature, its
`DRIFT_COORDINATES`.
"""

SENSOR_COORDINATES = ("sensor.known_gain", "sensor.lag")
"""The log of the gain, and the lag: a phase [rad] or a length [m] (`sensor_unknowns`)."""

DRIFT_COORDINATES = ("sensor.gain_drift", "sensor.delay_drift")
"""What gain [1/K] and delay [s/K] change by with the temperature."""


def has_sensor(terms: Terms) -> bool:
    """Tell whether something of the sensor is unknown, or follows its temperature."""
    return terms.gain is not None or terms.lag is not None or terms.drift is not None


# the maps from z are smooth and of unit scale: a central difference errs by 1e-10 of itself, and an
# error of the map multiplies a derivative, it is not added to it
_STEP = 1e-5


def some_of(terms: Terms, k: slice) -> Terms:
    """Return some of the parameter vectors of terms."""
    parts: dict[str, Any] = {
        field.name: None if (part := getattr(terms, field.name)) is None else part[k]
        for field in dataclasses.fields(terms)
    }
    return Terms(**parts)


def term_changes(reference: Terms, plus: Terms, minus: Terms) -> Array:
    """Return how the coordinates differ between pairs of parameter vectors.

    Parameters
    ----------
    reference : Terms
        Its first vector gives the units of c1 and c1'.
    plus, minus : Terms
        k vectors each.

    Returns
    -------
    ndarray, shape (9, 11 or 13, k)
        Differences along `COORDINATES`, and the sensor's where something of it is unknown.
    """
    count = len(COORDINATES)
    of_sensor = len(SENSOR_COORDINATES) if has_sensor(reference) else 0
    of_drift = 0 if reference.drift is None else len(DRIFT_COORDINATES)
    change = np.zeros((count + of_sensor + of_drift, plus.object.shape[0]))
    if plus.drift is not None and minus.drift is not None:
        change[count + of_sensor :] = (plus.drift - minus.drift).T
    if plus.gain is not None and minus.gain is not None:
        change[count] = np.log(plus.gain / minus.gain)
    if plus.lag is not None and minus.lag is not None:
        change[count + 1] = plus.lag - minus.lag
    root = math.sqrt(float(reference.object[0, 0]))
    change[Value.C0], change[Value.C2] = np.log(plus.object[:, (0, 2)] / minus.object[:, (0, 2)]).T
    change[Value.C1] = (plus.object[:, 1] - minus.object[:, 1]) / root
    if plus.crosstalk is not None and minus.crosstalk is not None:
        change[Value.CROSSTALK_1 : Value.STRENGTH] = (plus.crosstalk - minus.crosstalk).T
    if (
        reference.background is not None
        and plus.background is not None
        and minus.background is not None
    ):
        root = math.sqrt(float(reference.background[0, 2]))
        ratio = plus.background[:, :3] / minus.background[:, :3]
        change[Value.STRENGTH : Value.SHADOW_C1] = np.log(ratio).T
        change[Value.SHADOW_C1] = (plus.background[:, 3] - minus.background[:, 3]) / root
    return change


def coordinate_slopes(parameters: Parameters, z: Array) -> tuple[Terms, Array]:
    """Return physical values at z, and the derivatives of the coordinates along z.

    Parameters
    ----------
    z : ndarray, shape (d,)
        Where.

    Returns
    -------
    (Terms, ndarray)
        Of one vector; shape (9, 11 or 13, d), along `COORDINATES` and the sensor's.
    """
    d = z.size
    steps = _STEP * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
    terms = parameters.terms(z + steps)
    centre = some_of(terms, slice(0, 1))
    plus, minus = some_of(terms, slice(1, d + 1)), some_of(terms, slice(d + 1, None))
    return centre, term_changes(centre, plus, minus) / (2 * _STEP)
