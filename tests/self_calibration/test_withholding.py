"""A stream that is not calibrated yet: nothing that may be crosstalk is free, or suddenly sharp.

The crosstalk is as wide as its prior then, and an empty scene explains the light of any object: it
was called free with a probability of 1.4 % of an object whose light was 280 noises.
"""

import dataclasses

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from inference.self_calibration.following import follow
from inference.self_calibration.plan import begin, plan_of
from inference.self_calibration.state import calibration_from_bytes, calibration_to_bytes
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import step
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
READ, CROSSTALK = 1.5e-5, (1.9e-4, 2.2e-3)
SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [READ, READ]}})
STATED = parse_scene(
    {"crosstalk": [{"prior": "halfnormal", "sd": 1.5e-3}, {"prior": "halfnormal", "sd": 6e-3}]}
)
TOLD, EMPTY, N = 30, 60, 75
FREE = 0.05


def _present(told: int, settings: TrackingSettings | None = None) -> NDArray[np.float64]:
    """Probabilities of an object that comes behind 60 empty frames, of which so many are told."""
    there = np.arange(N) >= EMPTY
    times = np.arange(N) / 30
    path = SampledTrajectory(
        range_m=[1.2] * N, time_s=times.tolist(), object_present=there.tolist()
    )
    light = simulate(SENSOR, parse_scene({"object": OBJECT, "discrepancy": 0}), path, 3)
    readings = light.frames.readings + CROSSTALK
    frames = Frames(readings=readings, time_s=times, object_present=np.arange(N) >= told)
    plan = plan_of(SENSOR, STATED, settings or TrackingSettings(), 7)
    _, pieces = follow(plan, begin(plan), frames, range(N))
    return np.concatenate([piece.track.present for piece in pieces])


def test_an_object_that_comes_is_not_called_free() -> None:
    present = _present(TOLD)
    assert (present[EMPTY:] >= FREE).all()
    assert (present[:TOLD] == 0.0).all()
    # what reads as the told frames did is free, but where noise has it beyond 5 %: a false alarm
    # in 1,000
    free = int((present[TOLD:EMPTY] < FREE).sum())
    assert free >= scipy.stats.binom.ppf(1e-3, EMPTY - TOLD, 0.95)


def test_without_a_frame_that_is_told_nothing_is_free() -> None:
    assert (_present(0) >= FREE).all()


@pytest.mark.parametrize("observables", ["w1", "w2"])
def test_one_observable_is_held_to_its_own_frames(observables: str) -> None:
    settings = TrackingSettings.model_validate({"observables": observables})
    present = _present(TOLD, settings=settings)
    assert (present[EMPTY:] >= FREE).all()
    assert (present[TOLD:EMPTY] < FREE).any()


def _to_and_fro() -> Frames:
    """Ten seconds behind empty frames, of an object that the scene does not know."""
    times = np.arange(360) / 30
    there = np.arange(360) >= EMPTY
    path = SampledTrajectory(
        range_m=(0.8 * np.exp(0.5 * np.sin(1.1 * times))).tolist(),
        time_s=times.tolist(),
        object_present=there.tolist(),
    )
    light = simulate(SENSOR, parse_scene({"object": OBJECT, "discrepancy": 0}), path, 4)
    readings = light.frames.readings + CROSSTALK
    return Frames(readings=readings, time_s=times, object_present=np.arange(360) >= TOLD)


def test_ranges_are_never_suddenly_sharp() -> None:
    """Shares fade by no more than 1 / e in three seconds, however the stream is cut."""
    plan, frames = plan_of(SENSOR, STATED, TrackingSettings(), 7), _to_and_fro()
    state, tracks = begin(plan), []
    for start in range(0, len(frames), 24):
        part = frames.select(slice(start, start + 24))
        state, pieces = follow(plan, state, part, range(start, start + len(part)))
        tracks += [piece.track for piece in pieces]
        state = calibration_from_bytes(calibration_to_bytes(state))
    sd, found = (np.concatenate([getattr(t, name) for t in tracks]) for name in ("sd_m", "range_m"))
    one = np.flatnonzero(np.isfinite(sd))
    assert one.size > 100
    assert frames.time_s is not None
    shares, steps = (sd / found)[one], np.diff(frames.time_s[one])
    assert (shares[1:] >= shares[:-1] * np.exp(-steps / 3.0) * (1 - 1e-12)).all()
    # it is the rule that makes them so: the tracker itself is sharper
    _, plain = step(plan.tracker(state.scene), plan.tracker(state.scene).first, frames)
    assert (plain.sd_m[one] < 0.9 * sd[one]).any()
    squares = [
        np.concatenate([getattr(t.sd_parts_m, part) for t in tracks])[one] ** 2
        for part in ("noise", "scene", "model")
    ]
    np.testing.assert_allclose(sum(squares), sd[one] ** 2, rtol=1e-9)
    truth = 0.8 * np.exp(0.5 * np.sin(1.1 * frames.time_s[one]))
    assert np.max(np.abs(found[one] - truth) / sd[one]) < 4.0


def test_a_range_that_is_told_is_as_sharp_as_it_is_told() -> None:
    plan, frames = plan_of(SENSOR, STATED, TrackingSettings(), 7), _to_and_fro()
    assert frames.time_s is not None
    told = np.full(len(frames), np.nan)
    told[200] = 0.8 * np.exp(0.5 * np.sin(1.1 * frames.time_s[200]))
    frames = dataclasses.replace(
        frames, known_range_m=told, known_range_sd_m=np.where(np.isnan(told), np.nan, 0.002)
    )
    _, pieces = follow(plan, begin(plan), frames, range(len(frames)))
    sd, found = (
        np.concatenate([getattr(piece.track, name) for piece in pieces])
        for name in ("sd_m", "range_m")
    )
    assert sd[200] < 0.003
    assert np.nanmax(sd[150:200]) > 0.01  # before, ranges are wide
    assert abs(found[200] - told[200]) < 4 * sd[200]
