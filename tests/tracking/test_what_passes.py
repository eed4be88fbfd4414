"""What disturbs a stream for a while is said at once, and no longer than it lasts."""

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimates import Status
from inference.self_calibration.gathering import UNUSED, kinds_of
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, track
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.simulate import mean_readings
from tests.posterior.scenes import KINDS
from tests.tracking.scenes import PLATE, frames_of, sensor_of

Array = NDArray[np.float64]

FRAMES, STEP_S, NOISE = 360, 1 / 30, 8e-4
FROM, TO = 120, 240  # frames in which the object is another, or gone
CROSSTALK = np.array([0.3, 0.6])


def light_of(kind: str) -> Array:
    """Return the light of a plate that swings."""
    sensor, scene = sensor_of(NOISE, kind), parse_scene({**PLATE, "discrepancy": 0})
    ranges = 0.5 * np.exp(0.5 * np.sin(STEP_S * np.arange(FRAMES)))
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    return mean_readings(sensor, terms, ranges)


def tracked(
    kind: str, light: Array, more: float | Array = 1.0, settings: TrackingSettings | None = None
) -> Track:
    """Track that light, beside crosstalk and so many times the noise."""
    noise = NOISE * np.random.default_rng(1).standard_normal((FRAMES, 2))
    readings = light + CROSSTALK + np.reshape(more, (-1, 1)) * noise
    scene = parse_scene({**PLATE, "crosstalk": CROSSTALK.tolist()})
    return track(sensor_of(NOISE, kind), scene, frames_of(readings, STEP_S), settings)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_a_hand_on_the_glass_is_a_misfit_from_its_second_frame_on(kind: str) -> None:
    light = light_of(kind)
    light[FROM:TO] = 300.0, 5000.0
    found = tracked(kind, light)
    assert found.outlier[FROM] > 0.9
    assert found.misfit[FROM + 1 : TO].all()
    # a calibration leaves such frames aside, until more than they speaks against the scene
    frames = frames_of(light, STEP_S)
    assert (kinds_of(sensor_of(NOISE, kind), frames, found, True)[FROM : FROM + 30] == UNUSED).all()
    # the surprise, cut in every frame, is back to 1 / e of what it was after 30 frames
    assert not found.misfit[TO + 30 :].any()
    assert (found.status[TO + 30 :] == Status.UNIQUE).all()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_outliers_that_come_one_by_one_are_none(kind: str) -> None:
    light = light_of(kind)
    light[20::20] = 300.0, 5000.0
    found = tracked(kind, light)
    assert (found.outlier[20::20] > 0.9).all()
    assert not found.misfit.any()


def test_how_many_outliers_in_a_row_are_a_misfit_follows_from_how_often_they_are() -> None:
    # 0.05 to the fourth is 6e-6, to the fifth 3e-7
    light = light_of("pulsed")
    light[FROM : FROM + 6] = 300.0, 5000.0
    found = tracked("pulsed", light, settings=TrackingSettings(outlier=0.05))
    assert np.flatnonzero(found.misfit)[0] == FROM + 4


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_noise_is_told_by_frames_without_an_object_too(kind: str) -> None:
    light, more = light_of(kind), np.ones(FRAMES)
    light[60:] = 0.0
    more[FROM:TO] = 3.0
    found = tracked(kind, light, more)
    assert not found.misfit[:FROM].any()
    assert found.misfit[FROM + 30 : TO].mean() > 0.9
    # a mean of 9 / e^3 and 1 lies below the limit of 2.5
    assert not found.misfit[TO + 90 :].any()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_another_object_that_has_gone_is_remembered_but_not_said_of_the_empty_scene(
    kind: str,
) -> None:
    light = 2.0 * light_of(kind)
    light[FROM:TO] = 0.0
    found = tracked(kind, light)
    assert found.misfit[FROM - 10 : FROM].all()
    assert found.surprise[FROM - 1] < 13.8
    assert (found.present[FROM + 1 : TO] < 0.1).all()
    assert not found.misfit[FROM + 30 : TO].any()
    assert found.misfit[TO : TO + 10].all()


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("rounded", [0.0, 1.0])
def test_a_sensor_that_is_stuck_is_said_until_it_reads_again(kind: str, rounded: float) -> None:
    light = light_of(kind)
    light[:FROM] = light[FROM]  # at rest: nothing but the noise changes
    noise = NOISE * np.random.default_rng(1).standard_normal((FRAMES, 2))
    readings = light + CROSSTALK + noise
    if rounded:
        readings = rounded * NOISE * np.round(readings / (rounded * NOISE))
    readings[FROM:TO] = readings[FROM]
    scene = parse_scene({**PLATE, "crosstalk": CROSSTALK.tolist()})
    found = track(sensor_of(NOISE, kind), scene, frames_of(readings, STEP_S))
    assert not found.misfit[: FROM + 20].any()
    assert found.misfit[FROM + 29 : TO].all()
    assert not found.misfit[TO + 2 :].any()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_coarse_readings_at_rest_are_not_stuck(kind: str) -> None:
    """Rounding by four times the noise, whose own standard deviation it is, leaves all the same."""
    light = light_of(kind)
    light[FROM:] = light[FROM]  # moves, then comes to rest
    step = np.sqrt(12.0) * NOISE
    rng = np.random.default_rng(1)
    noise = 0.05 * step * rng.standard_normal((FRAMES, 2))
    readings = step * np.round((light + CROSSTALK + noise) / step)
    assert (readings[FROM + 60 :] == readings[FROM + 30]).all(axis=1).mean() > 0.5
    scene = parse_scene({**PLATE, "crosstalk": CROSSTALK.tolist()})
    found = track(sensor_of(NOISE, kind), scene, frames_of(readings, STEP_S))
    assert not found.misfit.any()


def test_a_scene_that_reads_zero_where_nothing_is_is_no_misfit() -> None:
    readings = np.zeros((FRAMES, 2))
    found = track(sensor_of(NOISE), parse_scene(PLATE), frames_of(readings, STEP_S))
    assert not found.misfit.any()


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_an_object_that_passes_for_unknown_crosstalk_is_no_noise(kind: str) -> None:
    """A stream that calibrates itself begins so: what is carried of its priors hides what moves."""
    light = light_of(kind)
    light[:FROM] = 0.0
    unknown = [{"prior": "halfnormal", "sd": 50.0}, {"prior": "halfnormal", "sd": 50.0}]
    scene = parse_scene({**PLATE, "crosstalk": unknown})
    rng = np.random.default_rng(1)
    readings = light + CROSSTALK + NOISE * rng.standard_normal((FRAMES, 2))
    draws = 50.0 * np.abs(rng.standard_normal((400, 2)))
    found = track(sensor_of(NOISE, kind), scene, frames_of(readings, STEP_S), posterior=draws)
    assert (found.present[FROM:] < 0.5).mean() > 0.5
    assert not found.misfit.any()
