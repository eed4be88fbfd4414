"""What an answer owes to the default prior of the object's c0."""

import functools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.coverage.classes import CLASSES, DataSet, draw
from inference.posterior.answer.posterior import Posterior
from inference.posterior.criticism.flattened import flattened
from inference.posterior.criticism.size_prior import WiderPrior, wider_prior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene

NAMES = ("object.c0", "object.c1")
STATED = {"prior": "lognormal", "median": 0.1, "sigma": 2.0}


def _found(mean: float, sd: float, slope: float, count: int = 40_000) -> WiderPrior:
    """Draws of c0 whose posterior is normal, and of three ranges that follow it."""
    rng = np.random.default_rng(1)
    z = rng.standard_normal((count, 2))
    z[:, 0] = mean + sd * z[:, 0]
    log_r = slope * z[:, :1] + np.array([0.0, 1.0, np.nan])
    found = wider_prior(parse_scene({}), NAMES, z, log_r)
    assert found is not None
    return found


@pytest.mark.parametrize(("mean", "sd"), [(1.0, 0.3), (-1.5, 0.4), (0.0, 0.05), (1.2, 0.4)])
def test_a_normal_posterior_moves_as_its_product_with_the_wider_prior(
    mean: float, sd: float
) -> None:
    """By hand: the prior's precision, one, becomes a quarter. Five standard errors of draws whose
    weights vary by up to a factor ten."""
    found = _found(mean, sd, slope=0.5)
    precision = 1 / sd**2 - 0.75
    shift, variance = mean / sd**2 / precision - mean, 1 / precision
    error = 5 * sd * 3 / math.sqrt(40_000)
    assert found.of_z[0, 0] == pytest.approx(shift, abs=error)
    assert found.of_log_r[:2, 0] == pytest.approx(0.5 * shift, abs=error)
    assert found.of_z[1, 0] == pytest.approx(0.0, abs=15 / math.sqrt(40_000))
    # the second error adds what the wider prior's posterior is wider by
    assert found.of_z[0, 1] ** 2 == pytest.approx(variance - sd**2, abs=2 * sd * error)
    assert found.of_log_r[0, 1] == pytest.approx(0.5 * found.of_z[0, 1])
    assert np.all(found.of_log_r[2] == 0.0)


def test_what_the_readings_tell_stays_where_it_is() -> None:
    found = _found(mean=1.0, sd=1e-3, slope=1.0)
    assert np.all(np.abs(found.of_log_r) < 1e-4)


@pytest.mark.parametrize(
    "scene",
    [
        {"object": {"c0": 0.05}},
        {"object": {"c0": STATED}},
        {"discrepancy": 0},
    ],
)
def test_what_is_stated_means_what_it_says(scene: dict[str, Any]) -> None:
    z = np.random.default_rng(1).standard_normal((100, 2))
    assert wider_prior(parse_scene(scene), NAMES, z, z) is None
    assert wider_prior(parse_scene({}), NAMES, z, z) is not None
    assert wider_prior(parse_scene({}), NAMES, z, np.full((100, 3), np.nan)) is None
    assert wider_prior(parse_scene({}), ("object.c1", "object.c2"), z, z) is None


@functools.cache
def _glossy() -> DataSet:
    """A glossy disk of 80 cm radius behind unknown crosstalk: c0 is told by its prior alone."""
    return draw(CLASSES["crosstalk"], 28)


def _answer(told: dict[str, Any]) -> Posterior:
    data, settings = _glossy(), SamplerSettings(method="auto", seed=1)
    return infer(data.sensor, parse_scene({**data.terms, **told}), data.frames, settings)


def test_ranges_that_rest_on_the_default_are_wider_than_by_the_same_prior_stated() -> None:
    default, stated = _answer({}), _answer({"object": {"c0": STATED}})
    wider = default.range_m.sd / stated.range_m.sd
    assert np.median(wider) > 1.1
    assert default.range_m.mean == pytest.approx(stated.range_m.mean, rel=0.1)
    # it is the scene's part, not the model's
    of = default.range_m.sd_parts.scene**2 - stated.range_m.sd_parts.scene**2
    assert np.median(of / (default.range_m.sd**2 - stated.range_m.sd**2)) > 0.5
    assert default.draws.widened
    assert not stated.draws.widened
    true, found = _glossy().range_m, default.range_m
    assert np.mean((found.q05 <= true) & (true <= found.q95)) > 0.85
    assert np.mean((stated.range_m.q05 <= true) & (true <= stated.range_m.q95)) < 0.85


@pytest.mark.parametrize(("slope", "moved"), [(0.5, 0.5), (2.0, 2.0), (6.0, 2 * 1.097)])
def test_what_flattened_weights_move_is_continued_in_proportion(slope: float, moved: float) -> None:
    """Of a standard normal law weights exp(s z) move the mean by s, and leave exp(-s^2) of the
    draws: three tenths at 1.097, twice as far at most. Five standard errors of an effective size of
    30,000, twice."""
    z = np.random.default_rng(1).standard_normal((100_000, 1))
    assert flattened(slope * z[:, 0]).moved(z)[0] == pytest.approx(moved, abs=0.06)


@given(st.lists(st.floats(-1e8, 1e8), min_size=2, max_size=60))
def test_flattened_weights_leave_a_third_of_the_draws(gains: list[float]) -> None:
    found = flattened(np.array(gains))
    assert found.weights.sum() == pytest.approx(1.0)
    assert 1 / np.sum(found.weights**2) > 0.3 * len(gains) * (1 - 1e-6)
    assert 1.0 <= found.further <= 2.0
    # a constant more is no other weight
    assert flattened(np.array(gains) + 1e3).weights == pytest.approx(found.weights, abs=1e-5)
