"""What a frame of a stream costs, counted: readings that are evaluated, memory, machine code."""

import functools
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
    # in one of ten machine code may be made
    steps = [functools.partial(advance, k, k + 1) for k in range(20, 30)]
    assert min(peak_bytes(one) for one in steps) < 80_000
    at_30 = state
    # what making or reading machine code in between leaves is not the tracker's
    own = [tracemalloc.Filter(True, "*/inference/*"), tracemalloc.Filter(True, __file__)]
    grown = []
    tracemalloc.start(1)
    try:
        for frame in (40, 140):
            advance(30, frame)
            state = at_30
            gc.collect()
            held = tracemalloc.take_snapshot().filter_traces(own)
            grown.append(sum(trace.size for trace in held.traces))
    finally:
        tracemalloc.stop()
    # today 43 bytes a step at most; a report that is kept has 900
    assert grown[1] - grown[0] < 150 * 100


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
