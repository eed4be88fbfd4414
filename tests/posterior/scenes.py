"""Small data sets that several tests share."""

from typing import Any

from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import Simulation, simulate
from simulator.trajectories import RadialTrajectory

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}  # a diffuse plate of 0.4 m
SIGNAL_AT_1M = 7.72e-3
UNKNOWN_CROSSTALK = [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2

KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}


def sensor_of(kind: str, snr: float = 1000.0, **noise: float) -> Sensor:
    """Return a sensor whose read noise is the signal at 1 m over ``snr``."""
    read = SIGNAL_AT_1M / snr
    return parse_sensor({**KINDS[kind], "noise": {"read": [read, read], **noise}})


def data(
    sensor: Sensor,
    scene: dict[str, Any] | None = None,
    frames: int = 20,
    seed: int = 1,
    span: tuple[float, float] = (0.1, 2.0),
) -> Simulation:
    """Simulate the plate on its way from the near to the far end of a span."""
    path = RadialTrajectory(from_m=span[0], to_m=span[1], frames=frames, spacing="log")
    return simulate(sensor, parse_scene({"object": OBJECT, **(scene or {})}), path, seed)


def example(kind: str, crosstalk: bool, frames: int = 20) -> tuple[Sensor, Scene, Frames]:
    """Return a sensor, a scene in which the object is unknown, and frames."""
    sensor = sensor_of(kind)
    truth = {"crosstalk": [0.002, 0.01]} if crosstalk else {}
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK} if crosstalk else {})
    return sensor, scene, data(sensor, truth, frames).frames
