"""Techniques of single frames."""

import dataclasses
import functools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from inference.realtime.registry import TECHNIQUES
from service.report.cells import Cell
from service.report.clock import alone, best, peak_bytes
from service.report.readings import Readings, err_together, sets_of, told_of_object
from service.report.row import Costs, Row
from service.report.said import said
from service.report.scores import Scores, scores_of_roots
from simulator.scene import Scene

__all__ = ["measure_single"]

Array = NDArray[np.float64]

# frames of a call that stands for one frame: a derivative has neighbours
_NEIGHBOURS = 3


def _scores_of_results(
    sweeps: Sequence[Readings], results: Sequence[TechniqueResult], together: bool
) -> Scores:
    width = max(result.roots_m.shape[1] for result in results)

    def padded(values: Array) -> Array:
        wanted = ((0, 0), (0, width - values.shape[1]))
        return np.pad(values, wanted, constant_values=np.nan)

    roots = np.concatenate([padded(result.roots_m) for result in results])
    sets = np.zeros(len(sweeps), int) if together else np.arange(len(sweeps))
    of = np.repeat(sets, [sweep.range_m.size for sweep in sweeps])
    return scores_of_roots(
        np.concatenate([sweep.range_m for sweep in sweeps]),
        np.concatenate([result.range_m for result in results]),
        np.concatenate([result.status for result in results]) == Status.AMBIGUOUS,
        roots,
        np.concatenate([padded(result.roots_sd_m) for result in results]),
        np.where(np.isfinite(roots), 1.0, np.nan),
        of if together or len(sweeps) > 1 else None,
    )


def _blind(scene: Scene) -> Scene:
    return scene.model_copy(update={"crosstalk": None, "background": None})


def measure_single(cell: Cell, seed: int) -> Row:
    """Measure a technique; one that cannot serve the scene is told that nothing disturbs it."""
    scene, name = cell.scene, cell.name
    sweeps = sets_of(scene, cell.frames, seed, cell.sets, empty=0)
    made = sweeps[0]
    row = Row(scene.name, said(name), "single frames", frames=sum(s.range_m.size for s in sweeps))
    known = told_of_object(scene)
    reason = ""
    for told, scene_told in (("", known), ("that there is neither", _blind(known))):
        if told and scene_told == known:
            continue
        run = functools.partial(estimate, scene.sensor, scene_told, made.frames, [name])
        found = run()
        reasons = {item.name: item.reason for item in found.left_out}
        reason = reason or reasons.get(name, "could not serve this scene")
        if not found.results:
            continue
        found, seconds = best(run)
        others = [estimate(scene.sensor, scene_told, s.frames, [name]) for s in sweeps[1:]]
        middle, tail = alone(_one_by_one(cell, scene_told, made))
        return dataclasses.replace(
            row,
            told=told,
            knob=f"{len(made.frames):,} frames a sweep",
            order=float(cell.frames),
            scores=_scores_of_results(
                sweeps,
                [f.results[0] for f in (found, *others)],
                err_together(scene.sensor, scene_told),
            ),
            costs=Costs(
                frame_s=seconds / len(made.frames),
                p50_s=middle,
                p99_s=tail,
                run_s=seconds,
                peak_bytes=peak_bytes(run),
            ),
            remark=reason if told else "",
        )
    return dataclasses.replace(row, remark=reason)


def _one_by_one(cell: Cell, told: Scene, made: Readings) -> list[Callable[[], object]]:
    """Return calls for single frames, which derivatives give two neighbours, spread over all."""
    total = len(made.frames)
    width = _NEIGHBOURS if TECHNIQUES[cell.name].differential else 1
    starts = np.linspace(0, total - width, cell.value).astype(int).tolist()
    return [
        functools.partial(
            estimate,
            cell.scene.sensor,
            told,
            made.frames.select(slice(start, start + width)),
            [cell.name],
        )
        for start in starts
    ]
