"""Light sources: radiant intensity against the angle from the aim, normalised to the power.

2 pi int I_e(alpha) sin(alpha) d alpha = Phi0 over the front hemisphere (2.11); no cosine of the
emitter is part of the kernel, it lives in I_e (errata, section 0).
"""

import itertools
import math
from typing import Annotated, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from simulator.compiled import compiled
from simulator.optics.vectors import Position, Unit, Vector
from simulator.validated import Validated

__all__ = [
    "CosinePower",
    "Emitter",
    "Linear",
    "Narrow",
    "Pattern",
    "RaisedCosine",
    "Table",
    "Uniform",
    "intensity",
    "lambertian",
    "pack_pattern",
    "radiant_intensity",
]

Array = NDArray[np.float64]

UNIFORM, COSINE, LINEAR, RAISED, TABLE = 0.0, 1.0, 2.0, 3.0, 4.0


@compiled
def intensity(pattern: Array, at: int, table: Array, cosine: float, sine: float) -> float:
    """Return I_e / Phi0 [1/sr] at an angle given by its cosine and sine.

    Parameters
    ----------
    pattern : ndarray
        Kind, parameter, normalisation, last angle; from `pack_pattern`.
    at : int
        Where in the array they begin.
    table : ndarray, shape (3, n)
        Angles, normalised values and slopes of a measured pattern (Hermite cubics).
    cosine, sine : float
        Of the angle from the aim; the sine is positive. Behind the emitter there is no light.
    """
    if cosine <= 0.0:
        return 0.0
    kind = pattern[at]
    if kind == 0.0:
        return float(pattern[at + 2])
    if kind == 1.0:
        power = pattern[at + 1]
        return float(pattern[at + 2] * (cosine if power == 1.0 else cosine**power))
    angle = math.atan2(sine, cosine)
    if kind == 2.0:
        return float(pattern[at + 2] * math.atan2(cosine, sine))
    if kind == 3.0:
        if angle >= pattern[at + 1]:
            return 0.0
        half = math.cos(0.5 * math.pi * angle / pattern[at + 1])
        return float(pattern[at + 2] * half * half)
    if angle < table[0, 0] or angle > table[0, -1]:
        return 0.0
    i = min(max(np.searchsorted(table[0], angle) - 1, 0), table.shape[1] - 2)
    h = table[0, i + 1] - table[0, i]
    t = (angle - table[0, i]) / h
    u = 1.0 - t
    left = (1.0 + 2.0 * t) * table[1, i] + t * h * table[2, i]
    right = (1.0 + 2.0 * u) * table[1, i + 1] - u * h * table[2, i + 1]
    return float(u * u * left + t * t * right)


class Uniform(Validated):
    """I_e = Phi0 / (2 pi) over the front hemisphere."""

    kind: Literal["uniform"] = "uniform"


class CosinePower(Validated):
    """I_e = Phi0 (N + 1) / (2 pi) cos^N(alpha); N = 1 is a Lambertian source.

    Attributes
    ----------
    exponent : float
        N, not negative.
    """

    kind: Literal["cosine_power"] = "cosine_power"
    exponent: Annotated[float, pydantic.Field(ge=0, le=1e6)]


class Linear(Validated):
    """I_e = Phi0 (pi/2 - alpha) / (pi (pi - 2))."""

    kind: Literal["linear"] = "linear"


class RaisedCosine(Validated):
    """I_e in proportion to (1 + cos(pi alpha / cut_off)) / 2 below the cut-off (App. A, 7).

    Attributes
    ----------
    cut_off_rad : float
        alpha_0, angle of the first zero, between 1e-3 and pi/2.
    """

    kind: Literal["raised_cosine"] = "raised_cosine"
    cut_off_rad: Annotated[float, pydantic.Field(ge=1e-3, le=math.pi / 2)]


class Narrow(Validated):
    """The narrow limit of cos^N, N to infinity: all light along the aim."""

    kind: Literal["narrow"] = "narrow"


