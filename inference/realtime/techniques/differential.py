"""Differential time of flight: crosstalk that does not change drops out of derivatives."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status, TechniqueResult
from inference.realtime.assemble import (
    END_BAND,
    NOISE_BAND,
    Candidates,
    Outcome,
    assemble,
    reasons_of,
    with_place,
)
from inference.realtime.derivatives import DERIVATIVE_REASONS, DROWNED_CHANGE, derivatives_of
from inference.realtime.from_curve import candidates_of
from inference.realtime.model_error import model_error_of
from inference.realtime.motion import MotionLaw, law_of_model, law_of_motion
from inference.realtime.net import Net, net_readings
from inference.realtime.phase_reach import phase_reach
from inference.realtime.range_bounds import Bounds, bounds_of
from inference.realtime.solving.curves import differential_phase, differential_ratio
from inference.realtime.solving.ratio_reach import FEW, ratio_reaches
from inference.realtime.turns import contact_m, several_turns, turns_to
from inference.technique import Task, Technique
from simulator.sensor import PulsedSensor, Sensor

__all__ = [
    "DIFFERENTIAL",
    "Targets",
    "at_contact",
    "farthest_by_derivatives",
    "ranges_by_derivatives",
    "target_of",
    "with_law",
]

Array = NDArray[np.float64]

OWN = len(reasons_of())
_REASONS = reasons_of(
    *DERIVATIVE_REASONS,
    "the readings do not change",
    "the derivatives point below zero range within their noise: at or near contact",
    "no range has derivatives of this direction",
    "c0 and c1 are not known: the range lies between the bounds, which noise of two standard "
    "deviations does not pass, if c1 >= 0",
    "c0 and c1 are not known: the range lies between the bounds, if c1 >= 0 and the derivatives, "
    "whose noise is not stated, have none",
)
STILL, CONTACT, NO_RANGE = (OWN + len(DERIVATIVE_REASONS) + i for i in range(3))
_BOUNDS, _EXACT = NO_RANGE + 1, NO_RANGE + 2


@dataclasses.dataclass(frozen=True, eq=False)
class Targets:
    """What derivatives say of the range.

    Attributes
    ----------
    top, bottom : ndarray, shape (n,)
        Of a pulse q = r0 w1' / w2' = top / bottom [m]; of a sine wave the phase modulo pi in
        [0, pi) and 1. nan where there is none.
    sd : ndarray, shape (n,)
        Standard deviation of q or of the phase; nan where the noise is not known.
    contact : ndarray of bool, shape (n,)
        Whether the direction is below zero within its noise.
    still : ndarray of bool, shape (n,)
        Whether nothing changes at all.
    """

    top: Array
    bottom: Array
    sd: Array
    contact: NDArray[np.bool_]
    still: NDArray[np.bool_]


def target_of(task: Task, rate: Net) -> Targets:
    """Reduce derivatives to a ratio or an angle.

    Parameters
    ----------
    task : Task
        Gives the sensor.
    rate : Net
        Derivatives of the readings.

    Returns
    -------
    Targets
        The sign of the motion is not known, so an angle is known modulo pi only.
    """
    sensor = task.sensor
    with np.errstate(all="ignore"):
        # scaled by a power of two, so that nothing overflows or rounds
        size = np.maximum(np.abs(rate.first), np.abs(rate.second))
        still = size == 0
        _, exponent = np.frexp(np.where(np.isfinite(size), size, 1.0))
        d1, d2 = np.ldexp(rate.first, -exponent), np.ldexp(rate.second, -exponent)
        usable = (rate.state == 0) & ~still
        if isinstance(sensor, PulsedSensor):
            ratio = d1 / d2
            variance = rate.variance(1.0 / rate.second, -ratio / rate.second)
            sd = sensor.r0 * np.sqrt(variance)
            top = np.where(usable, sensor.r0 * d1, np.nan)
            contact = (ratio <= 0) & (sensor.r0 * ratio > -NOISE_BAND * sd)
            # a fixed object's flicker is of the noise here, and moves nothing: it is not followed
            if task.scene.motion != "tangential" or sensor.noise.relative is None:
                sd = _followed(rate, sd, sensor.r0)
            return Targets(top, d2, sd, contact | (ratio == 0), still)
        length = np.hypot(d1, d2)
        # turned into the upper half plane first: there a small phase keeps its relative precision
        cosine, sine = math.cos(sensor.known_phase_rad), math.sin(sensor.known_phase_rad)
        x, y = d1 * cosine + d2 * sine, d2 * cosine - d1 * sine
        turned = np.where((y < 0) | ((y == 0) & (x < 0)), -1.0, 1.0)
        phase = np.arctan2(turned * y, turned * x)
        size = np.ldexp(length, exponent)
        sd = np.sqrt(rate.variance(-d2 / length / size, d1 / length / size))
        across = END_BAND * np.sqrt(rate.variance(-sine, cosine))
        contact = (phase > 0.75 * np.pi) & (np.abs(np.ldexp(y, exponent)) < across)
        contact |= phase == 0
        turned = phase_reach(phase, sd, rate, size, np.pi)
        return Targets(np.where(usable, phase, np.nan), np.ones_like(phase), turned, contact, still)


def _followed(rate: Net, sd: Array, r0: float) -> Array:
    """Return standard deviations of a ratio that hold where its lower derivative drowns."""
    bent = np.flatnonzero(np.sqrt(FEW * rate.var2) > np.abs(rate.second))
    if bent.size == 0:
        return sd
    few = rate.select(bent)
    result = sd.copy()
    reach = ratio_reaches(few.first, few.second, few.var1, few.cov, few.var2)
    result[bent] = np.maximum(sd[bent], r0 * reach)
    return result


def farthest_by_derivatives(sensor: Sensor) -> float:
    """Return the range beyond which derivatives tell none [m].

    Parameters
    ----------
    sensor : Sensor
        Of a sine wave phases of derivatives are known modulo pi: half its unambiguous range.
    """
    pulsed = isinstance(sensor, PulsedSensor)
    return sensor.max_range_m if pulsed else sensor.max_range_m / 2


def at_contact(task: Task, candidates: Candidates, contact: NDArray[np.bool_]) -> Candidates:
    """Return what explains a frame at contact: nothing else, or its aliases within stated ranges.

    Parameters
    ----------
    task : Task
        Of a pulse nothing is done, nor where roots are not filtered.
    candidates : Candidates
        All solutions; of frames at contact they may be changed.
    contact : ndarray of bool, shape (n,)
        As of `Targets`.
    """
    if not task.physical or isinstance(task.sensor, PulsedSensor):
        return candidates
    turn = farthest_by_derivatives(task.sensor)
    if not several_turns(task.sensor, task.known, turn):
        candidates.roots[contact] = np.nan
        return candidates
    nearest = contact_m(task, turn)
    return candidates if nearest is None else with_place(candidates, contact, nearest)


def ranges_by_derivatives(task: Task, uneven_too: bool) -> TechniqueResult:
    """Return the ranges that derivatives tell.

    Parameters
    ----------
    uneven_too : bool
        As for `derivatives_of`.
    """
    sensor, known = task.sensor, task.known
    rate = derivatives_of(sensor, known.crosstalk, task.frames, OWN, uneven_too)
    targets = target_of(task, rate)
    pulsed = isinstance(sensor, PulsedSensor)
    turn = farthest_by_derivatives(sensor)
    high = turns_to(task, turn)
    bounds = None
    if task.scene.motion == "tangential":
        candidates = _fixed_distance(task, targets, high)
    elif known.has("object.c0", "object.c1"):
        unit = known.unit
        if pulsed:
            candidates, _ = candidates_of(
                task,
                differential_ratio.CURVE,
                high,
                targets.top / unit,
                targets.sd / unit,
                targets.bottom,
            )
        else:
            candidates, _ = candidates_of(
                task, differential_phase.CURVE, high, targets.top, targets.sd
            )
    else:
        nothing = np.full((targets.top.size, 1), np.nan)
        candidates = _without_folds(nothing, nothing)
        bounds = bounds_of(
            task, (targets.top, targets.bottom, targets.sd), rate, targets.contact, turn
        )
    if bounds is None:
        candidates = at_contact(task, candidates, targets.contact)
    reason = np.where(targets.contact, CONTACT, NO_RANGE)
    reason[targets.still] = STILL
    if bounds is not None:
        reason[bounds.open] = OWN + DROWNED_CHANGE
    support = known.support if task.physical else (0.0, np.inf)
    outcome = Outcome(None, support, reason.astype(np.uint8), _REASONS)
    result = assemble("differential", rate.state, candidates, outcome)
    if bounds is not None:
        result = _bounded(result, bounds, support)
    return _with_motion(task, result, rate)


def _fixed_distance(task: Task, targets: Targets, high: float) -> Candidates:
    """At a fixed range zeta = 1: derivatives have the phase of the range itself (4.66, 4.67)."""
    with np.errstate(all="ignore"):
        if isinstance(task.sensor, PulsedSensor):
            roots, sd = targets.top / targets.bottom, targets.sd
            roots = roots[:, None]
        else:
            k = task.sensor.wave_number
            turns = max(math.ceil(high * k / math.pi), 1)
            roots = (targets.top[:, None] + math.pi * np.arange(turns)) / k
            sd = targets.sd / k
        roots = np.where((roots > 0) & (roots <= high), roots, np.nan)
    error = model_error_of(task).range_m
    found = _without_folds(roots, np.broadcast_to(sd[:, None], roots.shape))
    return dataclasses.replace(found, model=np.broadcast_to(error, roots.shape) if error else None)


def _without_folds(roots: Array, sd: Array) -> Candidates:
    n, m = roots.shape
    return Candidates(roots, sd, np.zeros((n, m), np.bool_), np.zeros(n, np.bool_))


def _bounded(
    result: TechniqueResult, bounds: Bounds, support: tuple[float, float]
) -> TechniqueResult:
    """Answer with bounds: ambiguous where there are any, of the ranges that the scene allows."""
    nearest, farthest = support
    with np.errstate(invalid="ignore"):
        low, high = np.maximum(bounds.near, nearest), np.minimum(bounds.far, farthest)
        inside = (low <= high) & ((result.reason == 0) | (result.reason >= OWN))
        inside &= result.status == Status.NONE
    cut = np.where(inside[:, None], np.column_stack([low, high]), np.nan)
    status = np.where(inside, Status.AMBIGUOUS, result.status).astype(np.uint8)
    said = np.where(bounds.exact, _EXACT, _BOUNDS)
    reason = np.where(inside, said, result.reason).astype(np.uint8)
    return dataclasses.replace(result, status=status, reason=reason, range_bounds_m=cut)


def _with_motion(task: Task, result: TechniqueResult, rate: Net) -> TechniqueResult:
    """Add power law and zeta: measured where crosstalk is known, else those of the model."""
    known, error = task.known, model_error_of(task)
    if known.crosstalk is not None and task.scene.background is None:
        net = net_readings(task.sensor, known.crosstalk, task.frames)
        law = law_of_motion(task.sensor, net, rate, error.range_m)
    elif task.scene.motion == "radial" and known.has("object.c0", "object.c1"):
        shape = known.get("object.c0"), known.get("object.c1")
        law = law_of_model(result.range_m, result.sd_m, shape, error.flux)
    else:
        nothing = np.full(len(result), np.nan)
        law = MotionLaw(nothing, nothing, nothing, nothing)
        if task.scene.motion == "tangential":
            exact = result.status == Status.UNIQUE
            law = law._replace(
                zeta=np.where(exact, 1.0, np.nan), zeta_sd=np.where(exact, 0.0, np.nan)
            )
    return with_law(result, law)


def with_law(result: TechniqueResult, law: MotionLaw) -> TechniqueResult:
    """Return a result with power law and zeta."""
    return dataclasses.replace(
        result,
        power_law=law.power,
        power_law_sd=law.power_sd,
        zeta=law.zeta,
        zeta_sd=law.zeta_sd,
    )


DIFFERENTIAL = Technique(
    name="differential",
    kinds=("pulsed", "sine_wave"),
    observables="derivatives in time of both readings",
    needs=(),
    immune_to=("crosstalk",),
    uses_background=False,
    differential=True,
    cost=160.0,
    equations="4.64-4.68, of a sine wave docs/model.md, exact",
    roots=(
        "1 if c1 >= -1.633 sqrt(c0), else up to 3; without c0 and c1 bounds only; "
        "1 at a fixed range"
    ),
    # along the straight line of tangential motion a chord has the direction of the derivative
    solve=lambda task: ranges_by_derivatives(task, task.scene.motion == "tangential"),
    farthest_m=farthest_by_derivatives,
)
