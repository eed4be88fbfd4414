"""Objects whose light is uncertain, beside crosstalk that frames stated empty have taught."""

import functools
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, track
from simulator.frames import frames_from_columns
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-8},
    "sine wave": {"kind": "sine_wave", "frequency_hz": 5e7},
}
R0_M, TURN = 0.5 * 299792458.0 * 1e-8, 4.0 * np.pi * 5e7 / 299792458.0
EMPTY, RATE_SD, RANGE_M = 15, 5.0, 0.0008
RANGES = np.r_[np.geomspace(0.4, 0.05, 60), np.full(10, 0.05), np.geomspace(0.05, 0.4, 60)]
THERE = np.repeat([False, True, False], [EMPTY, RANGES.size, 30])
TRACKS = 6


class _Followed(NamedTuple):
    """One track, how far learnt crosstalk is off [noises], and what two readings tell by hand."""

    track: Track
    off: Array
    by_hand: Array  # standard deviation of the range of each frame with the object [m]


@functools.cache
def _followed(kind: str, flux: float, learnt: bool, seed: int) -> _Followed:
    """Track an object that comes near, leaves, and is gone, its c0 and c2 off by half of ``flux``.

    The crosstalk is as large as the light at 0.4 m, and learnt from a prior as wide, or stated as
    the mean of the frames without the object.
    """
    rng = np.random.default_rng(seed)
    c0, c1, c2 = 5e-4, -0.45 * 5e-4**0.5, 0.1
    far = float(object_flux(0.4, c0 * c2, c0, c1))
    noise = far / float(np.exp(rng.uniform(np.log(10.0), np.log(100.0))))
    own, strength = c0 * np.exp(0.5 * flux * rng.standard_normal(2)) * (1.0, c2 / c0)
    light = object_flux(RANGES, own * strength, own, -0.45 * own**0.5)
    crosstalk = np.abs(rng.normal(0.0, far, 2))
    shares = RANGES / R0_M, np.ones(RANGES.size)
    if kind == "sine wave":
        shares = np.cos(TURN * RANGES), np.sin(TURN * RANGES)
    readings = crosstalk + rng.normal(0.0, noise, (THERE.size, 2))
    readings[THERE] += (light * np.array(shares)).T
    mean = readings[:EMPTY].mean(axis=0)
    scene: dict[str, Any] = {
        "object": {"c0": c0, "c1": c1, "c2": c2},
        "discrepancy": {"flux": flux, "range_m": RANGE_M},
        "crosstalk": [{"prior": "halfnormal", "sd": far}] * 2 if learnt else mean.tolist(),
    }
    sensor = parse_sensor({**KINDS[kind], "noise": {"read": [noise] * 2}})
    one, other = ("i", "q") if kind == "sine wave" else ("w1", "w2")
    columns: dict[str, Any] = {
        "time_s": 0.02 * np.arange(THERE.size),
        one: readings[:, 0],
        other: readings[:, 1],
        "object_present": [i >= EMPTY for i in range(THERE.size)],
    }
    frames = frames_from_columns(sensor, columns)
    found = track(sensor, parse_scene(scene), frames, TrackingSettings(rate_sd=RATE_SD))
    off = np.zeros(0) if found.crosstalk is None else (found.crosstalk - crosstalk) / noise
    across = np.hypot(R0_M, RANGES) if kind == "pulsed" else 1.0 / TURN
    return _Followed(found, off, np.hypot(noise * (1 + 1 / EMPTY) ** 0.5 * across / light, RANGE_M))


@pytest.mark.parametrize("flux", [0.15, 0.7])
@pytest.mark.parametrize("kind", KINDS)
def test_frames_that_are_stated_empty_are_not_unlearnt(kind: str, flux: float) -> None:
    """Crosstalk stays where 15 empty frames had it, and an empty scene is empty again.

    A mean of 15 frames is five standard deviations off in one run of these four of 4e4: twelve
    numbers each, whose errors hardly change from frame to frame. The seeds are fixed. Of 360 tracks
    of others two sine waves were, by 10 and 54: what docs/limits.md, bright-uncertain, states. A
    fifth of a second after the object has gone no frame is sure of a range that is known to a
    third; of one that may have left fast a far place may remain, open by as much as itself. With
    all of the light's products with what motion adds as noise, and tangents turned beneath it,
    crosstalk went off by up to hundreds of noises, and whole stretches after the object had left
    were sure ranges.
    """
    for seed in range(TRACKS):
        followed = _followed(kind, flux, True, seed)
        found = followed.track
        assert np.abs(followed.off[EMPTY:]).max() < 5.0 / EMPTY**0.5
        sure = (found.present > 0.95) & (found.best_sd_m < found.best_m / 3.0)
        assert not sure[-20:].any()
        assert not found.misfit.any()


@pytest.mark.parametrize("flux", [0.15, 0.7])
@pytest.mark.parametrize("kind", KINDS)
def test_two_readings_tell_a_range_whatever_the_light(kind: str, flux: float) -> None:
    """Beside crosstalk that is learnt from empty frames a range is as sure as beside its mean.

    The median width is within a fifth of that, and of what ratio or phase tell by hand within a
    half: widths are no random numbers but for the light's. Intervals of 90 % hold 97 to 98 % of 360
    tracks of other seeds, with a standard deviation of 1.0 % or less between runs of six: 85 % are
    twelve of these below. Widths were proportional to `rate_sd`, up to 36 % of the range.
    """
    held, widths, numbers, by_hand = [], [], [], []
    for seed in range(TRACKS):
        learnt, number = (_followed(kind, flux, known, seed) for known in (True, False))
        range_m, sd = learnt.track.range_m[THERE], learnt.track.best_sd_m[THERE]
        assert np.isfinite(range_m).mean() > 0.98
        held.append(np.abs(range_m - RANGES) < 1.645 * sd)
        widths.append(sd / RANGES)
        numbers.append(number.track.best_sd_m[THERE] / RANGES)
        by_hand.append(learnt.by_hand / RANGES)
    assert np.mean(held) > 0.85
    assert np.nanmedian(widths) < 1.2 * np.nanmedian(numbers)
    assert np.nanmedian(widths) < 1.5 * np.nanmedian(by_hand)
