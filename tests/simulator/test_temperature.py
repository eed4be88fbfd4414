"""Sensors that follow their temperature: what they read, and what cannot be their temperature."""

from typing import Any

import numpy as np
import pytest

from simulator.at_temperature import at_reference
from simulator.errors import InvalidInputError
from simulator.frames import Frames, frames_from_columns
from simulator.optics.assembly import OpticalScene, read
from simulator.optics.electronics import Electronics
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory, SampledTrajectory
from tests.optics.test_assembly import DISK, PULSE, SINE

TINY = {"read": [1e-30, 1e-30]}
DRIFTS = {"gain_drift_per_k": -1e-3, "delay_drift_s_per_k": 1e-11}
CROSSTALK = (0.01, 0.02)
SENSORS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": TINY},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6, "noise": TINY},
}


@pytest.mark.parametrize("optical", [PULSE, SINE], ids=["pulsed", "sine_wave"])
def test_the_optical_simulators_drift_is_taken_off(optical: Sensor) -> None:
    """Of the same coefficients by the same names; rounding alone lies between."""
    scene = OpticalScene(
        surfaces=(DISK,), electronics=Electronics.model_validate({"crosstalk": CROSSTALK} | DRIFTS)
    )
    sensor = optical.model_copy(
        update={
            "temperature": parse_sensor(SENSORS["pulsed"] | {"temperature": DRIFTS}).temperature
        }
    )
    kelvin = np.array([263.15, 298.15, 333.15])
    warm = Frames(
        np.array([read(scene, optical, temperature_k=each).values for each in kelvin.tolist()]),
        temperature_k=kelvin,
    )
    plain, frames = at_reference(sensor, warm, CROSSTALK)
    assert plain == optical
    assert frames.temperature_k is None
    assert frames.gain == pytest.approx(1.0 - 1e-3 * (kelvin - 298.15))
    assert frames.gain is not None
    light = (frames.readings - CROSSTALK) / frames.gain[:, None]
    cold = np.array(read(scene, optical).values) - CROSSTALK
    assert light == pytest.approx(np.broadcast_to(cold, (3, 2)), rel=1e-9)


@pytest.mark.parametrize("kind", sorted(SENSORS))
def test_simulated_frames_are_those_of_the_reference_once_it_is_taken_off(kind: str) -> None:
    wall = {"strength": 0.02, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}
    of = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}, "background": wall}
    scene = parse_scene(of | {"crosstalk": list(CROSSTALK)})
    warm = parse_sensor(SENSORS[kind] | {"temperature": DRIFTS})
    ranges, kelvin = [0.2, 0.7, 1.5], [280.0, 300.0, 330.0]
    path = SampledTrajectory(range_m=ranges, temperature_k=kelvin)
    frames = at_reference(warm, simulate(warm, scene, path, 1).frames, CROSSTALK)[1]
    cold = simulate(parse_sensor(SENSORS[kind]), scene, SampledTrajectory(range_m=ranges), 1).frames
    assert frames.gain is not None
    light = (frames.readings - CROSSTALK) / frames.gain[:, None]
    assert light == pytest.approx(cold.readings - CROSSTALK, rel=1e-12)


def test_saturated_frames_stay_as_they_are() -> None:
    sensor = parse_sensor(SENSORS["pulsed"] | {"temperature": DRIFTS, "full_scale": [1.0, 1.0]})
    frames = Frames(np.array([[0.2, 1.0], [0.2, 0.5]]), temperature_k=np.array([330.0, 330.0]))
    found = at_reference(sensor, frames)[1].readings
    assert found[0].tolist() == [0.2, 1.0]
    assert found[1, 0] < 0.2


def test_a_sensor_without_coefficients_knows_no_temperature() -> None:
    sensor = parse_sensor(SENSORS["pulsed"])
    frames = Frames(np.ones((2, 2)), temperature_k=np.array([-1.0, np.nan]))
    assert at_reference(sensor, frames)[1] is frames
    assert at_reference(sensor, frames)[0] is sensor


