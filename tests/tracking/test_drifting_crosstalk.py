"""Objects that fade beside crosstalk that drifts as stated."""

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.drifting_crosstalk import C2, drifting, followed
from inference.tracking.hypotheses import LEVEL1, LEVEL2, RESTING, STILL
from inference.tracking.settings import TrackingSettings
from inference.tracking.stillness import crosstalk_is_held, is_still
from inference.tracking.track import step
from inference.tracking.tracker import tracker
from simulator.object_model import object_flux
from tests.tracking.test_stillness import recorded

Array = NDArray[np.float64]

TRACKS, SEEDS = 24, (5, 6)


class _Told(NamedTuple):
    """What is told of some tracks."""

    off: Array  # of all frames with one range [sd]
    light: Array  # of the told ranges [noises]
    answered: float  # share of frames


@functools.cache
def _told() -> _Told:
    off, light, answered = [], [], []
    for seed in SEEDS:
        for number in range(TRACKS):
            of = drifting(seed, number)
            found = followed(of)
            told = np.isfinite(found.range_m) & ~found.misfit
            off.append((np.abs(found.range_m - of.range_m) / found.sd_m)[told])
            c0, c1 = of.shape
            seen = np.asarray(
                object_flux(found.range_m[told], c0 * C2, c0, c1)  # type: ignore[arg-type]
            )
            light.append(seen / of.noise)
            answered.append(float(told.mean()))
    return _Told(np.concatenate(off), np.concatenate(light), float(np.mean(answered)))


def test_intervals_of_90_percent_hold_what_is_faint() -> None:
    """Of told ranges whose light is below 30 noises: 89 %, where 72 % were held.

    Without the far side 78 % are. Of ten runs of 24 tracks with seeds 2 to 11 it is 96 %, with a
    standard deviation of 4.5 % between runs, and these two are of the lowest: were it a normal law,
    two runs with other seeds would be below 85 % once in two thousand.
    """
    told = _told()
    faint = told.light < 30.0
    assert faint.sum() > 3000
    assert np.mean(told.off[faint] < 1.645) > 0.85


def test_objects_that_are_slow_for_a_while_are_not_taken_for_an_empty_scene() -> None:
    """One range in 93.6 % of these frames; it was in 87.5 %, most others taken for an empty scene.

    Of the same ten runs it is 96.8 %, 3.3 % between runs: two others would be below 92 % once in
    50.
    """
    assert _told().answered > 0.92


def _held(drift: float) -> tuple[bool, bool]:
    """Tell whether readings are still after three seconds, and learnt crosstalk held then."""
    sensor, scene, frames = recorded(np.full(90, 0.5), 100.0, 1.0, 3)
    noise = sensor.noise.read[0]
    model = tracker(sensor, scene, TrackingSettings(crosstalk_drift=(drift * noise,) * 2))
    state, _ = step(model, model.first, frames)
    of = state.hypotheses
    # as after a change long ago
    of.numbers[RESTING], of.numbers[LEVEL1], of.numbers[LEVEL2] = 0.0, np.nan, np.nan
    assert of.numbers[STILL] > 0.0
    return is_still(of), crosstalk_is_held(of)


def test_crosstalk_that_drifts_beyond_what_frames_at_rest_tell_is_learnt() -> None:
    """The mean of 90 frames, in three seconds, has a noise of 0.105.

    Crosstalk that drifts by 0.061 noises a root second moves by as much.
    """
    assert _held(0.0) == (True, True)
    assert _held(0.05) == (True, True)
    assert _held(0.07) == (True, False)
    assert _held(2.0) == (True, False)
