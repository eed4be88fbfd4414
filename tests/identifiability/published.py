"""The systems whose Cramer-Rao bounds are published: ambiguity and identifiability, part 2.

Every bound is linear in the noise; published figures are for a signal-to-noise ratio of one.
"""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from inference.identifiability.elimination import eliminate
from inference.identifiability.experiment import Experiment
from inference.identifiability.information import Information
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

C0, C1, C2 = 0.0769, -0.123, 0.0957
SIGNAL_AT_1M = C0 * C2 / (1 + C1 + C0)
CROSSTALK = ("crosstalk.w1", "crosstalk.w2")
OBJECT = ("object.c0", "object.c1", "object.c2")
BARE = ("background.strength", "background.distance_m")
SHADOW = ("background.shadow.c0", "background.shadow.c1")
SENSOR = parse_sensor(
    {"kind": "pulsed", "pulse_width_s": 30 / speed_of_light, "noise": {"read": [1.0, 1.0]}}
)


def truth(distance: float | None, crosstalk: bool) -> dict[str, float]:
    """Values of everything, by scene path."""
    values = dict(zip(OBJECT, (C0, C1, C2), strict=True))
    if distance is not None:
        values |= {BARE[0]: 1 / (2 * math.pi * distance**2), BARE[1]: distance}
        values |= {SHADOW[0]: 0.73 * C0, SHADOW[1]: 0.23 * C1}
    if crosstalk:
        values |= {CROSSTALK[0]: 0.2 * SIGNAL_AT_1M, CROSSTALK[1]: SIGNAL_AT_1M}
    return values


def scene_of(values: dict[str, float], unknown: tuple[str, ...], shared: bool) -> dict[str, Any]:
    """Return a scene in which some of the values are unknown."""

    def quantity(name: str) -> Any:
        if name not in unknown:
            return values[name]
        if name.endswith(".c1") or name in CROSSTALK:
            return {"prior": "normal", "mean": values[name], "sd": 1.0}
        return {"prior": "lognormal", "median": values[name], "sigma": 1.0}

    scene: dict[str, Any] = {"object": {n.split(".")[1]: quantity(n) for n in OBJECT}}
    if CROSSTALK[0] in values:
        scene["crosstalk"] = [quantity(name) for name in CROSSTALK]
    if BARE[0] in values:
        shadow: Any = "object" if shared else {n.split(".")[2]: quantity(n) for n in SHADOW}
        scene["background"] = {n.split(".")[1]: quantity(n) for n in BARE} | {"shadow": shadow}
    return scene


@dataclasses.dataclass(frozen=True, eq=False)
class System:
    """Frames evenly spaced in range, the last ones without an object."""

    unknown: tuple[str, ...]
    distance: float | None = None
    noise: str = "P"
    crosstalk: bool = False
    frames: int = 40
    gone: int = 0
    shared: bool = False
    span: tuple[float, float] = (0.2, 2.0)

    @property
    def log_r(self) -> Array:
        if self.frames == 1:
            return np.zeros(1)
        ranges = np.linspace(*self.span, self.frames - self.gone)
        return np.concatenate([np.log(ranges), np.full(self.gone, np.nan)])

    @property
    def values(self) -> dict[str, float]:
        return truth(self.distance, self.crosstalk)

    def experiment(self, log_r: Array | None = None) -> Experiment:
        parameters = parameters_of(
            SENSOR, parse_scene(scene_of(self.values, self.unknown, self.shared))
        )
        point = np.array([[self.values[name] for name in parameters.names]])
        where = self.log_r if log_r is None else log_r
        return Experiment(SENSOR, parameters, parameters.standard(point)[0], where)

    def sds(self) -> Array:
        """Noise of every reading at a signal-to-noise ratio of one, shape (n, 2).

        P: proportional to the reading. A: that of w2 at the geometric mean of the ranges.
        """
        if self.noise == "P":
            return np.abs(self.experiment().readings.mean)
        middle = self.experiment(np.array([np.nanmean(self.log_r)]))
        return np.full((self.frames, 2), middle.readings.mean[0, 1])

    def information(self) -> Information:
        whitener = np.einsum("ni,ij->nij", 1 / self.sds(), np.eye(2))
        experiment = self.experiment()
        return eliminate(experiment.names, *experiment.whitened(whitener))


def range_bounds(of: Information) -> tuple[float, float, float]:
    """Best, median (the upper of two) and worst bound of log r."""
    sd = np.sort(of.range_sd[np.isfinite(of.range_sd)])
    return float(sd[0]), float(sd[sd.size // 2]), float(sd[-1])


def is_printed(value: float, printed: float) -> bool:
    """Whether a value rounds to two printed digits (or to the one that is left of a zero)."""
    unit = 10.0 ** (math.floor(math.log10(printed)) - 1)
    return abs(value - printed) <= 0.5001 * unit
