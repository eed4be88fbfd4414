"""Posteriors."""

import dataclasses
import functools
import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from service.report.cells import Cell
from service.report.clock import quantiles, timed, traced
from service.report.readings import Readings, sets_of
from service.report.row import Costs, Row, order_of
from service.report.scores import Scores, crps_of_draws, scores_of
from simulator.errors import HybridTofError

__all__ = ["POSTERIORS", "measure_posterior", "not_tried"]

Array = NDArray[np.float64]

POSTERIORS = ("importance", "emcee")
"""Families of cells that are posteriors."""

# processor time after which a posterior is given up; what it has then would be the machine's, and
# is not shown
_MOST_S = 60.0
# tracing memory slows a posterior, at most so much: what is traced is not given up for that
_SLOWER = 5.0
_GIVEN_UP = f"no verdict within {_MOST_S:g} s of processor time"


def measure_posterior(cell: Cell, seed: int) -> Row:
    """Measure posteriors of several data sets, of the last the memory and not the time.

    Tracing memory slows what it measures. Of one set alone the time is measured.
    """
    scene = cell.scene
    sets = sets_of(scene, cell.frames, seed, cell.sets)
    settings = SamplerSettings.model_validate(
        {"method": cell.family, "target_ess": cell.value, "seed": seed, "max_seconds": _MOST_S}
    )
    row = _row(cell)
    answers: list[Posterior | None] = []
    seconds: list[float] = []
    refused: list[str] = []
    peak = None
    for number, made in enumerate(sets):
        last = number > 0 and number == len(sets) - 1
        chosen = (
            settings.model_copy(update={"max_seconds": _SLOWER * _MOST_S}) if last else settings
        )
        run = functools.partial(infer, scene.sensor, scene.free, made.frames, chosen)
        try:
            if last:
                answer, peak = traced(run)
            else:
                answer, used = timed(run)
                seconds.append(used)
        except HybridTofError as error:
            refused.append(str(error))
            answers.append(None)
            continue
        if any(reason.startswith("stopped at the time limit") for reason in answer.verdict.reasons):
            return dataclasses.replace(row, remark=_GIVEN_UP)
        answers.append(answer)
    served = [answer for answer in answers if answer is not None]
    if not served:
        return dataclasses.replace(row, remark=f"refused: {refused[0]}")
    # where the one that was traced is the only one, its time is not known
    run_s = float(np.median(seconds)) if seconds else None
    effective = float(np.median([_effective(answer) for answer in served]))
    passed = all(answer.verdict.converged for answer in served)
    known = passed and run_s is not None and math.isfinite(effective)
    return dataclasses.replace(
        row,
        scores=_scores_of_posteriors(sets, answers),
        costs=Costs(
            frame_s=None if run_s is None else run_s / cell.frames,
            p50_s=None if run_s is None else quantiles(seconds)[0] / cell.frames,
            p99_s=None if run_s is None else quantiles(seconds)[1] / cell.frames,
            run_s=run_s,
            peak_bytes=peak,
            draws_per_s=effective / run_s if known and run_s is not None else None,
        ),
        likelihood_calls=int(np.median([answer.runtime.likelihood_calls for answer in served])),
        effective_draws=effective if math.isfinite(effective) else None,
        remark=_remark(answers, refused),
    )


def not_tried(cell: Cell, earlier: Row) -> Row | None:
    """Return the row of a posterior where one of its scene was given up; None where it was not."""
    row = _row(cell)
    if earlier.remark != _GIVEN_UP or (earlier.scene, earlier.method) != (row.scene, row.method):
        return None
    return dataclasses.replace(row, remark=f"not tried: {earlier.knob}: {_GIVEN_UP}")


def _row(cell: Cell) -> Row:
    return Row(
        cell.scene.name,
        "posterior, weighted draws" if cell.family == "importance" else "posterior",
        "posterior",
        knob=f"{cell.frames} frames, {cell.value} draws",
        order=order_of(cell.frames, cell.value),
        frames=cell.frames * cell.sets,
    )


def _effective(answer: Posterior) -> float:
    return min((min(p.ess_bulk, p.ess_tail) for p in answer.parameters.values()), default=math.nan)


def _remark(answers: Sequence[Posterior | None], refused: Sequence[str]) -> str:
    served = [answer for answer in answers if answer is not None]
    passed = sum(answer.verdict.converged for answer in served)
    several = len(answers) > 1
    words = []
    if passed:
        words.append(f"verdict passed{f' in {passed} of {len(answers)} sets' * several}")
    failed = Counter(
        "; ".join(answer.verdict.reasons) for answer in served if not answer.verdict.converged
    )
    words += [f"{reason}{f' ({count} sets)' * several}" for reason, count in failed.items()]
    words += [
        f"refused: {reason}{f' ({count} sets)' * several}"
        for reason, count in Counter(refused).items()
    ]
    misfits = sum(answer.fit.misfit is True for answer in served)
    if misfits:
        words.append(
            f"says that the model does not fit{f' in {misfits} of {len(answers)} sets' * several}"
        )
    return ", ".join(words)


def _scores_of_posteriors(sets: Sequence[Readings], answers: Sequence[Posterior | None]) -> Scores:
    """Sum up frames of several sets; those of a refused set have no range."""
    parts = [_columns(made, answer) for made, answer in zip(sets, answers, strict=True)]
    truth, middle, several, held, crps = (
        np.concatenate([part[k] for part in parts]) for k in range(5)
    )
    of = np.repeat(np.arange(len(parts)), [part[0].size for part in parts])
    return scores_of(truth, middle, several.astype(bool), held, crps, of)


def _columns(made: Readings, answer: Posterior | None) -> tuple[Array, ...]:
    here = made.present
    truth = made.range_m[here]
    nothing = np.full(truth.size, np.nan)
    if answer is None:
        return truth, nothing, np.zeros(truth.size), nothing, nothing
    found = answer.range_m
    several = np.array([len(modes) > 1 for modes in found.modes])[here]
    low, middle, high = found.q05[here], found.q50[here], found.q95[here]
    held = np.where(np.isfinite(low), (low <= truth) & (truth <= high), np.nan)
    draws = answer.draws.range_m.reshape(-1, here.size)[:, here]
    drawn = len(draws) > 0 and answer.drawn
    crps = crps_of_draws(truth, draws) if drawn else nothing
    return truth, np.where(several, np.nan, middle), several.astype(float), held, crps
