"""Derivatives with a known background in them: immune to both terms, two roots as a rule."""

import numpy as np

from inference.estimates import TechniqueResult
from inference.realtime.assemble import NOISE_BAND, Outcome, assemble, reasons_of
from inference.realtime.derivatives import DERIVATIVE_REASONS, derivatives_of
from inference.realtime.from_curve import candidates_of
from inference.realtime.model_error import model_error_of
from inference.realtime.motion import law_of_model
from inference.realtime.solving.curves import both_phase, both_ratio
from inference.realtime.techniques.differential import (
    at_contact,
    farthest_by_derivatives,
    target_of,
    with_law,
)
from inference.realtime.turns import turns_to
from inference.technique import Task, Technique
from simulator.sensor import PulsedSensor

__all__ = ["BACKGROUND_CANCELLING_DIFFERENTIAL"]


_OWN = len(reasons_of())
_REASONS = reasons_of(
    *DERIVATIVE_REASONS,
    "the readings do not change",
    "the derivatives point below zero range within their noise: at or near contact",
    "no range before the background has derivatives of this direction",
)
_STILL, _CONTACT, _NO_RANGE = (_OWN + len(DERIVATIVE_REASONS) + i for i in range(3))


def _solve(task: Task) -> TechniqueResult:
    sensor, known = task.sensor, task.known
    rate = derivatives_of(sensor, known.crosstalk, task.frames, _OWN)
    targets = target_of(task, rate)
    # before the wall
    high = min(known.get("background.distance_m"), turns_to(task, farthest_by_derivatives(sensor)))
    if isinstance(sensor, PulsedSensor):
        unit = known.unit
        candidates, _ = candidates_of(
            task,
            both_ratio.CURVE,
            high,
            targets.top / unit,
            targets.sd / unit,
            targets.bottom,
        )
    else:
        candidates, _ = candidates_of(task, both_phase.CURVE, high, targets.top, targets.sd)
        candidates = at_contact(task, candidates, targets.contact)
    physical = None
    if task.physical:
        # the visible share of the background is not negative beyond -c1'
        with np.errstate(invalid="ignore"):
            slack = NOISE_BAND * np.where(np.isfinite(candidates.noise), candidates.noise, 0.0)
            slack += 1e-12 * candidates.roots
            physical = candidates.roots + known.get("background.shadow.c1") >= -slack
    reason = np.where(targets.contact, _CONTACT, _NO_RANGE)
    reason[targets.still] = _STILL
    support = known.support if task.physical else (0.0, np.inf)
    outcome = Outcome(physical, support, reason.astype(np.uint8), _REASONS)
    result = assemble("background_cancelling_differential", rate.state, candidates, outcome)
    shape = known.get("object.c0"), known.get("object.c1")
    flux = model_error_of(task).flux
    return with_law(result, law_of_model(result.range_m, result.sd_m, shape, flux))


BACKGROUND_CANCELLING_DIFFERENTIAL = Technique(
    name="background_cancelling_differential",
    kinds=("pulsed", "sine_wave"),
    observables="derivatives in time of both readings",
    needs=(
        "object.c0",
        "object.c1",
        "object.c2",
        "background.strength",
        "background.distance_m",
        "background.shadow.c0",
        "background.shadow.c1",
    ),
    immune_to=("crosstalk", "background"),
    uses_background=True,
    differential=True,
    cost=400.0,
    equations="4.83; of a sine wave docs/model.md, exact",
    roots="2 as a rule, 1 for a bright object, up to 3; sine wave: more at high frequencies",
    solve=_solve,
    farthest_m=farthest_by_derivatives,
)
