"""Readings, derivatives and noise against the simulator and against 50 digits."""

import math
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from inference.frame.sensitivity import sensitivity, whiteners
from inference.identifiability.experiment import Experiment
from simulator.parameters import parameters_of
from simulator.readings import covariance
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, Sensor, parse_sensor
from simulator.simulate import mean_readings
from tests.identifiability.precise import DIGITS, precise_readings

Array = NDArray[np.float64]

SENSORS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 2e7, "phase_offset_rad": 0.3},
}
EPS = float(np.finfo(float).eps)
ANY = {"prior": "lognormal", "median": 1.0, "sigma": 3.0}
LINE = {"prior": "normal", "mean": 0.0, "sd": 1.0}


def sensor_of(kind: str, **noise: float) -> Sensor:
    return parse_sensor({**SENSORS[kind], "noise": {"read": [2e-4, 1e-4], **noise}})


@st.composite
def cases(draw: st.DrawFn) -> tuple[Sensor, dict[str, float], Array]:
    """A sensor, values of everything by scene path, and log ranges."""

    def log(low: float, high: float) -> float:
        return math.exp(draw(st.floats(math.log(low), math.log(high))))

    sensor = sensor_of(draw(st.sampled_from(sorted(SENSORS))))
    values = {}
    for path in ("object", "background.shadow"):
        values[f"{path}.c0"] = log(1e-3, 10.0)
        # the quadratic's least value is 1 - ratio^2 / 4 of c0
        values[f"{path}.c1"] = draw(st.floats(-1.9, 5.0)) * math.sqrt(values[f"{path}.c0"])
    values |= {"object.c2": log(1e-3, 1.0), "background.strength": log(1e-4, 10.0)}
    values["background.distance_m"] = log(0.5, 14.0)
    for column in sensor.columns:
        values[f"crosstalk.{column}"] = draw(st.floats(-1.0, 1.0))
    n = draw(st.integers(1, 5))
    log_r = np.log([log(0.03, 14.0) for _ in range(n)])
    log_r[0] = np.nan if draw(st.booleans()) else log_r[0]
    return sensor, values, log_r


def experiment_of(sensor: Sensor, values: dict[str, float], log_r: Array) -> Experiment:
    scene = parse_scene(
        {
            "object": {"c0": ANY, "c1": LINE, "c2": ANY},
            "crosstalk": [LINE, LINE],
            "background": {"strength": ANY, "distance_m": ANY, "shadow": {"c0": ANY, "c1": LINE}},
        }
    )
    parameters = parameters_of(sensor, scene)
    point = np.array([[values[name] for name in parameters.names]])
    return Experiment(sensor, parameters, parameters.standard(point)[0], log_r)


@settings(max_examples=60, deadline=None)
@given(case=cases())
def test_derivatives_against_fifty_digits(case: tuple[Sensor, dict[str, float], Array]) -> None:
    """Every entry to a few roundings of the largest term in it: nothing cancels beyond that."""
    sensor, values, log_r = case
    experiment = experiment_of(sensor, values, log_r)
    of = experiment.readings
    # the values that the experiment has, after their way through z
    terms = experiment.terms
    exact = dict(zip(("object.c0", "object.c1", "object.c2"), terms.object[0], strict=True))
    assert terms.crosstalk is not None
    assert terms.background is not None
    exact |= dict(zip((f"crosstalk.{c}" for c in sensor.columns), terms.crosstalk[0], strict=True))
    places = ("strength", "distance_m", "shadow.c0", "shadow.c1")
    exact |= {f"background.{n}": v for n, v in zip(places, terms.background[0], strict=True)}
    order = [*list(exact)[:3], *(f"crosstalk.{c}" for c in sensor.columns), *list(exact)[5:]]
    with mp.workdps(DIGITS):
        step = mp.mpf("1e-20")
        base = {name: mp.mpf(float(value)) for name, value in exact.items()}
        for i, u in enumerate(log_r):
            r = None if np.isnan(u) else mp.exp(mp.mpf(float(u)))
            here = precise_readings(sensor, base, r)
            phase = 1.0
            if not isinstance(sensor, PulsedSensor):
                # a phase of k r radians loses as many units in its last place
                phase += sensor.wave_number * max(math.exp(u) if r else 0, exact[order[6]])
            light = max(float(abs(x)) for x in here) + float(np.abs(of.signal[i]).max())
            light += exact["background.strength"]
            for k in range(2):
                assert abs(of.mean[i, k] - float(here[k])) <= 50 * EPS * phase * light
            for j, name in enumerate(order):
                moved = dict(base)
                if name.endswith(".c1"):
                    moved[name] += step * mp.sqrt(base[name.replace(".c1", ".c0")])
                elif name.startswith("crosstalk"):
                    moved[name] += step
                else:
                    moved[name] *= mp.exp(step)
                there = precise_readings(sensor, moved, r)
                for k in range(2):
                    slope = float((there[k] - here[k]) / step)
                    assert abs(of.by_term[i, k, j] - slope) <= 100 * EPS * phase * (
                        abs(slope) + light
                    )
            if r is not None:
                there = precise_readings(sensor, base, r * mp.exp(step))
                for k in range(2):
                    slope = float((there[k] - here[k]) / step)
                    scale = phase * (abs(slope) + 4 * light)
                    assert abs(of.by_range[i, k] - slope) <= 100 * EPS * phase * scale


