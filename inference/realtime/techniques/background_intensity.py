"""Background intensity: what a known background still shows of itself gives the range away."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.realtime.assemble import NOISE_BAND, Candidates, Outcome, assemble, reasons_of
from inference.realtime.from_curve import widened
from inference.realtime.net import Net, net_readings
from inference.realtime.solving.background_balance import solve_balance
from inference.realtime.solving.background_phase import solve_phase
from inference.realtime.solving.exact import cycles_phase
from inference.technique import Task, Technique
from simulator.sensor import PulsedSensor, SineWaveSensor

__all__ = ["BACKGROUND_INTENSITY"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_REASONS = reasons_of(
    "no light: w2 is not positive",
    "w1 is not positive: at or near contact",
    "the readings lie at or beyond the background",
    "no signal: i and q are zero",
    "no range before the background gives these readings",
)
_DARK, _CONTACT, _BEYOND, _SILENT, _NO_RANGE = range(len(_REASONS) - 5, len(_REASONS))
_CHUNK = 200_000  # candidate roots held at a time, so that they stay in the cache


def _solve(task: Task) -> TechniqueResult:
    sensor, known = task.sensor, task.known
    assert known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    net = net_readings(sensor, known.crosstalk, task.frames)
    # lengths in a power of two near sqrt(c0'), so that nothing overflows
    c0 = known.get("background.shadow.c0")
    unit = 2.0 ** round(0.5 * math.log2(c0))
    distance = known.get("background.distance_m")
    k = sensor.wave_number * unit if isinstance(sensor, SineWaveSensor) else 0.0
    p = np.array([distance / unit, c0 / unit / unit, known.get("background.shadow.c1") / unit, k])
    strength = known.get("background.strength")
    n = net.first.size
    width = 3 if isinstance(sensor, PulsedSensor) else int(k * p[0] / math.pi) + 12
    step = max(_CHUNK // width, 1)
    parts = [
        _part(sensor, net, slice(i, i + step), strength, unit, p, width) for i in range(0, n, step)
    ]
    used = max(max(part[0].shape[1] for part in parts), 1)
    roots, sds, near, physical = (
        np.concatenate([widened(part[j], used) for part in parts]) for j in (0, 1, 2, 4)
    )
    near_frame = np.concatenate([part[3] for part in parts])
    with np.errstate(all="ignore"):
        candidates = Candidates(roots * unit, sds * unit, near, near_frame)
    if isinstance(sensor, PulsedSensor):
        reason = np.full(n, _BEYOND)
        reason[net.first <= 0] = _CONTACT
        reason[net.second <= 0] = _DARK
    else:
        reason = np.where((net.first == 0) & (net.second == 0), _SILENT, _NO_RANGE)
    support = known.support if task.physical else (0.0, np.inf)
    outcome = Outcome(
        physical if task.physical else None, support, reason.astype(np.uint8), _REASONS
    )
    return assemble("background_intensity", net.state, candidates, outcome)


def _part(
    sensor: PulsedSensor | SineWaveSensor,
    net: Net,
    rows: slice,
    strength: float,
    unit: float,
    p: Array,
    width: int,
) -> tuple[Array, Array, Flags, Flags, Flags]:
    n = net.first[rows].size
    roots, sds = np.full((n, width), np.nan), np.full((n, width), np.nan)
    near, physical = np.zeros((n, width), np.bool_), np.zeros((n, width), np.bool_)
    near_frame = np.zeros(n, np.bool_)
    readings = (net.first[rows], net.second[rows], net.var1[rows], net.var2[rows], net.cov[rows])
    out = (roots, sds, near, near_frame, physical)
    if isinstance(sensor, PulsedSensor):
        solve_balance(*readings, net.state[rows], strength, sensor.r0 / unit, p, NOISE_BAND, *out)
    else:
        phase = cycles_phase(sensor.frequency_hz, p[0] * unit)
        offset = sensor.phase_offset_rad
        solve_phase(*readings, net.state[rows], strength, offset, phase, p, NOISE_BAND, *out)
    used = max(int(np.count_nonzero(np.isfinite(roots).any(axis=0))), 1)
    return roots[:, :used], sds[:, :used], near[:, :used], near_frame, physical[:, :used]


BACKGROUND_INTENSITY = Technique(
    name="background_intensity",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q",
    needs=(
        "background.strength",
        "background.distance_m",
        "background.shadow.c0",
        "background.shadow.c1",
    ),
    immune_to=("background",),
    uses_background=True,
    differential=False,
    cost=160.0,
    equations="4.76; for a sine wave errata section 5",
    roots="1 in (0, R) for c1' >= 0; sine wave: 1 if kR <= pi and c1' >= 0, else several",
    solve=_solve,
)
