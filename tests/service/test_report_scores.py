"""Scores of the report, and what is put together of them."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import integrate, stats

from service.report.floors import least_error
from service.report.row import Costs, Row
from service.report.scores import Scores, crps_of_draws, crps_of_normals, scores_of_roots
from service.report.table import left_out, percent, with_error
from service.report.taking import method_to_take
from service.report.together import together
from service.report.uncertain import blocks_of, error_of_mean, error_of_quantile, share_band
from simulator.readings import object_readings
from tests.service.reporting import BY_NAME


def test_score_of_a_mixture_is_the_integral_that_defines_it() -> None:
    mean, sd, weight = np.array([[1.0, 3.0]]), np.array([[0.2, 0.5]]), np.array([[0.3, 0.7]])

    def missed(x: float) -> float:
        below = float((weight * stats.norm.cdf(x, mean, sd)).sum())
        return (below - (x >= 2.2)) ** 2

    exact = sum(integrate.quad(missed, *ends)[0] for ends in ((-5.0, 2.2), (2.2, 12.0)))
    found = crps_of_normals(np.array([2.2]), mean, sd, weight)
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    # a part that is not there counts for nothing, and weights need not add up to one
    padded = [np.hstack([part, [[np.nan]]]) for part in (mean, sd, 2 * weight)]
    np.testing.assert_allclose(crps_of_normals(np.array([2.2]), *padded), exact, rtol=1e-6)
    assert np.isnan(crps_of_normals(np.ones(1), *[np.full((1, 2), np.nan)] * 3)).all()


def test_score_of_draws_is_that_of_their_law() -> None:
    draws = stats.norm.ppf((np.arange(4000) + 0.5) / 4000)[:, None] * [0.5, 2.0] + [1.0, -1.0]
    truth = np.array([1.3, 2.0])
    normal = crps_of_normals(
        truth, np.array([[1.0], [-1.0]]), np.array([[0.5], [2.0]]), np.ones((2, 1))
    )
    np.testing.assert_allclose(crps_of_draws(truth, draws), normal, rtol=1e-3)


def test_shares() -> None:
    nan = np.nan
    truth, single = np.array([1.0, 1.0, 1.0, 2.0]), np.array([1.1, nan, nan, 2.0])
    roots = np.array([[1.1, nan], [1.0, 2.0], [nan, nan], [2.0, nan]])
    sd = np.array([[0.05, nan], [0.1, 0.1], [nan, nan], [nan, nan]])
    several = np.array([False, True, False, False])
    found = scores_of_roots(truth, single, several, roots, sd, np.ones_like(roots))
    assert (found.single, found.ambiguous, found.refused) == (0.5, 0.25, 0.25)
    assert found.median_error == pytest.approx(0.05)
    # the last has no interval; the first is two standard deviations off
    assert found.coverage == 0.5


def test_least_error_is_the_noise_over_the_slope() -> None:
    """Of one pulse with all but the range known, by differences, at each range."""
    scene = BY_NAME["Bare object"]
    ranges, noise = np.geomspace(scene.from_m, scene.to_m, 40), np.array(scene.sensor.noise.read)
    sizes = stats.norm.ppf(0.5 + 0.5 * (np.arange(200) + 0.5) / 200)

    def readings(r: float) -> np.ndarray:
        return np.array(object_readings(r, 14.9896229, None, 0.0769 * 0.0957, 0.0769, -0.123))

    slopes = [
        np.linalg.norm(
            (readings(r * 1.0001) - readings(r / 1.0001)) / (2 * math.log(1.0001)) / noise
        )
        for r in ranges
    ]
    expected = np.median(np.outer(1 / np.array(slopes), sizes))
    assert least_error(scene) == pytest.approx(expected, rel=1e-5)


def test_monte_carlo_errors_are_what_repeated_sets_scatter_by() -> None:
    """200 reports of 12 sets of 30 frames whose errors have half their variance in common.

    Each ratio of a mean standard error to the scatter has a standard deviation of 6 %, and the
    estimates lie low by some percent of few sets: 25 % is four of these.
    """
    rng = np.random.default_rng(5)
    sets = np.repeat(np.arange(12), 30)
    shared = rng.standard_normal((200, 12, 1)) + rng.standard_normal((200, 12, 30))
    every = np.abs(shared).reshape(200, -1)
    means = [error_of_mean(values, sets) or 0.0 for values in every]
    assert np.mean(means) == pytest.approx(every.mean(axis=1).std(), rel=0.25)
    medians = [error_of_quantile(values, 0.5, sets) or 0.0 for values in every]
    assert np.mean(medians) == pytest.approx(np.median(every, axis=1).std(), rel=0.25)
    # of 200 bands of 95 %, fewer than 180 hold the true share once in a thousand times
    true = stats.norm.cdf(2.0 / math.sqrt(2)) - stats.norm.cdf(-2.0 / math.sqrt(2))
    bands = [share_band((values < 2.0).astype(float), sets) for values in every]
    assert sum(low <= true <= high for low, high in filter(None, bands)) >= 180
    # of few sets each counts as one frame, and so it does where all sets agree
    assert share_band(np.ones(360), sets) == pytest.approx((0.025 ** (1 / 12), 1.0))
    assert share_band(np.full(3, np.nan), np.arange(3)) is None
    assert error_of_mean(np.ones(4), np.zeros(4, int)) is None
    # along a sweep what changes steadily is no chance: 4 sd of this estimate are 45 % of it, and
    # sets in no order would say seven times as much
    steady = np.linspace(0.0, 3.0, 4000) + rng.standard_normal(4000)
    off = error_of_mean(steady, blocks_of(4000), along=True)
    assert off == pytest.approx(1 / math.sqrt(4000), rel=0.45)


def scored(
    method: str,
    family: str,
    error: float,
    band: tuple[float, float],
    frame_s: float,
    remark: str = "",
) -> Row:
    scores = Scores(error, error, sum(band) / 2, error, 1.0, 0.0, 0.0)
    scores = scores._replace(coverage_low=band[0], coverage_high=band[1], sets=10)
    costs = Costs(frame_s)
    return Row("x", method, family, knob="k", scores=scores, costs=costs, remark=remark)


def test_the_method_to_take_is_cheap_near_the_best_and_shown_to_be_honest() -> None:
    sure, wrong, few = (0.85, 0.95), (0.4, 0.6), (0.5, 0.99)
    rows = [
        scored("fast", "single frames", 1e-2, sure, 1e-8),
        scored("liar", "single frames", 1e-9, wrong, 1e-9),
        dataclasses.replace(scored("blind", "single frames", 1e-9, sure, 1e-9), told="nothing"),
        scored("good", "tracker", 1.9e-4, sure, 1e-6),
        scored("best", "many frames", 1e-4, sure, 1e-3, "told the object"),
        scored("hardly better", "many frames", 1e-4, few, 1e-9, "told the object"),
        scored("free", "posterior", 5e-7, few, 0.1),
    ]
    assert method_to_take(rows) == (
        "Object known: good, k (0.019 %, 1 us a frame). "
        "Object unknown: too few sets to tell of free, k (0.00005 %, 100 ms a frame)"
    )
    assert method_to_take(rows[1:3]) == ""


def test_shares_can_be_read() -> None:
    assert percent(0.0123) == "1.2 %"
    assert percent(4.2e-5) == "0.0042 %"
    assert percent(2e-16) == "below 0.0000001 %"
    assert percent(0.0) == "0 %"
    assert with_error(0.012345, 0.00067) == "1.234 ± 0.067 %"
    assert with_error(0.012345, None) == "1.2 %"


def test_settings_that_are_left_out_are_listed_with_their_reason() -> None:
    served = scored("posterior", "posterior", 1e-4, (0.9, 1.0), 1.0)
    refused = dataclasses.replace(served, knob="100 frames", scores=None, remark="too slow")
    other = dataclasses.replace(refused, method="brightness", remark="not immune")
    assert left_out([served, refused, other]) == {
        "posterior, 100 frames": "too slow",
        "brightness": "not immune",
    }


def test_intervals_are_put_together_by_sets_and_data_count_once() -> None:
    first = scored("fit", "many frames", 1e-4, (0.9, 1.0), 1.0)
    rows = [
        dataclasses.replace(first, knob="10 frames, 5 draws"),
        dataclasses.replace(first, knob="10 frames, 50 draws"),
        dataclasses.replace(first, knob="20 frames"),
        dataclasses.replace(first, told="nothing"),
        dataclasses.replace(first, scene="y, told that the model is exact"),
        scored("fit", "many frames", 1e-4, (0.3, 0.7), 1.0),
    ]
    (found,) = together(rows)
    assert (found.sets, found.scenes, found.misled) == (30, 1, ("x",))
    assert found.coverage == pytest.approx((2 * 0.95 + 0.5) / 3)
    assert stats.binom.cdf(24, 30, found.high) == pytest.approx(0.025, abs=1e-9)
