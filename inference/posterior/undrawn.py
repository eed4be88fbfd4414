"""The answer of a job that has drawn nothing: starting points are no draws, and give no intervals.

What can be said without draws is said: the optima that were found, and what the readings should
tell at the best of them, by the identifiability of the scene.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.frame.blocks import GAIN
from inference.frame.known_range import columns_of, rates_of
from inference.identifiability.before_data import identifiability
from inference.identifiability.status import Identifiability
from inference.posterior.answer.error_parts import ErrorParts, ParameterErrorParts
from inference.posterior.answer.fit import Fit
from inference.posterior.answer.folds import near_fold
from inference.posterior.answer.posterior import RANGE_COLUMNS, ParameterSummary, RangeSummary
from inference.posterior.findings import Findings
from inference.posterior.job import Job
from inference.posterior.stages.stage import Tempering, Walking
from simulator.errors import HybridTofError
from simulator.parameters import OFFSET

__all__ = ["without_draws"]

Array = NDArray[np.float64]

_NOTHING_DRAWN = "nothing was drawn from the posterior: no intervals are known, give it more time"


def without_draws(job: Job, density: CollapsedDensity, stage: Tempering | Walking) -> Findings:
    """Say what is known of a job that has drawn nothing.

    Parameters
    ----------
    job : Job
        In the scene that is sampled.
    stage : Tempering or Walking
        Where it stands, with the optima that were found.

    Returns
    -------
    Findings
        Without a number for any unknown or range; frames near a fold are those of the best fit;
        rows as foreseen, and a fit of which `misfit` is None.
    """
    nan, optima = math.nan, stage.proposal.optima.centres
    no_parts = ParameterErrorParts(nan, nan, nan)
    nothing = ParameterSummary(nan, nan, no_parts, nan, nan, nan, nan, nan, None, nan, ())
    best = optima[[int(np.argmax(density(optima)))]]
    n, folds, foreseen = len(job.frames), np.zeros(len(job.frames), dtype=bool), None
    for part in job.parts():
        own = part.density()
        log_r = own.best_ranges(best)[:, :, 0]
        folds[part.of_sent(np.arange(len(part.frames)))] = near_fold(part, own, best, log_r)
        foreseen = foreseen or _foreseen(part, own, best, log_r[0])
    unknown = {name: np.full(n, nan) for name in RANGE_COLUMNS}
    return Findings(
        (_NOTHING_DRAWN, *stage.verdict.reasons),
        None,
        dict.fromkeys(density.parameters.names, nothing),
        RangeSummary(
            **unknown,
            sd_parts=ErrorParts(*np.full((3, n), nan)),
            near_fold=folds,
            modes=((),) * n,
        ),
        foreseen or (),
        Fit(nan, None, ("not checked: nothing was drawn yet",), nan, nan, (), ()),
    )


def _sds(rates: Array) -> list[float | None]:
    """Return standard deviations for their inverses, None where nothing is known."""
    return [1.0 / rate if rate > 0 else None for rate in rates.tolist()]


def _foreseen(
    job: Job, density: CollapsedDensity, best: Array, log_r: Array
) -> tuple[Identifiability, ...]:
    """Return what frames at the best fit's ranges tell, before any draw.

    No row reads `identified`: that is said of what was drawn, and the best fit may be a false one.
    """
    names = density.parameters.names
    values = density.parameters.natural(best)[0].tolist()
    present = np.isfinite(log_r)
    ranges = np.where(present, np.exp(log_r), 1.0)
    # as they were sent: what the clock errs by is foreseen with the scene
    rates = rates_of(columns_of(job.frames.select(job.usable)))
    # without coefficients it is not used
    warm = None if job.sensor.temperature is None else job.frames.temperature_k
    try:
        found = identifiability(
            job.sensor,
            job.scene,
            ranges.tolist(),
            present.tolist(),
            {name: at for name, at in zip(names, values, strict=True) if name != OFFSET},
            density.frames[:, GAIN].tolist(),
            known_range_sd_m=None if rates is None else _sds(rates[:, 0]),
            displacement_sd_m=None if rates is None else _sds(rates[:, 1]),
            temperature_k=None if warm is None else warm[job.usable].tolist(),
        ).identifiability
    except HybridTofError as error:
        reason = f"not known yet: nothing was drawn, and nothing can be foreseen ({error})"
        return tuple(
            Identifiability(name, "not_identified", math.nan, reason)
            for name in (*names, "range_m")
        )
    rows = []
    for row in found:
        status = "weak" if row.status == "identified" else row.status
        words = row.status.replace("_", " ")
        reason = f"nothing was drawn; foreseen at the best fit so far: {words}, {row.reason}"
        rows.append(dataclasses.replace(row, status=status, reason=reason))
    return tuple(rows)
