"""The registry of emitter patterns, and the one place that tells them apart by code."""

import math
from typing import Annotated, get_args

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.emitters.cosine_power import COSINE, CosinePower, cosine_intensity
from simulator.optics.emitters.form import PatternForm
from simulator.optics.emitters.linear import LINEAR, Linear, linear_intensity
from simulator.optics.emitters.narrow import Narrow
from simulator.optics.emitters.raised_cosine import RAISED, RaisedCosine, raised_cosine_intensity
from simulator.optics.emitters.table import TABLE, Table, table_intensity
from simulator.optics.emitters.uniform import UNIFORM, Uniform, uniform_intensity
from simulator.optics.vectors import Vector

__all__ = ["PATTERNS", "Pattern", "intensity", "radiant_intensity"]

Array = NDArray[np.float64]

Pattern = Annotated[
    Uniform | CosinePower | Linear | RaisedCosine | Narrow | Table,
    pydantic.Field(discriminator="kind"),
]

PATTERNS: tuple[type[PatternForm], ...] = get_args(get_args(Pattern)[0])


@compiled
def intensity(pattern: Array, at: int, table: Array, cosine: float, sine: float) -> float:
    """Return I_e / Phi0 [1/sr] at an angle given by its cosine and sine.

    Parameters
    ----------
    pattern : ndarray
        Code, parameter, normalisation, last angle; from `PatternForm.pack`.
    at : int
        Where in the array they begin.
    table : ndarray, shape (3, n)
        Angles, normalised values and slopes of a measured pattern (Hermite cubics).
    cosine, sine : float
        Of the angle from the aim; the sine is positive. Behind the emitter there is no light.
    """
    if cosine <= 0.0:
        return 0.0
    code, parameter, norm = float(pattern[at]), float(pattern[at + 1]), float(pattern[at + 2])
    if code == UNIFORM:
        return uniform_intensity(norm)
    if code == COSINE:
        return cosine_intensity(norm, parameter, cosine)
    if code == LINEAR:
        return linear_intensity(norm, cosine, sine)
    if code == RAISED:
        return raised_cosine_intensity(norm, parameter, cosine, sine)
    if code == TABLE:
        return table_intensity(table, cosine, sine)
    return math.nan


def radiant_intensity(pattern: Pattern, angle_rad: Vector | Array | float) -> Array:
    """Return I_e / Phi0 [1/sr] at angles from the aim [rad].

    Raises
    ------
    ValueError
        For `Narrow`, whose intensity is a delta function.
    """
    packed, table = pattern.pack()
    angle = np.asarray(angle_rad, dtype=np.float64)
    values = [intensity(packed, 0, table, math.cos(a), math.sin(a)) for a in angle.ravel()]
    return np.array(values).reshape(angle.shape)
