"""Conventional time of flight: r = r0 w1 / w2, or the phase over k."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status, TechniqueResult
from inference.realtime.assemble import (
    DROWNED,
    NOISE_BAND,
    OUTSIDE,
    Candidates,
    Outcome,
    assemble,
    reasons_of,
)
from inference.realtime.net import ABSENT, SATURATED, UNREPRESENTABLE, net_readings
from inference.technique import Task, Technique
from simulator.compiled import compiled
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
)
_ROUNDING = float(np.finfo(float).eps)
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
    if isinstance(sensor, PulsedSensor):
        flat = np.ascontiguousarray(frames.readings).reshape(-1)
        return _pulsed_range(flat, sensor.r0, *crosstalk)
    return _phase_range(frames.readings, sensor.wave_number, sensor.phase_offset_rad, crosstalk)


@compiled
def _pulsed_range(flat: Array, r0: float, ct1: float, ct2: float) -> Array:
    # one flat index: so the compiler sees how the pairs lie and divides several at once
    out = np.empty(flat.size // 2)
    for i in range(out.size):
        late, whole = flat[2 * i] - ct1, flat[2 * i + 1] - ct2
        r = r0 * (late / whole)
        good = (r > 0.0) & (late > 0.0) & (late <= whole) & (whole < math.inf)
        out[i] = r if good else math.nan
    return out


def _phase_range(readings: Array, k: float, offset: float, crosstalk: Pair) -> Array:
    with np.errstate(all="ignore"):
        x, y = readings[:, 0] - crosstalk[0], readings[:, 1] - crosstalk[1]
        phase = np.arctan2(y, x)
        phase -= math.remainder(offset, 2 * math.pi)
        phase[phase < 0] += 2 * math.pi
        phase[phase >= 2 * math.pi] -= 2 * math.pi
        phase[((x == 0) & (y == 0)) | ~np.isfinite(x + y)] = np.nan
        phase /= k
    return phase


@compiled
def _pulsed(
    flat: Array,
    r0: float,
    crosstalk: Pair,
    read: Pair,
    shot: float,
    support: Pair,
    full: Pair,
    roots: Array,
    sds: Array,
    reason: NDArray[np.uint8],
) -> int:
    """Fill ranges, standard deviations and a mark of the frames that have none; count the marks.

    Without branches, so that several frames are computed at once. A frame's gain and the relative
    error of the object's signal cancel in the ratio.
    """
    low, high = support
    var1, var2 = read[0] * read[0], read[1] * read[1]
    bad = 0
    for i in range(roots.size):
        raw1, raw2 = flat[2 * i], flat[2 * i + 1]
        late, whole = raw1 - crosstalk[0], raw2 - crosstalk[1]
        inverse = 1.0 / whole
        share = late * inverse
        r = r0 * share
        # gradient of the ratio: (1, -share) / whole; shared photons enter with 1 - share
        first, second = shot * abs(raw1), shot * abs(raw2)
        shared = first if first < second else second
        variance = var1 + first - shared + share * share * (var2 + second - shared)
        variance += (1.0 - share) * (1.0 - share) * shared
        sd = r0 * inverse * math.sqrt(variance)
        # readings are rounded, however little noise they have
        sd = max(sd, _ROUNDING * r)
        good = (
            (low <= r)
            & (r <= high)
            & (r > 0.0)
            & (late > 0.0)
            & (late <= whole)
            & (whole < math.inf)
        )
        good &= (sd < math.inf) & (abs(raw1) < full[0]) & (abs(raw2) < full[1])
        roots[i] = r if good else math.nan
        sds[i] = sd if good else math.nan
        reason[i] = 0 if good else 1
        bad += 0 if good else 1
    return bad


@compiled
def _explain(
    flat: Array,
    r0: float,
    crosstalk: Pair,
    support: Pair,
    full: Pair,
    codes: tuple[int, int, int, int, int, int, int],
    roots: Array,
    reason: NDArray[np.uint8],
) -> None:
    """Say of the frames marked why they have no range, or give it where only its sd overflows."""
    dark, contact, beyond, outside, lost, saturated, drowned = codes
    for i in range(roots.size):
        if reason[i] == 0:
            continue
        raw1, raw2 = flat[2 * i], flat[2 * i + 1]
        late, whole = raw1 - crosstalk[0], raw2 - crosstalk[1]
        r = r0 * (late / whole)
        if abs(raw1) >= full[0] or abs(raw2) >= full[1]:
            reason[i] = saturated
        elif not (abs(late) < math.inf and abs(whole) < math.inf):
            reason[i] = lost
        elif whole <= 0.0:
            reason[i] = dark
        elif late <= 0.0:
            reason[i] = contact
        elif late > whole:
            reason[i] = beyond
        elif not r > 0.0:
            reason[i] = lost
        elif not support[0] <= r <= support[1]:
            reason[i] = outside
        else:
            reason[i] = drowned
            roots[i] = r


def _solve_pulsed(task: Task, sensor: PulsedSensor) -> TechniqueResult:
    assert task.known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    frames = task.frames
    n = len(frames)
    slack = 8 * np.finfo(float).eps
    low, high = task.known.support if task.physical else (0.0, math.inf)
    support = (low * (1 - slack), high * (1 + slack))
    full = sensor.full_scale or (math.inf, math.inf)
    crosstalk = task.known.crosstalk
    # one block for all columns: freshly mapped pages would cost more than the arithmetic
    block = np.empty(27 * n, dtype=np.uint8)
    roots, sds = block[: 8 * n].view(np.float64), block[8 * n : 16 * n].view(np.float64)
    count = block[16 * n : 24 * n].view(np.intp)
    status, reason, near = (block[(24 + i) * n : (25 + i) * n] for i in range(3))
    flat = np.ascontiguousarray(frames.readings).reshape(-1)
    noise = sensor.noise
    bad = _pulsed(
        flat, sensor.r0, crosstalk, noise.read, noise.shot, support, full, roots, sds, reason
    )
    count.fill(1)
    status.fill(Status.UNIQUE)
    near.fill(0)
    if bad:
        codes = (_DARK, _CONTACT, _BEYOND, OUTSIDE, UNREPRESENTABLE, SATURATED, DROWNED)
        _explain(flat, sensor.r0, crosstalk, support, full, codes, roots, reason)
    if frames.object_present is not None:
        absent = ~frames.object_present & (reason != SATURATED)
        reason[absent], roots[absent], sds[absent] = ABSENT, np.nan, np.nan
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
        root_count=count,
        near_fold=near.view(np.bool_),
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
    immune_to=("discrepancy",),  # the flux cancels in the ratio and in the phase
    uses_background=False,
    differential=False,
    cost=1.0,
    equations="4.47, 4.48 (r0 w1 / w2, phase / k)",
    roots="1",
    solve=_solve,
)
