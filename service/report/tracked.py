"""The tracker."""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import Track, step, track
from inference.tracking.tracker import tracker
from service.report.cells import Cell
from service.report.clock import alone, best, peak_bytes
from service.report.readings import (
    Readings,
    err_together,
    learns_crosstalk,
    sets_of,
    told_of_object,
)
from service.report.row import Costs, Row
from service.report.scores import Scores, scores_of_roots
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene

__all__ = ["measure_tracker"]

Array = NDArray[np.float64]

_SAID = 0.005  # share of frames from which on a remark tells it


def measure_tracker(cell: Cell, seed: int) -> Row:
    """Measure the tracker on whole ways, the time and memory of the first, and frame by frame."""
    scene = cell.scene
    ways = sets_of(scene, cell.frames, seed, cell.sets)
    made = ways[0]
    settings = TrackingSettings(hypotheses=cell.value)
    told = told_of_object(scene)
    row = Row(
        scene.name,
        "tracker",
        "tracker",
        knob=f"{cell.value} hypothes{'i' if cell.value == 1 else 'e'}s",
        order=float(cell.value),
        frames=sum(int(way.present.sum()) for way in ways),
    )
    run = functools.partial(track, scene.sensor, told, made.frames, settings)
    try:
        found, seconds = best(run)
    except RefusedError as error:
        return dataclasses.replace(row, remark=str(error))
    others = [track(scene.sensor, told, way.frames, settings) for way in ways[1:]]
    together = err_together(scene.sensor, told) and not learns_crosstalk(scene)
    misfit = float(np.mean(np.concatenate([one.misfit for one in (found, *others)])))
    middle, tail = alone(_stepped(cell, told, settings, made.frames))
    return dataclasses.replace(
        row,
        scores=_scores_of_tracks(ways, [found, *others], together),
        costs=Costs(
            frame_s=seconds / len(made.frames),
            p50_s=middle,
            p99_s=tail,
            run_s=seconds,
            peak_bytes=peak_bytes(run),
        ),
        remark=f"says that the model does not fit in {100 * misfit:.0f} % of frames"
        if misfit >= _SAID
        else "",
    )


def _scores_of_tracks(ways: Sequence[Readings], tracks: Sequence[Track], together: bool) -> Scores:
    here = np.concatenate([way.present for way in ways])

    width = max(found.hypotheses_m.shape[1] for found in tracks)

    def side_by_side(name: str) -> Array:
        parts = [getattr(found, name) for found in tracks]
        wide = [
            np.pad(part, ((0, 0), (0, width - part.shape[1])), constant_values=np.nan)
            for part in parts
        ]
        return np.asarray(np.concatenate(wide)[here])

    number = np.zeros(len(ways), int) if together else np.arange(len(ways))
    return scores_of_roots(
        np.concatenate([way.range_m for way in ways])[here],
        np.concatenate([found.range_m for found in tracks])[here],
        np.concatenate([found.status == Status.AMBIGUOUS for found in tracks])[here],
        side_by_side("hypotheses_m"),
        side_by_side("hypotheses_sd_m"),
        side_by_side("hypotheses_weight"),
        np.repeat(number, [way.range_m.size for way in ways])[here]
        if together or len(ways) > 1
        else None,
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
