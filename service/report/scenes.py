"""The four scenes of the report, each with what it states as known."""

import dataclasses
from typing import Any

from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.trajectories import RadialTrajectory

__all__ = ["SCENES", "ReportScene"]

Body = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class ReportScene:
    """A scene, how it moves, and what is known of it.

    Attributes
    ----------
    name : str
        For the table.
    sensor : Sensor
        The sensor.
    truth : Scene
        From which frames are simulated: all numbers.
    known : Scene
        What techniques are told; crosstalk, where there is any, is not known.
    free : Scene
        What the posterior is told: of the object nothing.
    to_m : float
        Largest range [m]; the smallest is 0.2 m.
    """

    name: str
    sensor: Sensor
    truth: Scene
    known: Scene
    free: Scene
    to_m: float = 2.0

    def trajectory(self, frames: int) -> RadialTrajectory:
        """Return a trajectory of so many frames, evenly in log range."""
        return RadialTrajectory(from_m=0.2, to_m=self.to_m, frames=frames, spacing="log")


_PLATE: Body = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
_BACKGROUND: Body = {
    "strength": 0.0176838825658,
    "distance_m": 3.0,
    "shadow": {"c0": 0.056137, "c1": -0.02829},
}
_PULSED = parse_sensor(
    {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-4], "relative": 1e-3}}
)
_SINE = parse_sensor(
    {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [3e-5, 3e-5], "relative": 1e-3}}
)
_UNKNOWN = {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 1.0}] * 2}


def _scene(name: str, sensor: Sensor, truth: Body, known: Body, free: Body) -> ReportScene:
    plate = {"object": _PLATE}
    return ReportScene(
        name,
        sensor,
        parse_scene(plate | truth),
        parse_scene(plate | known),
        parse_scene(free),
        1.2 if "background" in truth else 2.0,
    )


SCENES: tuple[ReportScene, ...] = (
    _scene("object", _PULSED, {}, {}, {}),
    _scene("crosstalk", _PULSED, {"crosstalk": [0.004, 0.4]}, _UNKNOWN, _UNKNOWN),
    _scene(
        "background",
        _PULSED,
        {"background": _BACKGROUND},
        {"background": _BACKGROUND},
        {"background": _BACKGROUND},
    ),
    _scene(
        "crosstalk and background, sine wave",
        _SINE,
        {"crosstalk": [0.4, 0.004], "background": _BACKGROUND},
        _UNKNOWN | {"background": _BACKGROUND},
        _UNKNOWN | {"background": _BACKGROUND},
    ),
)
