"""What a fit says of numbers of its scene, and of its frames, that the readings contradict."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from scipy import special

import hybridtof
from inference.fits.answer.model_checks import basis
from inference.fits.answer.stated_facts import off_their_own, weights_of_told
from inference.fits.likelihood.told import Told, eliminated
from simulator.frames import Frames
from simulator.sensor import Sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

TRUTH = {"crosstalk": [0.002, 0.01], "discrepancy": 0}


def fit_of(sensor: Sensor, frames: Frames, thing: dict[str, Any]) -> dict[str, Any]:
    scene = hybridtof.parse_scene({"object": thing, "crosstalk": UNKNOWN_CROSSTALK})
    fit = hybridtof.estimate(sensor, scene, frames, ["joint_fit"]).results[0].fit
    assert fit is not None
    return dict(fit)


def test_a_known_object_of_another_brightness_is_a_misfit() -> None:
    """It was none, by chi-square: the score test is what a fit with c2 unknown gains, to 5 %."""
    sensor = sensor_of("sine_wave", 100.0)
    frames = data(sensor, TRUTH, 20, 1, (0.3, 1.5)).frames
    brighter = {**OBJECT, "c2": 1.1 * OBJECT["c2"]}
    free = {**OBJECT, "c2": {"prior": "lognormal", "median": brighter["c2"], "sigma": 5.0}}
    stated, opened, right = (fit_of(sensor, frames, thing) for thing in (brighter, free, OBJECT))
    assert stated["misfit"]
    assert stated["checks"]["chi_square"] > 0.01
    assert len(stated["reasons"]) == 1
    assert "c2" in stated["reasons"][0]
    gain = special.chdtri(1, stated["checks"]["brightness"])
    assert gain == pytest.approx(stated["deviance"] - opened["deviance"], rel=0.05)
    assert "brightness" not in opened["checks"]
    assert not right["misfit"]


@pytest.mark.parametrize(("error_m", "misfit"), [(1e-3, False), (4e-3, True)])
def test_rulers_that_err_by_more_than_they_say_are_a_misfit(error_m: float, misfit: bool) -> None:
    """Six rulers, each of the same draw times its size: of 4 mm chi-square says nothing."""
    sensor = sensor_of("sine_wave", 300.0)
    seen = data(sensor, TRUTH, 20, 1, (0.3, 1.5))
    off = error_m * np.random.default_rng(5).standard_normal(20)
    ruled = np.isin(np.arange(20), [2, 5, 8, 11, 14, 17])
    frames = dataclasses.replace(
        seen.frames,
        known_range_m=np.where(ruled, seen.range_m + off, np.nan),
        known_range_sd_m=np.where(ruled, 1e-3, np.nan),
    )
    fit = fit_of(sensor, frames, OBJECT)
    assert fit["checks"]["chi_square"] > 1e-3
    assert fit["misfit"] is misfit
    assert any("known_range_sd_m" in reason for reason in fit["reasons"]) is misfit


def test_what_is_told_is_held_against_its_own_errors() -> None:
    """As by all rows at once, no range eliminated: the same sum of squares, to rounding.

    Frames that are told nothing, a range, a displacement, or both.
    """
    rng = np.random.default_rng(3)
    n, k = 12, 3
    along, jacobian = rng.standard_normal((n, 2)), rng.standard_normal((n, 2, k))
    told_along = rng.uniform(0.3, 3.0, (n, 2)) * np.array([[0, 0], [1, 0], [0, 1], [1, 1]] * 3)
    readings, told = rng.standard_normal((n, 2)), rng.standard_normal((n, 2)) * (told_along > 0)

    each = np.zeros((n, 2, n)), np.zeros((n, 2, n))
    for part, slopes in zip(each, (along, told_along), strict=True):
        part[np.arange(n), :, np.arange(n)] = slopes
    rows = np.block(
        [
            [each[0].reshape(-1, n), jacobian.reshape(-1, k)],
            [each[1].reshape(-1, n), np.zeros((2 * n, k))],
        ]
    )
    target = np.concatenate([readings.ravel(), told.ravel()])
    whole = basis(rows)
    of_told = 2 * n + np.flatnonzero(told_along.ravel() > 0)
    left = (target - whole @ (whole.T @ target))[of_told]
    covariance = np.eye(left.size) - whole[of_told] @ whole[of_told].T
    share, turn = np.linalg.eigh(covariance)
    free = share > 0.05
    wanted = float(np.square(turn[:, free].T @ left / np.sqrt(share[free])).sum())

    beside = Told(told, told_along, told[:, :, None])
    seen = eliminated(("a", "b", "c"), jacobian, along, readings[:, :, None], beside)
    followed = basis(seen.jacobian)
    target = seen.errors[:, 0]
    weights = weights_of_told(along, beside).ravel()
    weights = np.concatenate([np.zeros(target.size - weights.size), weights])
    square, number = off_their_own(target - followed @ (followed.T @ target), followed, weights)
    assert square == pytest.approx(wanted, rel=1e-9)
    assert number == free.sum()
    assert 0 < number < left.size
