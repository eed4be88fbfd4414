"""What a frame of a stream costs, counted: readings that are evaluated, memory, machine code."""

import gc
import tracemalloc
from collections import Counter
from typing import Any

import numpy as np
import pytest

from inference.tracking import track
from inference.tracking.filter import run_filter
from inference.tracking.state import TrackState
from inference.tracking.track import step
from inference.tracking.tracker import tracker
from simulator.frames import Frames
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.counting import counting, peak_bytes, types_asked_for
from tests.tracking.scenes import FOLDED, PLATE, STEP, Array, scene_of, sensor_of

LEARNT = {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.01}] * 2}


def recorded(truth: dict[str, Any], ranges: Array, read: float) -> Frames:
    times = (STEP * np.arange(ranges.size)).tolist()
    way = SampledTrajectory(range_m=ranges.tolist(), time_s=times)
    return simulate(sensor_of(read), scene_of(truth), way, 2).frames


@pytest.mark.parametrize(
    ("scene", "more", "way", "read", "most"),
    [
        # one hypothesis: the steps to the top of its mode, its integral, and an update
        (PLATE, {}, (0.5, 0.7), 1e-5, 13.0),
        # two of them, merged and parted again at a fold that is wide with noise
        (FOLDED, {}, (0.7, 1.2), 1e-3, 250.0),
        # crosstalk that is learnt: its errors and the range's are integrated together
        (PLATE, LEARNT, (0.5, 0.7), 1e-5, 190.0),
    ],
    ids=["one", "fold", "learnt"],
)
def test_readings_evaluated_for_a_frame(
    monkeypatch: pytest.MonkeyPatch,
    scene: dict[str, Any],
    more: dict[str, Any],
    way: tuple[float, float],
    read: float,
    most: float,
) -> None:
    """Today 9.5, 198 and 148; the margin is a quarter."""
    total: Counter[str] = Counter()
    monkeypatch.setattr(track, "run_filter", counting(run_filter, total))
    frames = recorded(scene, np.linspace(*way, 40), read)
    model = tracker(sensor_of(read), scene_of({**scene, **more}))
    state, _ = step(model, model.first, frames.select(slice(0, 10)))
    total.clear()
    step(model, state, frames.select(slice(10, None)))
    assert 0 < total["readings_table.mean_at"] <= most * 30


def test_memory_of_a_step() -> None:
    """A frame leaves nothing behind but the state, whose size does not change."""
    frames = recorded(PLATE, np.linspace(0.5, 0.7, 150), 1e-5)
    model = tracker(sensor_of(1e-5), scene_of(PLATE))
    state: TrackState = model.first

    def advance(first: int, last: int) -> None:
        nonlocal state
        for k in range(first, last):
            state, _ = step(model, state, frames.select(slice(k, k + 1)))

    advance(0, 20)
    # today 60 kB: room for candidates and hypotheses of a frame, made anew for each call
    assert peak_bytes(lambda: advance(20, 21)) < 80_000
    advance(21, 30)
    at_30 = state
    grown = []
    for _ in range(3):  # in one of them machine code may be made
        tracemalloc.start(1)
        try:
            advance(30, 40)
            before = tracemalloc.get_traced_memory()[0]
            advance(40, 140)
            gc.collect()
            grown.append(tracemalloc.get_traced_memory()[0] - before)
        finally:
            tracemalloc.stop()
        state = at_30
    # lists of free objects fill up by 43 bytes a step today; a report that is kept has 900
    assert min(grown) < 150 * 100


def test_the_filter_is_compiled_once_for_a_kind_of_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the scene, nor how many frames come at a time, nor what is learnt counts."""
    asked = types_asked_for(monkeypatch)
    frames = recorded(PLATE, np.linspace(0.5, 0.7, 6), 1e-5)
    for scene in (PLATE, {**PLATE, **LEARNT}, FOLDED):
        model = tracker(sensor_of(1e-5), scene_of(scene))
        state, _ = step(model, model.first, frames.select(slice(0, 1)))
        gain = Frames(frames.readings, frames.time_s, gain=np.ones(6)).select(slice(1, 6, 2))
        step(model, state, gain)
    (name,) = (name for name in asked if name.endswith(".run_filter"))
    assert len(asked[name]) == 1
