"""Bright objects of uncertain light beside learnt crosstalk whose prior tells it well enough."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status
from inference.tracking.held_crosstalk import hold_told
from inference.tracking.hypotheses import (
    CROSSTALK1,
    TOLD1,
    TOLD2,
    TOLD11,
    TOLD22,
    Hypotheses,
    copied,
)
from inference.tracking.roots import Root, rest_of
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import step, track
from inference.tracking.tracker import tracker
from simulator.frames import frames_from_columns
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

READ = np.array([1e-4, 2e-4])
CROSSTALK = np.array([0.004, 0.05])
HAND = {"c0": 0.004, "c1": -0.022, "c2": 0.06}
R0_M = 0.5 * 299792458.0 * 1e-8
SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-8, "noise": {"read": READ.tolist()}})
PRIOR = [{"prior": "normal", "mean": c, "sd": 0.1 * c} for c in CROSSTALK.tolist()]


@pytest.mark.parametrize("seed", range(6))
def test_a_hand_is_as_sure_as_its_frames_say_beside_the_prior(seed: int) -> None:
    """Half a second of an empty scene, then a hand from 0.4 to 0.15 m: 2,300 noises of light.

    Its light may be off by 70 %, and all is as stated. `conventional` knows the last range to
    2.3 mm beside the prior alone. Told was 187 mm, and of longer paths most were a misfit. A range
    beyond five standard deviations and a misfit are once in millions by chance.
    """
    rng = np.random.default_rng([11, seed])
    time_s = np.arange(90) / 30.0
    way = 0.5 * (1.0 - np.cos(np.pi * np.clip((time_s - 0.5) / 1.5, 0.0, 1.0)))
    r: Array = 0.4 * (0.15 / 0.4) ** way
    strength = HAND["c0"] * HAND["c2"]
    flux = np.array([object_flux(float(x), strength, HAND["c0"], HAND["c1"]) for x in r])
    light = flux[:, None] * np.stack([r / R0_M, np.ones(90)], axis=1) * (time_s > 0.5)[:, None]
    readings = light + CROSSTALK + READ * rng.standard_normal((90, 2))
    frames = frames_from_columns(
        SENSOR, {"time_s": time_s, "w1": readings[:, 0], "w2": readings[:, 1]}
    )
    scene: dict[str, Any] = {"crosstalk": PRIOR}
    alone = estimate(SENSOR, parse_scene(scene), frames, ["conventional"]).results[0]
    scene |= {"object": HAND, "discrepancy": {"flux": 0.7, "range_m": 0.0008}}
    found = track(SENSOR, parse_scene(scene), frames, TrackingSettings(rate_sd=2.0))
    assert found.status[-1] == Status.UNIQUE
    # the crosstalk is taken at two of its standard deviations
    assert found.best_sd_m[-1] < 2.5 * alone.sd_m[-1]
    assert not found.misfit.any()
    there = time_s > 0.5
    # nan where no range is the only one
    assert not (np.abs(found.range_m - r)[there] > 5.0 * found.best_sd_m[there]).any()


def test_what_is_left_to_learn_is_the_difference_of_what_both_know() -> None:
    """Where one knows more in all directions its information is that of the other and the rest."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        known = np.tril(rng.standard_normal((2, 2)))
        np.fill_diagonal(known, np.abs(np.diag(known)) + 0.1)
        more = rng.standard_normal((2, 2))
        wider = known @ known.T + more @ more.T
        held = np.linalg.cholesky(wider)
        some, rest = rest_of(*(Root(a[0, 0], a[1, 0], a[1, 1]) for a in (known, held)))
        root = np.array([[rest.r11, 0.0], [rest.r21, rest.r22]])
        assert some
        both = np.linalg.inv(wider) + np.linalg.inv(root @ root.T)
        np.testing.assert_allclose(both @ known @ known.T, np.eye(2), atol=1e-9)
    assert not rest_of(Root(2.0, 0.5, 3.0), Root(1.0, 0.1, 1.0))[0]


def _opened(sd1: float, sd2: float, away1: float) -> Hypotheses:
    """Return hypotheses, of which row 1 errs by so much, beside crosstalk known to (4, 25)."""
    scene = {
        "object": HAND,
        "crosstalk": [
            {"prior": "normal", "mean": 0.0, "sd": float(k * s)}
            for k, s in zip((4.0, 25.0), READ, strict=True)
        ],
    }
    of = copied(tracker(SENSOR, parse_scene(scene)).first.hypotheses)
    of.x[1], of.X[1] = 0.0, 0.0
    of.x[1, CROSSTALK1] = away1
    of.X[1, CROSSTALK1, CROSSTALK1], of.X[1, CROSSTALK1 + 1, CROSSTALK1 + 1] = sd1, sd2
    return of


def test_crosstalk_is_said_to_be_no_wider_than_it_is_known() -> None:
    """Opened in one direction alone it is as known there, and as told in the other."""
    of = _opened(40.0, 5.0, 8.0)
    assert hold_told(of, 1)
    covariance = of.X[1, CROSSTALK1:] @ of.X[1, CROSSTALK1:].T
    np.testing.assert_allclose(covariance, np.diag([16.0, 25.0]), atol=1e-5)
    # 8 of variance 1600, and 0 of the rest of 16: a hundredth is left
    assert of.x[1, CROSSTALK1] == pytest.approx(0.08, rel=1e-6)


def test_what_readings_contradict_is_not_known() -> None:
    """Six standard deviations of what is known, beside crosstalk that readings told well."""
    of = _opened(1.0, 40.0, 24.0)
    before = of.x.copy(), of.X.copy()
    assert not hold_told(of, 1)
    np.testing.assert_array_equal(of.x, before[0])
    np.testing.assert_array_equal(of.X, before[1])


def test_stated_frames_teach_mean_and_covariance_of_what_is_known() -> None:
    """Four of them, a step of least squares: (0, 16) and four readings of variance 1."""
    rng = np.random.default_rng(5)
    readings = rng.standard_normal((4, 2)) * READ
    columns: dict[str, Any] = {
        "time_s": np.arange(4.0),
        "w1": readings[:, 0],
        "w2": readings[:, 1],
        "object_present": [False] * 4,
    }
    scene = {
        "object": HAND,
        "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": float(4.0 * s)} for s in READ],
    }
    model = tracker(SENSOR, parse_scene(scene))
    after, _ = step(model, model.first, frames_from_columns(SENSOR, columns))
    numbers = after.hypotheses.numbers
    variance = 1.0 / (1.0 / 16.0 + 4.0)
    np.testing.assert_allclose(numbers[[TOLD11, TOLD22]] ** 2, variance, rtol=1e-12)
    means = variance * (readings / READ).sum(axis=0)
    np.testing.assert_allclose(numbers[[TOLD1, TOLD2]], means, rtol=1e-9)
