"""Another object than is stated, or other light, is said though no frame by itself shows it."""

import math

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from inference.tracking.lasting import crosstalk_variance, first_lasting, lasting_of, take_lasting
from inference.tracking.track import Track, track
from inference.tracking.tracker import tracker
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.simulate import mean_readings
from tests.posterior.scenes import KINDS
from tests.tracking.scenes import PLATE, frames_of, sensor_of

Array = NDArray[np.float64]

FRAMES, STEP_S = 240, 1 / 30
CROSSTALK = {"pulsed": (0.004, 0.05), "sine_wave": (0.04, 0.03)}
GENTLE = {**PLATE, "discrepancy": {"flux": 0.02, "range_m": 8e-4}}


def tracked(kind: str, read: float, light: float = 1.0, shift: float = 0.0, seed: int = 1) -> Track:
    """Track a plate that swings, so many times as bright as stated, beside light nobody stated."""
    sensor, scene = sensor_of(read, kind), parse_scene({**PLATE, "discrepancy": 0})
    ranges = 0.5 * np.exp(0.3 * np.sin(STEP_S * np.arange(FRAMES)))
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    noise = read * np.random.default_rng(seed).standard_normal((FRAMES, 2))
    readings = light * mean_readings(sensor, terms, ranges) + noise
    readings += (1.0 + shift) * np.array(CROSSTALK[kind])
    stated = parse_scene({**GENTLE, "crosstalk": list(CROSSTALK[kind])})
    return track(sensor, stated, frames_of(readings, STEP_S))


@pytest.mark.parametrize(
    ("kind", "read", "light"), [("pulsed", 1e-3, 2.0), ("sine_wave", 2e-3, 1.5)]
)
def test_a_brighter_object_is_said_though_no_frame_shows_it(
    kind: str, read: float, light: float
) -> None:
    found = tracked(kind, read, light=light)
    # the surprise alone stays far below its limit of 13.8
    assert found.surprise.max() < 8.0
    assert found.misfit.any()


@pytest.mark.parametrize(
    ("kind", "read", "shift"), [("pulsed", 1e-3, 0.5), ("sine_wave", 2e-3, 0.1)]
)
def test_more_crosstalk_is_said_though_no_frame_shows_it(
    kind: str, read: float, shift: float
) -> None:
    found = tracked(kind, read, shift=shift)
    assert found.surprise.max() < 8.0
    assert found.misfit.any()


@pytest.mark.parametrize("kind", sorted(KINDS))
@pytest.mark.parametrize("seed", range(3))
def test_an_object_as_stated_is_no_misfit(kind: str, seed: int) -> None:
    # one frame in a million, for each of three checks: 6 x 240 frames, 5e-3 at most
    assert not tracked(kind, 2e-3, seed=seed).misfit.any()


def means_of(
    deviations: Array, shares: Array, bends: Array, crosstalk: float, memory: float
) -> float:
    """Return the statistic by its definition: sums over all frames with their weights."""
    weights = (1.0 - memory) * memory ** np.arange(len(deviations))[::-1]
    variance = (1.0 - memory) / (1.0 + memory)
    variance += float(((weights @ shares) ** 2).sum()) + crosstalk * weights.sum()
    beyond = abs(float(weights @ deviations)) - float(weights @ bends)
    return max(beyond, 0.0) / math.sqrt(variance)


def test_the_running_means_are_those_of_all_frames() -> None:
    rng = np.random.default_rng(4)
    count, nuisance, memory, crosstalk = 90, 3, 0.9, 0.04
    deviations, bends = rng.normal(2.0, 1.0, count), rng.uniform(0.0, 0.4, count)
    shares = rng.normal(0.3, 0.2, (count, nuisance))
    numbers = np.array([7.0] * nuisance + first_lasting(nuisance))
    for deviation, bend, share in zip(deviations, bends, shares, strict=True):
        numbers[:nuisance] = share
        take_lasting(numbers, nuisance, deviation, bend, crosstalk, memory)
    expected = means_of(deviations, shares, bends, crosstalk, memory)
    # roundings of 90 sums
    assert lasting_of(numbers, nuisance, memory) == pytest.approx(expected, rel=1e-12)


def test_a_frame_whose_range_is_too_open_is_left_out() -> None:
    numbers = np.array(first_lasting(0))
    take_lasting(numbers, 0, 3.0, 1.0, 0.0, 0.9)
    assert not numbers.any()


def test_a_single_frame_counts_no_more_than_noise_may_move_it() -> None:
    numbers = np.array(first_lasting(0))
    take_lasting(numbers, 0, 1e9, 0.0, 0.0, 0.9)
    other = np.array(first_lasting(0))
    take_lasting(other, 0, 4.0, 0.0, 0.0, 0.9)
    np.testing.assert_array_equal(numbers, other)


def test_stated_crosstalk_is_a_measured_number_and_what_is_not_stated_is_none() -> None:
    sensor = sensor_of(2e-3)
    for stated, expected in (({}, 0.0), ({"crosstalk": [0.004, 0.05]}, 0.04)):
        model = tracker(sensor, parse_scene({**GENTLE, **stated}))
        found = crosstalk_variance(model.first.hypotheses, 0, 1.0, 0.0, model.model.table)
        assert found == pytest.approx(expected, rel=1e-12)


def test_the_limit_is_that_of_a_normal_law() -> None:
    limit = tracker(sensor_of(2e-3), parse_scene(GENTLE)).limits.lasting
    assert 2.0 * scipy.stats.norm.sf(limit) == pytest.approx(1e-6, rel=1e-9)
