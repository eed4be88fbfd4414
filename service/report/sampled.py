"""Posteriors."""

import dataclasses
import math

import numpy as np

from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from service.report.cells import Cell
from service.report.clock import peak_bytes, timed
from service.report.readings import Readings, readings_of
from service.report.row import Costs, Row
from service.report.scores import Scores, crps_of_draws, scores_of
from simulator.errors import HybridTofError, RefusedError

__all__ = ["measure_posterior"]

# processor time after which a posterior is given up: never reached where figures are to be the same
_MOST_S = 400.0


def measure_posterior(cell: Cell, seed: int) -> Row:
    """Measure a posterior after a short one, which compiles and tells the memory."""
    scene = cell.scene
    made = readings_of(scene, cell.frames, seed, scene.empty)
    weighted = cell.family == "importance"
    row = Row(
        scene.name,
        "posterior, weighted draws" if weighted else "posterior",
        "posterior",
        knob=f"{cell.frames} frames, {cell.value} draws",
        order=float(cell.frames * 10_000 + cell.value),
        frames=cell.frames,
    )

    def run(draws: int) -> Posterior:
        settings = SamplerSettings.model_validate(
            {
                "method": cell.family,
                "target_ess": draws,
                "seed": seed,
                "max_seconds": _MOST_S,
            }
        )
        return infer(scene.sensor, scene.free, made.frames, settings)

    try:
        # for the compiler, and for the memory: tracing it slows what it measures
        peak = peak_bytes(lambda: run(10))
        answer, seconds = timed(lambda: run(cell.value))
    except RefusedError as error:
        return dataclasses.replace(row, remark=f"refused: {error}")
    except HybridTofError as error:
        return dataclasses.replace(row, remark=str(error))
    effective = min(
        (min(p.ess_bulk, p.ess_tail) for p in answer.parameters.values()), default=math.nan
    )
    passed = answer.verdict.converged
    words = ["verdict passed" if passed else "; ".join(answer.verdict.reasons)]
    if answer.fit.misfit:
        words.append("says that the model does not fit")
    return dataclasses.replace(
        row,
        scores=_scores_of_posterior(made, answer),
        costs=Costs(
            frame_s=seconds / cell.frames,
            run_s=seconds,
            peak_bytes=peak,
            draws_per_s=effective / seconds if passed and math.isfinite(effective) else None,
        ),
        likelihood_calls=answer.runtime.likelihood_calls,
        effective_draws=effective if math.isfinite(effective) else None,
        remark=", ".join(words),
    )


def _scores_of_posterior(made: Readings, answer: Posterior) -> Scores:
    here, found = made.present, answer.range_m
    truth = made.range_m[here]
    counts = np.array([len(modes) for modes in found.modes])[here]
    several = counts > 1
    low, middle, high = found.q05[here], found.q50[here], found.q95[here]
    held = np.where(np.isfinite(low), (low <= truth) & (truth <= high), np.nan)
    draws = answer.draws.range_m.reshape(-1, here.size)[:, here]
    drawn = len(draws) > 0 and answer.drawn
    crps = crps_of_draws(truth, draws) if drawn else np.full(truth.size, np.nan)
    return scores_of(truth, np.where(several, np.nan, middle), several, held, crps)
