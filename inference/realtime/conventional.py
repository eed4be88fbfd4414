"""Conventional time of flight: r = r0 w1 / w2, or the phase over k."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status, TechniqueResult
from inference.realtime.assemble import (
    NOISE_BAND,
    OUTSIDE,
    Candidates,
    Outcome,
    assemble,
    reasons_of,
)
from inference.realtime.net import SATURATED, UNREPRESENTABLE, net_readings, rule_out
from inference.realtime.technique import Task, Technique
from simulator.compiled import compiled
from simulator.frames import Frames
from simulator.sensor import PulsedSensor, Sensor, SineWaveSensor

__all__ = ["CONVENTIONAL", "conventional_range"]

Array = NDArray[np.float64]
Pair = tuple[float, float]

_REASONS = reasons_of(
    "no light: w2 is not positive",
    "w1 is not positive: at or near contact",
    "w1 is above w2: beyond r0",
    "no signal: i and q are zero",
    "the phase is below zero within its noise: at or near contact",
)
_DARK, _CONTACT, _BEYOND, _SILENT, _WRAPPED = range(len(_REASONS) - 5, len(_REASONS))


def conventional_range(sensor: Sensor, frames: Frames, crosstalk: Pair = (0.0, 0.0)) -> Array:
    """Return the conventional range alone, as fast as two readings can be divided.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
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
    first, second = frames.readings[:, 0], frames.readings[:, 1]
    if isinstance(sensor, PulsedSensor):
        return _pulsed_range(first, second, sensor.r0, crosstalk[0], crosstalk[1])
    return _phase_range(first, second, sensor.wave_number, sensor.phase_offset_rad, *crosstalk)


@compiled
def _pulsed_range(w1: Array, w2: Array, r0: float, ct1: float, ct2: float) -> Array:
    out = np.empty(w1.size)
    for i in range(w1.size):
        late, whole = w1[i] - ct1, w2[i] - ct2
        r = r0 * (late / whole)
        out[i] = r if 0.0 < late <= whole < math.inf else math.nan
    return out


@compiled
def _phase_range(
    i_reading: Array, q_reading: Array, k: float, offset: float, ct1: float, ct2: float
) -> Array:
    out = np.empty(i_reading.size)
    turn = 2.0 * math.pi
    for i in range(i_reading.size):
        x, y = i_reading[i] - ct1, q_reading[i] - ct2
        phase = (math.atan2(y, x) - offset) % turn
        good = (x != 0.0 or y != 0.0) and abs(x) < math.inf and abs(y) < math.inf
        out[i] = phase / k if good else math.nan
    return out


@compiled
def _pulsed(
    readings: Array,
    r0: float,
    crosstalk: Pair,
    read: Pair,
    shot: float,
    low: float,
    high: float,
    full: Pair,
    codes: tuple[int, int, int, int, int, int],
    status: NDArray[np.uint8],
    reason: NDArray[np.uint8],
    count: NDArray[np.intp],
    roots: Array,
    sds: Array,
) -> bool:
    """Fill the result of every frame in one pass; return whether any is saturated."""
    dark, contact, beyond, outside, lost, saturated = codes
    var1, var2 = read[0] * read[0], read[1] * read[1]
    any_saturated = False
    for i in range(readings.shape[0]):
        raw1, raw2 = readings[i, 0], readings[i, 1]
        late, whole = raw1 - crosstalk[0], raw2 - crosstalk[1]
        share = late / whole
        r = r0 * share
        # gradient of the ratio (1, -share) / whole; a frame's gain cancels in the ratio
        own1, own2 = var1, var2
        shared = 0.0
        if shot > 0.0:
            first, second = shot * abs(raw1), shot * abs(raw2)
            shared = min(first, second)
            own1 += first - shared
            own2 += second - shared
        lever = 1.0 - share
        sd = r0 / abs(whole) * math.sqrt(own1 + share * share * own2 + lever * lever * shared)
        # a sum of codes, exactly one of which applies: no branch, so that the loop is vectorised
        code = 0
        if not (low <= r <= high):
            code = outside
        if late > whole:
            code = beyond
        if late <= 0.0:
            code = contact
        if whole <= 0.0:
            code = dark
        if not (abs(late) < math.inf and abs(whole) < math.inf and r < math.inf):
            code = lost if whole > 0.0 or not abs(whole) < math.inf else code
        if abs(raw1) >= full[0] or abs(raw2) >= full[1]:
            code = saturated
            any_saturated = True
        good = code == 0
        status[i] = 0 if good else 2
        reason[i] = code
        count[i] = 1 if good else 0
        roots[i, 0] = r if good else math.nan
        sds[i, 0] = sd if good and sd < math.inf else math.nan
    return any_saturated


