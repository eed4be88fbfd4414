"""Data sets that several tests share, and a slow reference fit."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from inference.estimate import estimate
from inference.estimates import TechniqueResult
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import mean_readings, simulate
from simulator.trajectories import SampledTrajectory

Array = NDArray[np.float64]

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}  # a diffuse plate of 0.4 m
SIGNAL_AT_1M = 7.72e-3
KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}
VAGUE: dict[str, Any] = {"prior": "normal", "mean": 0.0, "sd": 0.05}
WALL: dict[str, Any] = {"strength": 0.0177, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}
THESIS = {"c0": 0.1, "c1": 10.0, "c2": 0.1}


def sensor_of(kind: str = "pulsed", snr: float = 1000.0, **noise: float) -> Sensor:
    """Return a sensor whose read noise is the plate's signal at 1 m over ``snr``."""
    read = SIGNAL_AT_1M / snr
    return parse_sensor({**KINDS[kind], "noise": {"read": [read, read], **noise}})


def path(frames: int, empty: int = 0, span: tuple[float, float] = (0.2, 2.0)) -> SampledTrajectory:
    """Return ranges at even distances, empty scenes last."""
    ranges = np.linspace(*span, frames).tolist() + [span[1]] * empty
    return SampledTrajectory(range_m=ranges, object_present=[True] * frames + [False] * empty)


def exact_scene(document: dict[str, Any]) -> Scene:
    """Parse a scene whose model is exact where it says nothing else."""
    return parse_scene({"discrepancy": 0, **document})


def data(
    sensor: Sensor, truth: dict[str, Any], trajectory: SampledTrajectory, seed: int = 1
) -> Frames:
    """Simulate a scene in which everything is known."""
    return simulate(sensor, parse_scene(truth), trajectory, seed).frames


def values_of(sensor: Sensor, truth: dict[str, Any]) -> dict[str, float]:
    """Return the known numbers of a scene by their path."""
    return parameters_of(sensor, parse_scene(truth)).known


def reference_fit(
    sensor: Sensor, scene: Scene, frames: Frames, start: dict[str, float], ranges: Array
) -> tuple[dict[str, float], Array, float]:
    """Fit all unknowns and all ranges by scipy, from a start near the truth: slow and obvious.

    Returns
    -------
    (dict, ndarray, float)
        Unknowns by path, ranges, chi-square; for noise that does not depend on the mean.
    """
    parameters = parameters_of(sensor, scene)
    signs = np.array([1.0 if start[name] >= 0 else -1.0 for name in parameters.names])
    sizes = np.array([abs(start[name]) or 1e-3 for name in parameters.names])
    read = np.asarray(sensor.noise.read)
    present = frames.present

    def residual(v: Array) -> Array:
        natural = (signs * sizes * v[: sizes.size])[None]
        at = np.full(len(frames), np.inf)
        at[present] = np.exp(v[sizes.size :])
        terms = parameters.terms(parameters.standard(natural))
        means = mean_readings(sensor, terms, at)
        return np.asarray(((frames.readings - means) / read).ravel())

    begin = np.concatenate([np.ones(sizes.size), np.log(ranges[present])])
    found = optimize.least_squares(
        residual, begin, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=500
    )
    values = dict(
        zip(parameters.names, (signs * sizes * found.x[: sizes.size]).tolist(), strict=True)
    )
    return values, np.exp(found.x[sizes.size :]), 2.0 * float(found.cost)


def relative(a: float, b: float) -> float:
    """Return the distance of two positive numbers in the logarithm."""
    return abs(math.log(a / b))


def served(
    sensor: Sensor, scene: dict[str, Any], frames: Frames, names: list[str]
) -> list[TechniqueResult]:
    """Ask for techniques that all answer."""
    found = estimate(sensor, exact_scene(scene), frames, names)
    assert [r.technique for r in found.results] == names, found.left_out
    return list(found.results)