class Table(Validated):
    """Measured radiant intensity, interpolated by monotone cubics and normalised.

    Attributes
    ----------
    angle_rad : tuple of float
        At least two rising angles from the aim, in [0, pi/2]; there is no light outside them.
    relative_intensity : tuple of float
        In any unit, one for each angle; not negative, and positive somewhere.
    """

    kind: Literal["table"] = "table"
    angle_rad: Annotated[
        tuple[float, ...], pydantic.Field(min_length=2, max_length=10_000), pydantic.Strict(False)
    ]
    relative_intensity: Annotated[
        tuple[float, ...], pydantic.Field(min_length=2, max_length=10_000), pydantic.Strict(False)
    ]

    @pydantic.field_validator("angle_rad")
    @classmethod
    def _rises(cls, angles: tuple[float, ...]) -> tuple[float, ...]:
        if not all(low < high for low, high in itertools.pairwise(angles)):
            raise ValueError("angles must be sorted and distinct")
        if angles[0] < 0 or angles[-1] > math.pi / 2:
            raise ValueError("angles must lie between 0 and pi/2")
        return angles

    @pydantic.field_validator("relative_intensity")
    @classmethod
    def _positive(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        if min(values) < 0:
            raise ValueError("intensities must not be negative")
        if max(values) <= 0:
            raise ValueError("some intensity must be positive")
        return values

    @pydantic.model_validator(mode="after")
    def _same_length(self) -> "Table":
        if len(self.angle_rad) != len(self.relative_intensity):
            raise ValueError("angle_rad and relative_intensity must have the same length")
        return self


Pattern = Annotated[
    Uniform | CosinePower | Linear | RaisedCosine | Narrow | Table,
    pydantic.Field(discriminator="kind"),
]


def lambertian() -> CosinePower:
    """Return the pattern of a Lambertian source, I_e = Phi0 cos(alpha) / pi."""
    return CosinePower(exponent=1.0)


class Emitter(Validated):
    """A light source.

    Attributes
    ----------
    pattern : Pattern
        Radiant intensity against the angle from the aim.
    position_m : (float, float, float)
        [m].
    aim : (float, float, float)
        Direction of the axis; normalised on the way in.
    power_w : float
        Phi0 [W].
    size_m : (float, float), optional
        Width and height of an extended source, whose points all radiate the pattern (2.17). Left
        out: a point.
    """

    pattern: Pattern = Uniform()
    position_m: Position = (0.0, 0.0, 0.0)
    aim: Unit = (0.0, 0.0, 1.0)
    power_w: Annotated[float, pydantic.Field(gt=0)] = 1.0
    size_m: (
        Annotated[
            tuple[Annotated[float, pydantic.Field(gt=0)], Annotated[float, pydantic.Field(gt=0)]],
            pydantic.Strict(False),
        ]
        | None
    ) = None


def _raised_cosine_norm(cut_off: float) -> float:
    """Return 2 pi int (1 + cos(pi a / a0)) / 2 sin(a) da from 0 to a0."""
    b = math.pi / cut_off  # at least 2
    # int cos(b a) sin(a) da from 0 to pi/b
    cosine = -(1.0 + math.cos(cut_off)) / (b * b - 1.0)
    half = math.sin(0.5 * cut_off)
    return math.pi * (2.0 * half * half + cosine)


def pack_pattern(pattern: Pattern) -> tuple[Array, Array]:
    """Return (pattern, table) for `intensity`.

    Raises
    ------
    ValueError
        For `Narrow`, which is a single ray and has no intensity.
    """
    empty = np.zeros((3, 2))
    if isinstance(pattern, Uniform):
        return np.array([UNIFORM, 0.0, 0.5 / math.pi, math.pi / 2]), empty
    if isinstance(pattern, CosinePower):
        n = pattern.exponent
        return np.array([COSINE, n, (n + 1.0) / (2 * math.pi), math.pi / 2]), empty
    if isinstance(pattern, Linear):
        return np.array([LINEAR, 0.0, 1.0 / (math.pi * (math.pi - 2.0)), math.pi / 2]), empty
    if isinstance(pattern, RaisedCosine):
        cut = pattern.cut_off_rad
        return np.array([RAISED, cut, 1.0 / _raised_cosine_norm(cut), cut]), empty
    if isinstance(pattern, Table):
        angle = np.array(pattern.angle_rad)
        value = np.array(pattern.relative_intensity)
        slope = PchipInterpolator(angle, value)(angle, 1) if angle.size > 2 else None
        if slope is None:
            slope = np.full(2, (value[1] - value[0]) / (angle[1] - angle[0]))
        table = np.vstack([angle, value / np.max(value), slope / np.max(value)])
        # cubic times sine on each interval: 12 Gauss points are exact to rounding
        x, w = np.polynomial.legendre.leggauss(12)
        raw = np.array([TABLE, 0.0, 1.0, angle[-1]])
        total = 0.0
        for low, high in itertools.pairwise(angle):
            nodes = 0.5 * (high - low) * x + 0.5 * (high + low)
            values = [intensity(raw, 0, table, math.cos(a), math.sin(a)) for a in nodes]
            total += math.pi * (high - low) * float(np.sum(w * np.sin(nodes) * values))
        table[1:] /= total
        return raw, table
    raise ValueError("a narrow beam has no radiant intensity")


def radiant_intensity(pattern: Pattern, angle_rad: Vector | Array | float) -> Array:
    """Return I_e / Phi0 [1/sr] at angles from the aim [rad].

    Raises
    ------
    ValueError
        For `Narrow`, whose intensity is a delta function.
    """
    packed, table = pack_pattern(pattern)
    angle = np.asarray(angle_rad, dtype=np.float64)
    values = [intensity(packed, 0, table, math.cos(a), math.sin(a)) for a in angle.ravel()]
    return np.array(values).reshape(angle.shape)
