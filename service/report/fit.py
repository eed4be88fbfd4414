"""Techniques of many frames."""

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from service.report.cells import Cell
from service.report.clock import quantiles, timed, traced
from service.report.readings import Readings, sets_of, told_of_object
from service.report.row import Costs, Row
from service.report.said import said
from service.report.scores import scores_of_roots

__all__ = ["measure_fit"]

Array = NDArray[np.float64]


def measure_fit(cell: Cell, seed: int) -> Row:
    """Measure a fit on several data sets, of the last the memory and not the time.

    Tracing memory slows what it measures. One that needs the object known is told it.
    """
    scene, name = cell.scene, cell.name
    sets = sets_of(scene, cell.frames, seed, cell.sets)
    row = Row(
        scene.name,
        said(name),
        "many frames",
        knob=f"{cell.frames} frames",
        order=float(cell.frames),
        frames=cell.frames * len(sets),
    )
    reason = ""
    for scene_told in (scene.free, told_of_object(scene)):
        runs = [
            functools.partial(estimate, scene.sensor, scene_told, made.frames, [name])
            for made in sets
        ]
        runs[0]()  # for the compiler
        *timed_ones, last = runs
        pairs = [timed(run) for run in timed_ones]
        whole, peak = traced(last)
        answers = [*(found for found, _ in pairs), whole]
        served = [found.results[0] if found.results else None for found in answers]
        reasons = {item.name: item.reason for found in answers for item in found.left_out}
        reason = reason or reasons.get(name, "")
        if not any(served):
            continue
        seconds = [used for _, used in pairs]
        width = max(result.roots_m.shape[1] for result in served if result is not None)
        parts = [_columns(made, result, width) for made, result in zip(sets, served, strict=True)]
        truth, single, several, roots, sd = (
            np.concatenate([part[k] for part in parts]) for k in range(5)
        )
        middle, tail = quantiles(seconds)
        missed = sum(result is None for result in served)
        object_told = scene_told is not scene.free
        remarks = [
            "told the object" if object_told else "",
            f"{missed} of {len(sets)} sets refused: {reason}" if missed else "",
        ]
        return dataclasses.replace(
            row,
            scores=scores_of_roots(
                truth,
                single,
                several.astype(bool),
                roots,
                sd,
                np.where(np.isfinite(roots), 1.0, np.nan),
                np.repeat(np.arange(len(parts)), [part[0].size for part in parts]),
            ),
            costs=Costs(
                frame_s=float(np.median(seconds)) / cell.frames,
                p50_s=middle / cell.frames,
                p99_s=tail / cell.frames,
                run_s=float(np.median(seconds)),
                peak_bytes=peak,
            ),
            remark=", ".join(filter(None, remarks)),
        )
    return dataclasses.replace(row, remark=reason)


def _columns(made: Readings, result: TechniqueResult | None, width: int) -> tuple[Array, ...]:
    here = made.present
    truth = made.range_m[here]
    if result is None:
        nothing = np.full((truth.size, width), np.nan)
        return truth, nothing[:, 0], np.zeros(truth.size), nothing, nothing
    pad = ((0, 0), (0, width - result.roots_m.shape[1]))
    roots, sd = (
        np.pad(part[here], pad, constant_values=np.nan)
        for part in (result.roots_m, result.roots_sd_m)
    )
    return truth, result.range_m[here], result.status[here] == Status.AMBIGUOUS, roots, sd