WARM = SENSORS["pulsed"] | {"temperature": DRIFTS}


@pytest.mark.parametrize(
    ("column", "words"),
    [
        (None, "is missing"),
        ([300.0, 0.0], "entry 1 is 0"),
        ([300.0, -5.0], "entry 1 is -5, and must be 100 or more, in kelvin"),
        ([25.0, 30.0], "entry 0 is 25, and must be 100 or more, in kelvin: 25 degrees Celsius"),
        ([300.0, 1400.0], "leaves no gain"),
        ([300.0], "1 entries where w1 has 2"),
        (["a", "b"], "must hold numbers"),
    ],
)
def test_bad_temperatures_are_named(column: Any, words: str) -> None:
    columns = {"w1": [0.1, 0.1], "w2": [1.0, 1.0], "temperature_k": column}
    with pytest.raises(InvalidInputError) as error:
        frames_from_columns(parse_sensor(WARM), columns)
    (problem,) = error.value.problems
    assert problem.pointer == "/temperature_k"
    assert words in problem.message


@pytest.mark.parametrize(
    ("temperature", "pointer"),
    [
        ({}, "/temperature"),
        ({"reference_k": 300.0}, "/temperature"),
        ({"gain_drift_per_k": "x"}, "/temperature/gain_drift_per_k"),
        (DRIFTS | {"reference_k": 0.0}, "/temperature/reference_k"),
        (DRIFTS | {"reference_k": 25.0}, "/temperature/reference_k"),
        (DRIFTS | {"offset": 0.0}, "/temperature/offset"),
        (
            {"gain_drift_per_k": {"prior": "normal", "mean": 0.0}},
            "/temperature/gain_drift_per_k/sd",
        ),
    ],
)
def test_bad_coefficients_are_named(temperature: Any, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as error:
        parse_sensor(SENSORS["pulsed"] | {"temperature": temperature})
    assert [problem.pointer for problem in error.value.problems] == [pointer]


def test_trajectories_name_what_cannot_be_their_temperatures() -> None:
    scene = parse_scene({"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}})
    path = SampledTrajectory(range_m=[0.2, 0.7], temperature_k=[300.0, 1400.0])
    celsius = SampledTrajectory(range_m=[0.2, 0.7], temperature_k=[25.0, 26.0])
    with pytest.raises(InvalidInputError, match=r"/trajectory/temperature_k: .* in kelvin"):
        simulate(parse_sensor(WARM), scene, celsius, 1)
    for sensor, words in ((WARM, "leaves no gain"), (SENSORS["pulsed"], "no coefficients")):
        with pytest.raises(InvalidInputError, match=words) as error:
            simulate(parse_sensor(sensor), scene, path, 1)
        assert error.value.problems[0].pointer == "/trajectory/temperature_k"


@pytest.mark.parametrize(
    ("told", "kelvin"), [([280.0, 330.0], [280.0, 305.0, 330.0]), ([310.0], [310.0] * 3)]
)
def test_a_sensor_warms_evenly_along_a_radial_way(told: list[float], kelvin: list[float]) -> None:
    scene = parse_scene({"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}})
    radial = RadialTrajectory(from_m=0.2, to_m=0.6, frames=3, temperature_k=told)
    listed = SampledTrajectory(
        range_m=radial.ranges().tolist(), time_s=radial.times().tolist(), temperature_k=kelvin
    )
    found, expected = (simulate(parse_sensor(WARM), scene, w, 1).frames for w in (radial, listed))
    assert found.temperature_k is not None
    assert found.temperature_k.tolist() == kelvin
    np.testing.assert_array_equal(found.readings, expected.readings)
    with pytest.raises(InvalidInputError, match="no coefficients") as error:
        simulate(parse_sensor(SENSORS["pulsed"]), scene, radial, 1)
    assert error.value.problems[0].pointer == "/trajectory/temperature_k"
