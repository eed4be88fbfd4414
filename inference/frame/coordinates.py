"""Coordinates without units of all that a frame's readings depend on, and how they move with z."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.sensitivity import Value
from simulator.parameters import Parameters, Terms

__all__ = ["COORDINATES", "coordinate_slopes", "some_of", "term_changes"]

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
that the scene lacks has columns of zeros.
"""

# the maps from z are smooth and of unit scale: a central difference errs by 1e-10 of itself, and an
# error of the map multiplies a derivative, it is not added to it
_STEP = 1e-5


def some_of(terms: Terms, k: slice) -> Terms:
    """Return some of the parameter vectors of terms."""
    crosstalk = None if terms.crosstalk is None else terms.crosstalk[k]
    background = None if terms.background is None else terms.background[k]
    offset = None if terms.offset is None else terms.offset[k]
    return Terms(terms.object[k], crosstalk, background, terms.ranges[k], offset)


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
    ndarray, shape (9, k)
        Differences along `COORDINATES`.
    """
    change = np.zeros((len(COORDINATES), plus.object.shape[0]))
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
    parameters : Parameters
        The unknowns.
    z : ndarray, shape (d,)
        Where.

    Returns
    -------
    (Terms, ndarray)
        Of one vector; shape (9, d), along `COORDINATES`.
    """
    d = z.size
    steps = _STEP * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
    terms = parameters.terms(z + steps)
    centre = some_of(terms, slice(0, 1))
    plus, minus = some_of(terms, slice(1, d + 1)), some_of(terms, slice(d + 1, None))
    return centre, term_changes(centre, plus, minus) / (2 * _STEP)
