"""An object at rest beside crosstalk that is learnt: never told to be absent."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.hypotheses import RESTING
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, track
from inference.tracking.tracker import tracker
from simulator.frames import frames_from_columns
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]
C0, C1, C2 = 0.05, 0.0, 0.1
STEP, FRAMES = 1 / 30, 450
FREE = 0.05  # an object is absent below it


def followed(
    range_m: Array,
    snr: float,
    crosstalk: float,
    seed: int,
    *,
    empty: bool = False,
    blinded: bool = False,
) -> Track:
    """Follow a sine wave's object; nan where there is none.

    The ratio and the crosstalk are in its light at half a metre.
    """
    rng = np.random.default_rng(seed)
    wave = 4 * np.pi * 1e7 / 299792458.0
    there = np.isfinite(range_m)
    r = np.where(there, range_m, 1.0)
    light = np.where(there, object_flux(r, C0 * C2, C0, C1), 0.0)  # type: ignore[arg-type]
    most = float(object_flux(0.5, C0 * C2, C0, C1))
    noise, turn = most / snr, np.exp(2j * np.pi * rng.random())
    y = light * np.exp(1j * wave * r) + crosstalk * most * turn
    y = y + noise * (rng.standard_normal(r.size) + 1j * rng.standard_normal(r.size))
    columns: dict[str, Any] = {"time_s": STEP * np.arange(r.size), "i": y.real, "q": y.imag}
    if empty:
        columns["object_present"] = there | (np.arange(r.size) > 0)
    if blinded:
        y[200] = 1e3 * most * (1.0 + 1.0j)
    sensor = parse_sensor(
        {
            "kind": "sine_wave",
            "frequency_hz": 1e7,
            "noise": {"read": [noise, noise]},
            "full_scale": [1e2 * most, 1e2 * most],
        }
    )
    prior = {"prior": "normal", "mean": 0.0, "sd": 2 * crosstalk * most}
    scene = parse_scene({"object": {"c0": C0, "c1": C1, "c2": C2}, "crosstalk": [prior] * 2})
    return track(sensor, scene, frames_from_columns(sensor, columns), TrackingSettings())


@pytest.mark.parametrize(("snr", "crosstalk"), [(10.0, 1.0), (20.0, 0.3), (40.0, 1.0), (1e3, 4.0)])
def test_an_object_at_rest_is_never_absent(snr: float, crosstalk: float) -> None:
    """It is as well there as not. Without the rule it is absent, but at the highest ratio."""
    for seed in range(3):
        found = followed(np.full(FRAMES, 0.5), snr, crosstalk, seed)
        assert found.present.min() > 0.1


def test_nor_is_one_that_has_moved_a_little() -> None:
    """By 5 % of its range after three seconds: 18 % of its light, which is 20 times the noise."""
    time = STEP * np.arange(FRAMES)
    for seed in range(4):
        found = followed(0.5 * 1.05 ** np.clip(time - 3.0, 0.0, 1.0), 20.0, 1.0, seed)
        assert found.present.min() > 0.1


def test_a_saturated_frame_tells_nothing() -> None:
    """Its readings are far from all others, and none; after a small motion they would count."""
    path = 0.5 * 1.05 ** np.clip(STEP * np.arange(FRAMES) - 3.0, 0.0, 1.0)
    for seed in range(4):
        found = followed(path, 20.0, 1.0, seed, blinded=True)
        assert np.sum(found.status == int(Status.SATURATED)) == 1
        assert found.present.min() > 0.1


def test_what_came_and_went_tells_that_the_way_is_free() -> None:
    """An object that is seen for eight seconds, and leaves the light as it was."""
    time = STEP * np.arange(900)
    passing = np.where(np.abs(time - 8.0) < 4.0, 0.4 * np.exp(np.abs(time - 8.0) / 4.0), np.nan)
    found = followed(passing, 1e3, 1.0, 0)
    before, after = found.present[time < 3.9], found.present[time > 14.0]
    assert before.min() > 0.1
    assert np.mean(after < FREE) > 0.8


def test_a_little_light_that_came_and_went_tells_it_too() -> None:
    """Less than 100 of the noise: the crosstalk is again what it was before."""
    time = STEP * np.arange(900)
    passing = np.where(np.abs(time - 8.0) < 4.0, 0.4 * np.exp(np.abs(time - 8.0) / 4.0), np.nan)
    shares = []
    for seed in range(3):
        found = followed(passing, 40.0, 1.0, seed)
        assert found.present[time < 3.9].min() > 0.1
        shares.append(np.mean(found.present[time > 14.0] < FREE))
    assert max(shares) > 0.2


def test_much_light_that_has_gone_for_good_tells_it_too() -> None:
    """An object that is there from the first frame on, and leaves."""
    time = STEP * np.arange(900)
    leaving = np.where(time < 8.0, 0.4 * np.exp(np.maximum(time - 3.0, 0.0) / 3.0), np.nan)
    found = followed(leaving, 1e3, 1.0, 0)
    assert found.present[time < 7.5].min() > 0.1
    assert np.mean(found.present[time > 14.0] < FREE) > 0.8


def test_one_empty_frame_tells_it_too() -> None:
    nothing = np.full(FRAMES, np.nan)
    assert followed(nothing, 40.0, 1.0, 2).present.min() > 0.1
    told = followed(nothing, 40.0, 1.0, 2, empty=True).present
    assert told[0] == 0.0
    assert np.mean(told < 0.15) > 0.9


@pytest.mark.parametrize(("sd", "may_rest"), [(1e-4, 0.0), (1e-2, 1.0)])
def test_the_rule_is_for_crosstalk_that_may_hide_an_object(sd: float, may_rest: float) -> None:
    """Of which the variance is above ten times that of the noise."""
    noise = {"read": [1e-3, 1e-3]}
    sensor = parse_sensor({"kind": "sine_wave", "frequency_hz": 1e7, "noise": noise})
    law = {"prior": "normal", "mean": 0.0, "sd": sd}
    scene = {"object": {"c0": C0, "c1": C1, "c2": C2}, "crosstalk": [law, law]}
    first = tracker(sensor, parse_scene(scene)).first.hypotheses
    assert first.numbers[RESTING] == may_rest
