"""Noise that is stated too small is said, whatever the model may err by."""

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from inference.tracking.hypotheses import WITHOUT_CROSSTALK
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, step, track
from inference.tracking.tracker import Tracker, tracker
from inference.tracking.unsteady import UNSTEADY
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.simulate import mean_readings
from tests.posterior.scenes import KINDS
from tests.tracking.scenes import PLATE, frames_of, sensor_of

Array = NDArray[np.float64]

FRAMES, STEP_S, NOISE = 240, 1 / 30, 8e-4


def readings_of(kind: str, more: float, seed: int) -> tuple[Array, Array]:
    """Return readings of a plate that swings, with so many times the noise, and their ranges."""
    sensor, scene = sensor_of(NOISE, kind), parse_scene({**PLATE, "discrepancy": 0})
    ranges = 0.5 * np.exp(0.5 * np.sin(STEP_S * np.arange(FRAMES)))
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    noise = more * NOISE * np.random.default_rng(seed).standard_normal((FRAMES, 2))
    return mean_readings(sensor, terms, ranges) + noise, ranges


def tracked(kind: str, more: float, seed: int = 1) -> Track:
    readings, _ = readings_of(kind, more, seed)
    return track(sensor_of(NOISE, kind), parse_scene(PLATE), frames_of(readings, STEP_S))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_noise_that_is_stated_three_times_too_small_is_said_within_three_seconds(kind: str) -> None:
    said = tracked(kind, 3.0).misfit
    assert said.any()
    assert np.argmax(said) * STEP_S < 3.0


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_noise_that_is_as_stated_is_no_misfit(kind: str) -> None:
    # one frame in a million: 2 x 240 frames, 5e-4 at most
    assert not tracked(kind, 1.0).misfit.any()


def squares_of(model: Tracker, frames: Frames) -> Array:
    """Return what each frame adds to the running mean."""
    memory = model.model.rules.memory
    state, means = model.first, [1.0]
    for i in range(len(frames.readings)):
        state, _ = step(model, state, frames.select(slice(i, i + 1)))
        means.append(state.hypotheses.numbers[UNSTEADY])
    return np.asarray(np.diff(means) / (1.0 - memory) + means[:-1])


def test_shot_noise_of_both_windows_is_of_the_same_photons() -> None:
    """At half of the pulse's range, where half of all light is late; the object is at rest.

    The sum of 240 squared differences of neighbours has the variance 2 (1 + 2/4) a square; 1 in
    5,000 seeds.
    """
    sensor = sensor_of(1e-5, noise={"shot": 1e-6}, pulse_width_s=6.67e-9)
    near = {**PLATE, "range_m": {"prior": "loguniform", "low": 0.1, "high": 0.9}}
    terms = parameters_of(sensor, parse_scene({**near, "discrepancy": 0})).terms(np.zeros((1, 0)))
    late, whole = mean_readings(sensor, terms, np.array([0.5]))[0]
    assert late == pytest.approx(0.5 * whole, rel=1e-3)
    rng = np.random.default_rng(1)
    drawn = late + 1e-3 * np.sqrt(late) * rng.standard_normal((FRAMES, 2))
    readings = np.column_stack([drawn[:, 0], drawn.sum(axis=1)])
    readings += 1e-5 * rng.standard_normal((FRAMES, 2))
    squares = squares_of(tracker(sensor, parse_scene(near)), frames_of(readings, STEP_S))
    assert abs(squares.mean() - 1.0) < 3.7 * np.sqrt(3.0 / FRAMES)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_known_crosstalk_changes_nothing(kind: str) -> None:
    crosstalk = np.array([0.3, 0.6])
    readings, _ = readings_of(kind, 1.0, 3)
    numbers = []
    for scene, beside in (({}, 0.0), ({"crosstalk": crosstalk.tolist()}, crosstalk)):
        model = tracker(sensor_of(NOISE, kind), parse_scene({**PLATE, **scene}))
        state, _ = step(model, model.first, frames_of(readings[:60] + beside, STEP_S))
        numbers.append(state.hypotheses.numbers[UNSTEADY])
    # readings lose the last digits of crosstalk that is a thousand times their noise
    assert numbers[1] == pytest.approx(numbers[0], rel=1e-9)


def test_crosstalk_that_drifts_as_stated_is_no_misfit() -> None:
    """By five noises a frame; one in a million frames."""
    readings, _ = readings_of("sine_wave", 1.0, 4)
    steps = 5.0 * NOISE * np.random.default_rng(6).standard_normal((FRAMES, 2))
    drift = 5.0 * NOISE / np.sqrt(STEP_S)
    model = tracker(
        sensor_of(NOISE, "sine_wave"),
        parse_scene(PLATE),
        TrackingSettings(crosstalk_drift=(drift, drift)),
    )
    assert model.first.hypotheses.numbers.size > UNSTEADY
    _, found = step(model, model.first, frames_of(readings + np.cumsum(steps, axis=0), STEP_S))
    assert not found.misfit.any()


def test_the_running_mean_is_at_most_one_and_as_wide_as_its_law() -> None:
    # the sum of 240 squared differences of neighbours: variance 2 (1 + 2/4) a square
    model = tracker(sensor_of(NOISE), parse_scene(PLATE))
    assert model.first.hypotheses.numbers.size > UNSTEADY
    memory = model.model.rules.memory
    squares = squares_of(model, frames_of(readings_of("pulsed", 1.0, 5)[0], STEP_S))
    sd = np.sqrt(3.0 / len(squares))
    # 1 in 10,000 seeds of a mean of 1; what a shared error may add makes it less
    assert 1.0 - 0.3 - 3.7 * sd < squares.mean() < 1.0 + 3.7 * sd
    limit = model.limits.unsteady
    freedom = 1.0 / (2.0 * 1.5 * (1.0 - memory) / (1.0 + memory))
    assert limit == pytest.approx(scipy.stats.gamma.isf(1e-6, freedom, scale=1 / freedom), rel=0.02)


def test_an_exact_model_remembers_nothing_of_it() -> None:
    model = tracker(sensor_of(NOISE), parse_scene({**PLATE, "discrepancy": 0}))
    assert model.first.hypotheses.numbers.size == UNSTEADY
    assert model.first.hypotheses.X.shape[1:] == (WITHOUT_CROSSTALK, WITHOUT_CROSSTALK)


def test_a_stream_may_be_cut_anywhere() -> None:
    readings, _ = readings_of("pulsed", 3.0, 2)
    model = tracker(sensor_of(NOISE), parse_scene(PLATE))
    frames = frames_of(readings[:60], STEP_S)
    _, whole = step(model, model.first, frames)
    state, first = step(model, model.first, frames.select(slice(0, 23)))
    _, second = step(model, state, frames.select(slice(23, 60)))
    np.testing.assert_array_equal(whole.misfit, [*first.misfit, *second.misfit])
