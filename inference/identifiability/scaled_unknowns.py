"""The unknowns of an experiment in units in which they have no dimension."""

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.coordinates import COORDINATES, SENSOR_COORDINATES, has_sensor
from inference.frame.sensitivity import Value
from simulator.at_temperature import lag_rate
from simulator.parameters import OFFSET, Parameters, Terms
from simulator.sensor import Sensor, SineWaveSensor, shift_of
from simulator.sensor_unknowns import DRIFTS, GAIN, PHASE, TIMING, lag_path

__all__ = ["ScaledUnknowns"]

Array = NDArray[np.float64]

_LAG = len(COORDINATES) + SENSOR_COORDINATES.index("sensor.lag")
_TYPICAL_K = 10.0  # kelvin that a sensor warms up by: what coefficients are measured by


@dataclasses.dataclass(frozen=True, eq=False)
class ScaledUnknowns:
    """Unknowns of a scene at given values, measured by the scene itself.

    Attributes
    ----------
    parameters : Parameters
        The unknowns of the scene.
    z : ndarray, shape (d,)
        Their values, in the coordinates whose prior is standard normal.
    terms : Terms
        Physical values at z.
    names : tuple of str
        Those that are looked at.
    typical_m : float
        A typical range [m].
    light : ndarray, shape (n, 2), or None
        Moduli of the readings without crosstalk; None where the scene has no crosstalk.
    """

    sensor: Sensor
    parameters: Parameters
    z: Array
    terms: Terms
    names: tuple[str, ...]
    typical_m: float
    light: Array | None

    @functools.cached_property
    def units(self) -> Array:
        """Unit of each coordinate of `COORDINATES` in which it is dimensionless.

        Crosstalk is measured by the light of the scene: the median over the frames of the
        modulus of the readings without it, for both readings of a sine wave the same. The sensor's
        lag is measured by that of a typical range.
        """
        units = np.ones(self._count)
        if has_sensor(self.terms):
            # by how much the light of a typical range would have to be late
            wave = self.sensor.wave_number if isinstance(self.sensor, SineWaveSensor) else 1.0
            units[_LAG] = wave * self.typical_m
        if self.terms.drift is not None:
            gain = _LAG + 1
            units[gain] = 1.0 / _TYPICAL_K
            units[gain + 1] = units[_LAG] / lag_rate(self.sensor) / _TYPICAL_K
        if self.light is not None:
            light = self.light.copy()
            if self.sensor.kind != "pulsed":
                light[:] = np.hypot(*light.T)[:, None]
            typical = np.median(light, axis=0)
            units[Value.CROSSTALK_1 : Value.STRENGTH] = np.where(
                typical > 0, typical, self.sensor.noise.read
            )
        return units

    @functools.cached_property
    def directions(self) -> Array:
        """How the coordinates of `COORDINATES` move with each of ``names``, (9, 11 or 13, d).

        Along log c0, c1 / sqrt(c0), log c2, the crosstalk in `units`, log B, log R, log c0', c1' /
        sqrt(c0'), and the offset of displacements over a typical range, as in the tables of
        Cramer-Rao bounds: c0 moves with c1 / sqrt(c0) held where c1 is unknown.
        """
        columns = dict(zip(self._paths, np.diag(self.units), strict=True))
        columns[OFFSET] = np.zeros(self._count)  # readings do not depend on it
        for path, (c0, c1) in self._shapes.items():
            if f"{path}.c1" in self.names:
                row = COORDINATES.index(f"{path}.c1")
                columns[f"{path}.c0"][row] = 0.5 * c1 / math.sqrt(c0)
        if self.terms.background is not None and self.parameters.shadow_is_object:
            # the shadow has the object's parameters and moves with them
            for name in ("object.c0", "object.c1"):
                columns[name][Value.SHADOW_C0 : len(COORDINATES)] = columns[name][: Value.C2]
        if not self.names:
            return np.empty((self._count, 0))
        return np.stack([columns[name] for name in self.names], axis=1)

    @property
    def _shapes(self) -> dict[str, tuple[float, float]]:
        """c0 and c1 of the object, and of a shadow that is not the object's."""
        c0, c1, _ = self.terms.object[0].tolist()
        shapes = {"object": (c0, c1)}
        if self.terms.background is not None and not self.parameters.shadow_is_object:
            _, _, c0, c1 = self.terms.background[0].tolist()
            shapes["background.shadow"] = (c0, c1)
        return shapes

    @property
    def _paths(self) -> tuple[str, ...]:
        """Scene paths of the coordinates."""
        first, second = self.parameters.crosstalk or ("crosstalk.0", "crosstalk.1")
        before, after = COORDINATES[: Value.CROSSTALK_1], COORDINATES[Value.STRENGTH :]
        of_sensor = (GAIN, lag_path(self.sensor)) if has_sensor(self.terms) else ()
        of_drift = () if self.terms.drift is None else DRIFTS
        return (*before, first, second, *after, *of_sensor, *of_drift)

    @property
    def _count(self) -> int:
        """Number of coordinates."""
        return len(self._paths)

    @functools.cached_property
    def in_si_units(self) -> Array:
        """Derivatives of the unknowns, in SI units, along their coordinates, shape (d, d)."""
        values = dict(
            zip(self.parameters.names, self.parameters.natural(self.z[None])[0], strict=True)
        )
        d = len(self.names)
        result = np.zeros((d, d))
        for j, name in enumerate(self.names):
            if name.endswith(".c1"):
                path = name.removesuffix(".c1")
                c0, c1 = self._shapes[path]
                result[j, j] = math.sqrt(c0)
                if f"{path}.c0" in self.names:
                    result[j, self.names.index(f"{path}.c0")] = 0.5 * c1
            elif name in (self.parameters.crosstalk or ()):
                result[j, j] = self.units[self._paths.index(name)]
            elif name == OFFSET:
                result[j, j] = self.typical_m
            elif name == PHASE:
                result[j, j] = self.units[_LAG]
            elif name == TIMING:
                result[j, j] = self.units[_LAG] / shift_of(1.0)
            elif name in DRIFTS:
                result[j, j] = self.units[self._paths.index(name)]
            else:
                result[j, j] = values[name]
        return result
