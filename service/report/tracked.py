"""The tracker."""

import dataclasses
import functools
import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, step, track
from inference.tracking.tracker import tracker
from service.report.cells import Cell
from service.report.clock import alone, best, peak_bytes
from service.report.readings import err_together, sets_of, told_of_object
from service.report.row import Costs, Row
from service.report.scores import Scores, scores_of_roots
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene

__all__ = ["measure_tracker"]

Array = NDArray[np.float64]


def measure_tracker(cell: Cell, seed: int) -> Row:
    """Measure the tracker on a whole way, and frame by frame."""
    scene = cell.scene
    (made,) = sets_of(scene, cell.frames, seed, 1)
    settings = TrackingSettings(hypotheses=cell.value)
    told = told_of_object(scene)
    row = Row(
        scene.name,
        "tracker",
        "tracker",
        knob=f"{cell.value} hypothes{'i' if cell.value == 1 else 'e'}s",
        order=float(cell.value),
        frames=int(made.present.sum()),
    )
    run = functools.partial(track, scene.sensor, told, made.frames, settings)
    try:
        found, seconds = best(run)
    except RefusedError as error:
        return dataclasses.replace(row, remark=str(error))
    here = made.present
    middle, tail = alone(_stepped(cell, told, settings, made.frames))
    return dataclasses.replace(
        row,
        scores=_scores_of_track(made.range_m[here], found, here, err_together(scene.sensor, told)),
        costs=Costs(
            frame_s=seconds / len(made.frames),
            p50_s=middle,
            p99_s=tail,
            run_s=seconds,
            peak_bytes=peak_bytes(run),
        ),
    )


def _scores_of_track(truth: Array, found: Track, here: NDArray[np.bool_], together: bool) -> Scores:
    several = found.status[here] == Status.AMBIGUOUS
    return scores_of_roots(
        truth,
        found.range_m[here],
        np.asarray(several),
        found.hypotheses_m[here],
        found.hypotheses_sd_m[here],
        found.hypotheses_weight[here],
        np.zeros(truth.size, int) if together else None,
    )


def _stepped(
    cell: Cell, told: Scene, settings: TrackingSettings, frames: Frames
) -> list[Callable[[], object]]:
    """Return calls that take in one frame after another."""
    model = tracker(cell.scene.sensor, told, settings)
    states = [model.first]
    count = itertools.count()

    def next_one() -> None:
        k = next(count)
        states[0] = step(model, states[0], frames.select(slice(k, k + 1)))[0]

    return [next_one] * min(60, len(frames))
