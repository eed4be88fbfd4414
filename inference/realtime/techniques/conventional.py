"""Conventional time of flight: r = r0 w1 / w2, or the phase over k."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import SdParts, Status, TechniqueResult
from inference.realtime.assemble import (
    DROWNED,
    END_BAND,
    NEGATIVE,
    OUTSIDE,
    Candidates,
    Outcome,
    assemble,
    reasons_of,
    with_place,
)
from inference.realtime.model_error import model_error_of
from inference.realtime.net import (
    ABSENT,
    SATURATED,
    UNREPRESENTABLE,
    Net,
    known_net_readings,
)
from inference.realtime.phase_reach import phase_reach
from inference.realtime.solving.pulse_ratio import (
    Codes,
    Columns,
    Pulse,
    explain,
    follow_noise,
    pulsed_ranges,
    ranges_alone,
)
from inference.realtime.turns import contact_m, several_turns, turns_to
from inference.technique import Task, Technique
from simulator.frames import Frames
from simulator.sensor import PulsedSensor, Sensor, SineWaveSensor

__all__ = ["CONVENTIONAL", "conventional_range"]

Array = NDArray[np.float64]
Pair = tuple[float, float]

_REASONS = reasons_of(
    "no light: w2 is not positive",
    "w1 is not positive: at or near contact, or too little light",
    "w1 is above w2: beyond r0, or too little light",
    "no signal: i and q are zero",
    "the phase is below zero within its noise: at or near contact",
    "the phase is below zero within its noise: at or near contact, or at the end of the "
    "unambiguous range",
    NEGATIVE,
    "w1 is above w2 by far more than noise: the crosstalk, the noise or the order of the readings "
    "is not as stated",
)
_DARK, _CONTACT, _BEYOND, _SILENT, _WRAPPED, _EITHER, _NEGATIVE, _SWAPPED = range(
    len(_REASONS) - 8, len(_REASONS)
)
_SLACK = 8 * float(np.finfo(float).eps)
_CODES = Codes(
    dark=_DARK,
    contact=_CONTACT,
    beyond=_BEYOND,
    outside=OUTSIDE,
    lost=UNREPRESENTABLE,
    saturated=SATURATED,
    drowned=DROWNED,
    negative=_NEGATIVE,
    swapped=_SWAPPED,
)


def conventional_range(sensor: Sensor, frames: Frames, crosstalk: Pair = (0.0, 0.0)) -> Array:
    """Return the conventional range alone, as fast as two readings can be divided.

    Parameters
    ----------
    frames : Frames
        The frames, n of them.
    crosstalk : (float, float)
        Known crosstalk, subtracted first [reading units].

    Returns
    -------
    ndarray, shape (n,)
        Range [m]; nan where the readings give none: a pulse needs 0 < w1 <= w2, a sine wave any
        signal. Nothing is said of noise, saturation or empty scenes: that is `estimate`.
    """
    late, whole = crosstalk
    if isinstance(sensor, PulsedSensor):
        flat = np.ascontiguousarray(frames.readings).reshape(-1)
        ranges = ranges_alone(flat, sensor.r0, late, whole)
        if sensor.timing_offset_s is not None:
            ranges -= sensor.known_shift_m
            ranges[ranges <= 0] = np.nan
        return ranges
    with np.errstate(all="ignore"):
        x, y = frames.readings[:, 0] - late, frames.readings[:, 1] - whole
        phase = _phase(x, y, sensor.known_phase_rad)
        phase[((x == 0) & (y == 0)) | ~np.isfinite(x + y)] = np.nan
        phase /= sensor.wave_number
    return phase


def _phase(x: Array, y: Array, offset: float) -> Array:
    """Return the phase less an offset, in [0, 2 pi]: 2 pi where rounding hides a sign."""
    phase = np.arctan2(y, x)
    phase -= offset
    if abs(offset) > math.pi:
        return np.asarray(np.mod(phase, 2 * np.pi))
    # one turn is enough, and np.mod costs as much as the arctangent
    phase[phase >= 2 * math.pi] -= 2 * math.pi
    phase[phase < 0] += 2 * math.pi
    return phase


def _beside_zero(net: Net, phase: float, error: float) -> NDArray[np.bool_]:
    """Tell whether errors may have brought a signal across a phase, which lies about its own.

    Those of noise, and a standard deviation of the phase itself [rad].
    """
    cosine, sine = math.cos(phase), math.sin(phase)
    along = cosine * net.first + sine * net.second
    across = cosine * net.second - sine * net.first
    sd = np.hypot(np.sqrt(net.variance(-sine, cosine)), along * error)
    return np.asarray((along > 0) & (np.abs(across) < END_BAND * sd))


def _same(value: float, n: int) -> Array:
    """Return a column of one number, which takes no memory; as np.broadcast_to, in a tenth."""
    column: Array = np.ndarray((n, 1), np.float64, np.array([value]), strides=(0, 0))
    column.flags.writeable = False
    return column


def _solve_pulsed(task: Task, sensor: PulsedSensor) -> TechniqueResult:
    assert task.known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    frames = task.frames
    n = len(frames)
    low, high = task.known.support if task.physical else (0.0, math.inf)
    full_late, full_whole = sensor.full_scale or (math.inf, math.inf)
    crosstalk_late, crosstalk_whole = task.known.crosstalk
    # w1 = w2 (r + shift) / r0
    shift = sensor.known_shift_m
    pulse = Pulse(
        r0=sensor.r0,
        crosstalk_late=crosstalk_late,
        crosstalk_whole=crosstalk_whole,
        read=sensor.noise.read,
        shot=sensor.noise.shot,
        flicker=sensor.noise.relative if sensor.noise.flickers else 0.0,
        low=low * (1 - _SLACK) + shift,
        high=high * (1 + _SLACK) + shift,
        full_late=full_late,
        full_whole=full_whole,
        error=model_error_of(task).range_m,
        band=END_BAND,
    )
    # one block for all columns: freshly mapped pages would cost more than the arithmetic
    block = np.empty(35 * n, dtype=np.uint8)
    roots, sds, noise = (block[8 * i * n : 8 * (i + 1) * n].view(np.float64) for i in range(3))
    count = block[24 * n : 32 * n].view(np.intp)
    status, reason, near = (block[(32 + i) * n : (33 + i) * n] for i in range(3))
    columns = Columns(roots, sds, noise, reason, near)
    flat = np.ascontiguousarray(frames.readings).reshape(-1)
    bad, faint = pulsed_ranges(flat, pulse, columns)
    if faint:
        follow_noise(flat, pulse, columns)
    count.fill(1)
    status.fill(Status.UNIQUE)
    if bad:
        explain(flat, pulse, _CODES, columns)
    if shift != 0.0:
        roots -= shift
    if frames.object_present is not None:
        absent = ~frames.object_present & (reason != SATURATED)
        reason[absent], roots[absent], sds[absent] = ABSENT, np.nan, np.nan
        near[absent] = 0
        bad += int(np.count_nonzero(absent))
    if bad:
        rootless = np.isnan(roots)
        status[rootless] = Status.NONE
        status[reason == SATURATED] = Status.SATURATED
        count[rootless] = 0
    return TechniqueResult(
        technique="conventional",
        status=status,
        roots_m=roots[:, None],
        roots_sd_m=sds[:, None],
        sd_parts_m=SdParts(columns.noise[:, None], _same(0.0, n), _same(pulse.error, n)),
        root_count=count,
        near_fold=near.view(np.bool_),
        reason=reason,
        reasons=_REASONS,
    )


def _solve_sine_wave(task: Task, sensor: SineWaveSensor) -> TechniqueResult:
    net = known_net_readings(task)
    k, error = sensor.wave_number, model_error_of(task).range_m
    support = task.known.support if task.physical else (0.0, np.inf)
    with np.errstate(all="ignore"):
        modulus = np.hypot(net.first, net.second)
        phase = _phase(net.first, net.second, sensor.known_phase_rad)
        safe = np.where(modulus > 0, modulus, 1.0)
        # gradient of the phase: (-q, i) / modulus^2
        sd = np.sqrt(net.variance(-net.second / safe / safe, net.first / safe / safe))
        turned = phase_reach(phase, sd, net, safe, 2 * np.pi)
        # a range that the scene allows lies within the noise of zero, or this is the far end
        turn, turns = sensor.max_range_m, 1
        several = several_turns(sensor, task.known, turn)
        # of one turn noise alone is asked
        beside = _beside_zero(
            net, sensor.known_phase_rad + k * support[0], k * error if several else 0.0
        )
        contact = ((phase > np.pi) & beside) | (phase == 0.0)
        usable = (modulus > 0) & np.isfinite(modulus)
        if task.physical and not several:
            usable &= ~contact
        high = turns_to(task, turn)
        if task.high_m is not None or several:
            turns = max(math.ceil(high * k / (2 * math.pi)), 1)
        phases = phase[:, None] + 2 * np.pi * np.arange(turns)
        roots = np.where(usable[:, None], phases / k, np.nan)
        if task.high_m is not None or several:
            roots[roots > high] = np.nan
        candidates = Candidates(
            roots=roots,
            noise=np.broadcast_to((turned / k)[:, None], roots.shape),
            model=np.broadcast_to(error, roots.shape) if error > 0 else None,
            near=np.zeros(roots.shape, dtype=np.bool_),
            near_frame=np.zeros(len(task.frames), dtype=np.bool_),
        )
        if (nearest := contact_m(task, turn)) is not None:
            candidates = with_place(candidates, contact & usable, nearest)
        far = (phase > np.pi) & (phase <= k * support[1])
    wrapped = np.where(far, _EITHER, _WRAPPED)
    reason = np.where(modulus > 0, wrapped, _SILENT).astype(np.uint8)
    outcome = Outcome(None, support, reason, _REASONS)
    return assemble("conventional", net.state, candidates, outcome)


def _solve(task: Task) -> TechniqueResult:
    if isinstance(task.sensor, PulsedSensor):
        return _solve_pulsed(task, task.sensor)
    return _solve_sine_wave(task, task.sensor)


CONVENTIONAL = Technique(
    name="conventional",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q",
    needs=(),
    immune_to=("discrepancy",),  # of the flux, which cancels in the ratio and in the phase
    uses_background=False,
    differential=False,
    cost=1.0,
    equations="4.47, 4.48 (r0 w1 / w2, phase / k)",
    roots="1; sine wave: 1 per c/2f of the stated `range_m`",
    solve=_solve,
)
