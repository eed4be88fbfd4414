"""Ranks of one data set's truths among the draws of its posterior."""

import dataclasses
import zlib

import numpy as np
from numpy.typing import NDArray

from benchmarks.calibration.cells import Cell
from benchmarks.calibration.truth import Truth, draw_truth
from benchmarks.resumable import Row
from inference.posterior import fold
from inference.posterior.posterior import Draws
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.parameters import parameters_of

__all__ = ["DRAWS", "columns_of", "quantities_of", "rank_row", "ranks_among"]

Array = NDArray[np.float64]

DRAWS = 99  # ranks 0 to 99: a hundred values, which ten bins share evenly
# counted, not timed: the same ranks on every machine. Chunks are shorter than those of a service
# because a few hundred effective draws are enough here, and a whole chunk gives ten times as many
_MOST_CHUNKS = 100
_MOST_STEPS = 130


def quantities_of(cell: Cell) -> tuple[str, ...]:
    """Return what is ranked: unknowns, the log density, ranges at fixed frames."""
    names = parameters_of(cell.sensor, cell.scene).names
    return (*names, "log density", *(f"range {frame}" for frame in cell.ranked_frames))


def columns_of(cell: Cell) -> tuple[str, ...]:
    """Return the columns of a cell's table."""
    head = ("set", "seed", "version", "converged", "ess", "rhat", "calls", "fit_p", "reason")
    return (*head, *quantities_of(cell))


def ranks_among(draws: Array, truth: Array) -> NDArray[np.intp]:
    """Rank truths, shape (k,), among draws, shape (DRAWS, k)."""
    return np.asarray((draws < truth).sum(axis=0))


def _evenly(draws: Array) -> Array:
    """Thin draws, shape (m, ...), to `DRAWS` that lie as far apart as they can."""
    return np.asarray(draws[np.linspace(0, len(draws) - 1, DRAWS).round().astype(int)])


def rank_row(cell: Cell, number: int, version: str = "") -> Row:
    """Draw a truth and readings, infer, rank.

    Parameters
    ----------
    cell : Cell
        Sensor and scene.
    number : int
        Of the data set: it alone fixes truth, noise and sampling.
    version : str
        Of the code, for the table.

    Returns
    -------
    Row
        Without ranks where the posterior was refused.
    """
    seed = zlib.crc32(cell.slug.encode()) * 1_000_000 + number
    row: dict[str, str | int | float] = {"seed": seed, "version": version}
    truth = draw_truth(cell.sensor, cell.scene, cell.frames, np.random.default_rng([seed, 1]))
    settings = SamplerSettings(
        method="emcee", ensembles=cell.ensembles, seed=seed, target_ess=cell.target_ess
    )
    try:
        job = fold.prepare(cell.sensor, cell.scene, truth.frames, settings)
        checkpoint = fold.start(job)
    except RefusedError as error:
        return {**row, "converged": 0, "reason": f"refused: {error}"}
    for _ in range(_MOST_CHUNKS):
        tasks = fold.tasks(job, checkpoint)
        if not tasks:
            break
        short = [dataclasses.replace(t, steps=min(t.steps, _MOST_STEPS)) for t in tasks]
        checkpoint = fold.merge(job, checkpoint, [fold.run(task) for task in short])
    reached = fold.progress(job, checkpoint)
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    return {
        **row,
        "converged": int(posterior.verdict.converged),
        "ess": "" if reached.ess is None else round(reached.ess),
        "rhat": "" if reached.rhat is None else float(reached.rhat),
        "calls": posterior.runtime.likelihood_calls,
        "fit_p": posterior.fit.p_value,
        "reason": " / ".join(posterior.verdict.reasons),
        **_ranks(cell, truth, job, posterior.draws),
    }


def _ranks(cell: Cell, truth: Truth, job: fold.Job, found: Draws) -> dict[str, int]:
    frames = list(cell.ranked_frames)
    draws = _evenly(found.parameters.reshape(-1, len(found.names)))
    ranges = _evenly(found.range_m.reshape(-1, cell.frames)[:, frames])
    density = job.density()
    # the density judges all unknowns together, which no rank of one of them does
    height = density(density.parameters.standard(draws))
    ranked = ranks_among(
        np.column_stack([draws, height, ranges]),
        np.concatenate([truth.natural, density(truth.z[None, :]), truth.range_m[frames]]),
    )
    return dict(zip(quantities_of(cell), ranked.tolist(), strict=True))