@pytest.mark.parametrize("kind", sorted(SENSORS))
def test_readings_and_noise_are_the_simulators(kind: str) -> None:
    sensor = sensor_of(kind, shot=1e-5, relative=0.02)
    values = {
        "object.c0": 0.08,
        "object.c1": -0.1,
        "object.c2": 0.1,
        "background.strength": 0.03,
        "background.distance_m": 3.0,
        "background.shadow.c0": 0.05,
        "background.shadow.c1": 0.01,
        **{f"crosstalk.{column}": 0.01 * k for k, column in enumerate(sensor.columns)},
    }
    log_r = np.append(np.log(np.geomspace(0.1, 12.0, 30)), np.nan)
    experiment = experiment_of(sensor, values, log_r)
    of = experiment.readings
    wanted = mean_readings(sensor, experiment.terms, np.exp(log_r))
    assert of.mean == pytest.approx(wanted, rel=1e-13)
    whitener = whiteners(sensor, of)
    noise = sensor.noise
    for i in range(log_r.size):
        first, second = float(of.mean[i, 0]), float(of.mean[i, 1])
        signal = (float(of.signal[i, 0]), float(of.signal[i, 1]))
        v1, v2, v12 = covariance(
            noise.read, noise.shot, noise.relative, kind == "pulsed", (first, second), signal
        )
        unity = whitener[i] @ np.array([[v1, v12], [v12, v2]]) @ whitener[i].T
        # the rounding of v1 v2 - v12^2, which the whitener itself avoids
        condition = v1 * v2 / (v1 * v2 - v12**2)
        assert unity == pytest.approx(np.eye(2), abs=20 * EPS * condition)


def test_gain_of_a_frame_scales_object_and_background_alone() -> None:
    sensor = sensor_of("pulsed")
    values = {
        "object.c0": 0.08,
        "object.c1": -0.1,
        "object.c2": 0.1,
        "background.strength": 0.03,
        "background.distance_m": 3.0,
        "background.shadow.c0": 0.05,
        "background.shadow.c1": 0.01,
        "crosstalk.w1": 0.01,
        "crosstalk.w2": 0.02,
    }
    experiment = experiment_of(sensor, values, np.log([0.5, 1.0]))
    once = experiment.readings
    twice = sensitivity(sensor, experiment.terms, experiment.log_r, np.full(2, 2.0))
    crosstalk = np.array([0.01, 0.02])
    assert twice.mean - crosstalk == pytest.approx(2 * (once.mean - crosstalk), rel=1e-12)
    assert twice.by_range == pytest.approx(2 * once.by_range, rel=1e-12)
    kept = [3, 4]
    assert twice.by_term[:, :, kept] == pytest.approx(once.by_term[:, :, kept])
    others = [0, 1, 2, 5, 6, 7, 8]
    assert twice.by_term[:, :, others] == pytest.approx(2 * once.by_term[:, :, others], rel=1e-12)
