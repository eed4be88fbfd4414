"""A measured pattern."""

import itertools
import math
from typing import Annotated, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from simulator.compiled import compiled
from simulator.optics.emitters.form import PatternForm

__all__ = ["TABLE", "Table", "table_intensity"]

Array = NDArray[np.float64]

TABLE = 4.0


@compiled
def table_intensity(table: Array, cosine: float, sine: float) -> float:
    """Return the Hermite cubic between the measured angles, 0 outside them."""
    angle = math.atan2(sine, cosine)
    if angle < table[0, 0] or angle > table[0, -1]:
        return 0.0
    i = min(max(np.searchsorted(table[0], angle) - 1, 0), table.shape[1] - 2)
    h = table[0, i + 1] - table[0, i]
    t = (angle - table[0, i]) / h
    u = 1.0 - t
    left = (1.0 + 2.0 * t) * table[1, i] + t * h * table[2, i]
    right = (1.0 + 2.0 * u) * table[1, i + 1] - u * h * table[2, i + 1]
    return float(u * u * left + t * t * right)


class Table(PatternForm):
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

    def pack(self) -> tuple[Array, Array]:
        """Pack, normalised by quadrature."""
        angle = np.array(self.angle_rad)
        value = np.array(self.relative_intensity)
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
            values = [table_intensity(table, math.cos(a), math.sin(a)) for a in nodes]
            total += math.pi * (high - low) * float(np.sum(w * np.sin(nodes) * values))
        table[1:] /= total
        return raw, table
