"""The collapsed density: what each frame and each term of a scene contributes."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.frame_integrals import fill_log_likelihoods
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, Sensor, SineWaveSensor, parse_sensor
from simulator.uncompiled import kind_of
from tests.posterior.scenes import KINDS, OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

NOTHING = np.empty((1, 0))
BACKGROUND: dict[str, Any] = {
    "strength": 0.03,
    "distance_m": 3.0,
    "shadow": {"c0": 0.056, "c1": 0.013},
}
KNOWN: dict[str, Any] = {"object": OBJECT, "crosstalk": [0.002, 0.01], "background": BACKGROUND}
FREE: dict[str, Any] = {
    "crosstalk": UNKNOWN_CROSSTALK,
    "background": {
        "strength": {"prior": "lognormal", "median": 0.03, "sigma": 0.5},
        "distance_m": {"prior": "uniform", "low": 2.0, "high": 10.0},
    },
}


def of(sensor: Sensor, scene: dict[str, Any], frames: Frames) -> CollapsedDensity:
    return collapsed_density(sensor, parse_scene(scene), frames)


@pytest.fixture(params=list(KINDS))
def sensor(request: pytest.FixtureRequest) -> Sensor:
    return sensor_of(request.param, 1000.0)


def bare_background(sensor: Sensor) -> NDArray[np.float64]:
    strength, distance = BACKGROUND["strength"], BACKGROUND["distance_m"]
    if isinstance(sensor, PulsedSensor):
        return np.array([strength * distance / sensor.r0, strength])
    assert isinstance(sensor, SineWaveSensor)
    angle = sensor.wave_number * distance + sensor.known_phase_rad
    return np.array([strength * math.cos(angle), strength * math.sin(angle)])


@pytest.mark.parametrize("kind", list(KINDS))
def test_an_empty_frame_is_background_and_crosstalk_under_their_noise(kind: str) -> None:
    shot = 1e-4
    sensor = sensor_of(kind, 100.0, shot=shot, relative=0.1)
    gain = np.array([1.0, 1.7])
    readings = np.array([[0.004, 0.041], [0.011, 0.06]])
    frames = Frames(readings, gain=gain, object_present=np.zeros(2, dtype=bool))
    found = of(sensor, KNOWN, frames).frame_log_likelihoods(NOTHING)[0]
    for k in range(2):
        mean = np.array(KNOWN["crosstalk"]) + gain[k] * bare_background(sensor)
        cov = np.diag(np.array(sensor.noise.read) ** 2 + shot * np.abs(mean))
        if kind == "pulsed":
            cov[0, 1] = cov[1, 0] = shot * abs(mean[0])
        wanted = stats.multivariate_normal.logpdf(readings[k], mean, cov)
        assert found[k] == pytest.approx(wanted, rel=1e-10)


def test_an_empty_frame_says_nothing_of_the_object(sensor: Sensor) -> None:
    frames = Frames(np.array([[0.01, 0.02]]), object_present=np.array([False]))
    density = of(sensor, {}, frames)
    found = density.log_likelihood(np.random.default_rng(0).standard_normal((5, 3)))
    assert np.ptp(found) == 0.0


def test_frames_that_may_all_hold_an_object_need_no_column(sensor: Sensor) -> None:
    frames = data(sensor).frames
    told = Frames(frames.readings, object_present=np.ones(len(frames), dtype=bool))
    z = np.random.default_rng(1).standard_normal((3, 3))
    assert np.array_equal(
        of(sensor, {}, frames).log_likelihood(z), of(sensor, {}, told).log_likelihood(z)
    )


def test_a_frames_gain_scales_object_and_background_but_not_crosstalk(sensor: Sensor) -> None:
    frames = data(sensor, KNOWN, frames=6).frames
    gain = np.array([1.0, 0.5, 2.0, 3.0, 0.1, 1.3])
    found = of(sensor, KNOWN, Frames(frames.readings, gain=gain)).frame_log_likelihoods(NOTHING)[0]
    for k, factor in enumerate(gain):
        stronger = parse_sensor(
            sensor.model_dump(mode="json", exclude_unset=True)
            | {"gain": sensor.known_gain * factor}
        )
        brighter = BACKGROUND | {"strength": BACKGROUND["strength"] * factor}
        one = of(stronger, KNOWN | {"background": brighter}, frames.select([k]))
        assert found[k] == pytest.approx(float(one.log_likelihood(NOTHING)[0]), rel=1e-9, abs=1e-6)


def test_known_values_are_the_unknown_ones_at_the_same_place(sensor: Sensor) -> None:
    frames = data(sensor, KNOWN, frames=8).frames
    free = of(sensor, FREE, frames)
    values = {
        **{f"object.{name}": value for name, value in OBJECT.items()},
        **dict(zip((f"crosstalk.{c}" for c in sensor.columns), KNOWN["crosstalk"], strict=True)),
        "background.strength": BACKGROUND["strength"],
        "background.distance_m": BACKGROUND["distance_m"],
        "background.shadow.c0": BACKGROUND["shadow"]["c0"],
        "background.shadow.c1": BACKGROUND["shadow"]["c1"],
    }
    natural = np.array([[values[name] for name in free.parameters.names]])
    found = free.frame_log_likelihoods(free.parameters.standard(natural))
    wanted = of(sensor, KNOWN, frames).frame_log_likelihoods(NOTHING)
    # the way to z and back costs some digits, times the signal-to-noise ratio of 1e5 at 0.1 m
    assert found == pytest.approx(wanted, abs=1e-6)


def test_the_density_is_prior_times_likelihood(sensor: Sensor) -> None:
    frames = data(sensor).frames
    density = of(sensor, {}, frames)
    z = np.random.default_rng(2).standard_normal((4, 3))
    wanted = -0.5 * (z**2).sum(axis=1) + density.frame_log_likelihoods(z).sum(axis=1)
    assert density(z) == pytest.approx(wanted, rel=1e-14)
    assert density(z[0]) == pytest.approx(wanted[:1], rel=1e-14)


def test_impossible_parameters_have_no_density_and_give_no_warning(sensor: Sensor) -> None:
    density = of(sensor, FREE, data(sensor, KNOWN, frames=3).frames)
    d = len(density.parameters)
    wild = np.concatenate([size * np.eye(d) for size in (40.0, -40.0, 1e3, -1e3, 1e308)])
    wild = np.concatenate([wild, [np.full(d, np.inf), np.full(d, -np.inf)]])
    found = density(wild)
    assert not np.isnan(found).any()
    assert (found < np.inf).all()
    assert np.isneginf(found[-2:]).all()
    here = density(np.zeros((1, d)))[0]
    assert np.isfinite(here)
    # one impossible vector leaves its neighbours alone
    assert density(np.concatenate([wild, np.zeros((1, d))]))[-1] == here


def test_ranges_that_the_shadow_forbids_have_no_density(sensor: Sensor) -> None:
    scene = KNOWN | {
        "background": BACKGROUND | {"shadow": {"c0": 0.5, "c1": -1.0}},
        "range_m": {"prior": "uniform", "low": 0.1, "high": 0.9},
    }
    assert np.isneginf(of(sensor, scene, data(sensor, frames=2).frames)(NOTHING)[0])


def test_an_absent_term_is_a_term_of_zeros(sensor: Sensor) -> None:
    frames = data(sensor).frames
    z = 0.3 * np.random.default_rng(3).standard_normal((4, 3))
    absent = of(sensor, {}, frames).frame_log_likelihoods(z)
    zeros = of(sensor, {"crosstalk": [0.0, 0.0]}, frames).frame_log_likelihoods(z)
    assert absent == pytest.approx(zeros, rel=1e-12)


def test_crosstalk_and_priors_of_the_range_need_no_machine_code(sensor: Sensor) -> None:
    frames, found = data(sensor).frames, []
    uniform = {"range_m": {"prior": "uniform", "low": 0.1, "high": 3.0}}
    for scene in ({}, {"crosstalk": UNKNOWN_CROSSTALK}, uniform):
        density = of(sensor, scene, frames)
        terms = density.parameters.terms(np.zeros((1, len(density.parameters))))
        found += [density.rows(terms), density.integral_rows(terms)]
    assert {kind_of(rows) for rows in found} == {kind_of(found[0])}
    # a reference prior counts for integrals alone, another one is in the numbers of all
    assert [rows.resolves for rows in found] == [False, True, False, True, False, False]
    absent = found[0]
    # and zeros change no bit of what a density without crosstalk says
    density, z = of(sensor, {}, frames), np.zeros((1, 3))
    none = absent._replace(crosstalks=None)
    out = np.empty((1, density.data.blocks))
    fill_log_likelihoods(out, none, density.data, density.instrument)
    assert np.array_equal(out[0], density._of_rows(absent, density.data)[0])
    assert np.isfinite(density.frame_log_likelihoods(z)).all()
