"""Ranks of one data set's truths among the draws of its posterior."""

import zlib

import numpy as np
from numpy.typing import NDArray

from benchmarks.calibration.cells import Cell
from benchmarks.calibration.truth import Truth, draw_truth
from benchmarks.resumable import Row
from benchmarks.sampling import Sampled, sample
from inference.posterior.sampling.verdict import MAX_R_HAT
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.parameters import parameters_of

__all__ = ["DRAWS", "columns_of", "quantities_of", "rank_row", "ranks_among"]

Array = NDArray[np.float64]

DRAWS = 99  # ranks 0 to 99: a hundred values, which ten bins share evenly


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
        # a hundred ranks need no more than the effective draws asked for and ensembles that agree
        found = sample(cell.sensor, cell.scene, truth.frames, settings, every_gate=False)
    except RefusedError as error:
        return {**row, "converged": 0, "reason": f"refused: {error}"}
    posterior = found.posterior
    enough = found.ess is not None and found.ess >= cell.target_ess
    settled = enough and found.rhat is not None and found.rhat <= MAX_R_HAT
    return {
        **row,
        "converged": int(settled or posterior.verdict.converged),
        "ess": "" if found.ess is None else round(found.ess),
        "rhat": "" if found.rhat is None else float(found.rhat),
        "calls": posterior.runtime.likelihood_calls,
        "fit_p": posterior.fit.p_value,
        "reason": "" if settled else " / ".join(posterior.verdict.reasons),
        **_ranks(cell, truth, found),
    }


def _ranks(cell: Cell, truth: Truth, sampled: Sampled) -> dict[str, int]:
    found = sampled.posterior.draws
    frames = list(cell.ranked_frames)
    draws = _evenly(found.parameters.reshape(-1, len(found.names)))
    ranges = _evenly(found.range_m.reshape(-1, cell.frames)[:, frames])
    density = sampled.job.density()
    # the density judges all unknowns together, which no rank of one of them does
    height = density(density.parameters.standard(draws))
    ranked = ranks_among(
        np.column_stack([draws, height, ranges]),
        np.concatenate([truth.natural, density(truth.z[None, :]), truth.range_m[frames]]),
    )
    return dict(zip(quantities_of(cell), ranked.tolist(), strict=True))
