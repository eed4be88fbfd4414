"""What is calibrated: sensors and scenes, with the priors that simulation and inference share."""

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor

__all__ = ["CELLS", "Cell"]

# w2 of the median object (c0 = 0.08 m^2, c1 = 0, c2 = 0.1) at 1 m
SIGNAL_AT_1M = 7.4e-3

KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}
# c1 keeps its default prior
OBJECT = {
    "c0": {"prior": "lognormal", "median": 0.08, "sigma": 0.7},
    "c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.5},
}
RANGES = {"prior": "loguniform", "low": 0.1, "high": 2.0}
CROSSTALK = [{"prior": "normal", "mean": 0.0, "sd": SIGNAL_AT_1M}] * 2
STRENGTH = {"prior": "lognormal", "median": 0.018, "sigma": 0.5}
DISTANCE = {"prior": "lognormal", "median": 3.0, "sigma": 0.3}
HARDEST = "everything unknown"
# the shadow is left out of every background: it has its default priors
SCENES: dict[str, dict[str, Any]] = {
    "object": {},
    "object, crosstalk": {"crosstalk": CROSSTALK},
    "free shadow": {"background": {"strength": STRENGTH, "distance_m": 3.0}},
    "unknown R": {"background": {"strength": STRENGTH, "distance_m": DISTANCE}},
    HARDEST: {
        "crosstalk": CROSSTALK,
        "background": {"strength": STRENGTH, "distance_m": DISTANCE},
    },
}
EASY = ("object", "object, crosstalk")


@dataclasses.dataclass(frozen=True)
class Cell:
    """One sensor before one scene.

    Attributes
    ----------
    name : str
        Kind of sensor, scene and signal-to-noise ratio.
    kind, scene_name : str
        Keys of the sensor and of the scene.
    snr : float
        Reading of the median object at 1 m over the read noise.
    frames : int
        Frames a data set; their ranges are drawn from the prior of the ranges.
    sets : int
        Data sets that make the cell complete.
    target_ess : int
        Effective draws wanted of every unknown.
    ensembles : int
        Independent ensembles.
    """

    kind: str
    scene_name: str
    snr: float
    frames: int
    sets: int
    target_ess: int
    ensembles: int

    @property
    def name(self) -> str:
        """Name in tables and figures."""
        return f"{self.kind}, {self.scene_name}, SNR {self.snr:g}"

    @property
    def slug(self) -> str:
        """Name of its file."""
        return self.name.lower().replace(", ", "-").replace(" ", "-")

    @property
    def ranked_frames(self) -> tuple[int, ...]:
        """Frames whose ranges are ranked: fixed, since choosing them by their truth would bias."""
        return (0, self.frames // 3, 2 * self.frames // 3)

    @property
    def sensor(self) -> Sensor:
        """The sensor."""
        read = SIGNAL_AT_1M / self.snr
        return parse_sensor({**KINDS[self.kind], "noise": {"read": [read, read]}})

    @functools.cached_property
    def scene(self) -> Scene:
        """The scene, whose unknowns have moderately informative priors.

        Its model is exact, as that of the simulated readings is.
        """
        stated = {"object": OBJECT, "range_m": RANGES, "discrepancy": 0}
        return parse_scene(stated | SCENES[self.scene_name])


def _cells() -> Mapping[str, Cell]:
    cells = []
    for scene in SCENES:
        for kind in KINDS:
            if scene in EASY:
                cells += [Cell(kind, scene, snr, 20, 200, 150, 2) for snr in (10.0, 1000.0)]
            elif scene == HARDEST:
                # a hundred effective draws came so soon there that tails were not yet drawn: a true
                # quantile of 0.93 ranked 99 of 99
                cells.append(Cell(kind, scene, 1000.0, 12, 50, 400, 4))
            else:
                cells.append(Cell(kind, scene, 1000.0, 12, 50, 100, 4))
    return {cell.slug: cell for cell in cells}


CELLS = _cells()