def _solve_pulsed(task: Task, sensor: PulsedSensor) -> TechniqueResult:
    assert task.known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    n = len(task.frames)
    status, reason = np.empty(n, dtype=np.uint8), np.empty(n, dtype=np.uint8)
    count = np.empty(n, dtype=np.intp)
    roots, sds = np.empty((n, 1)), np.empty((n, 1))
    slack = 8 * np.finfo(float).eps
    low, high = task.known.support if task.physical else (0.0, math.inf)
    any_saturated = _pulsed(
        task.frames.readings,
        sensor.r0,
        task.known.crosstalk,
        sensor.noise.read,
        sensor.noise.shot,
        low * (1 - slack),
        high * (1 + slack),
        sensor.full_scale or (math.inf, math.inf),
        (_DARK, _CONTACT, _BEYOND, OUTSIDE, UNREPRESENTABLE, SATURATED),
        status,
        reason,
        count,
        roots,
        sds,
    )
    if any_saturated:
        status[reason == SATURATED] = Status.SATURATED
    if task.frames.object_present is not None:
        state = rule_out(sensor, task.frames)
        out = (state > 0) & (state != SATURATED)
        status[out], reason[out], count[out] = Status.NONE, state[out], 0
        roots[out], sds[out] = np.nan, np.nan
    return TechniqueResult(
        technique="conventional",
        status=status,
        roots_m=roots,
        roots_sd_m=sds,
        root_count=count,
        near_fold=np.zeros(n, dtype=np.bool_),
        reason=reason,
        reasons=_REASONS,
    )


def _solve_sine_wave(task: Task, sensor: SineWaveSensor) -> TechniqueResult:
    assert task.known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    net = net_readings(sensor, task.known.crosstalk, task.frames)
    k = sensor.wave_number
    with np.errstate(all="ignore"):
        modulus = np.hypot(net.first, net.second)
        angle = np.arctan2(net.second, net.first) - sensor.phase_offset_rad
        phase = np.mod(angle, 2 * np.pi)
        safe = np.where(modulus > 0, modulus, 1.0)
        # gradient of the phase: (-q, i) / modulus^2
        sd = np.sqrt(net.variance(-net.second / safe / safe, net.first / safe / safe))
        band = np.minimum(NOISE_BAND * sd, 0.5 * np.pi)
        contact = (phase > 2 * np.pi - band) | (phase == 0.0)
        usable = (modulus > 0) & np.isfinite(modulus)
        if task.physical:
            usable &= ~contact
        turns = 1
        if task.high_m is not None:
            turns = max(math.ceil(task.high_m * k / (2 * math.pi)), 1)
        phases = phase[:, None] + 2 * np.pi * np.arange(turns)
        roots = np.where(usable[:, None], phases / k, np.nan)
        if task.high_m is not None:
            roots[roots > task.high_m] = np.nan
        candidates = Candidates(
            roots=roots,
            sd=np.broadcast_to((sd / k)[:, None], roots.shape),
            near=np.zeros(roots.shape, dtype=np.bool_),
            near_frame=np.zeros(len(task.frames), dtype=np.bool_),
        )
    reason = np.where(modulus > 0, _WRAPPED, _SILENT).astype(np.uint8)
    support = task.known.support if task.physical else (0.0, np.inf)
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
    immune_to=(),
    uses_background=False,
    differential=False,
    cost=1.0,
    equations="4.47, 4.48 (r0 w1 / w2, phase / k)",
    roots="1",
    solve=_solve,
)
