"""Background intensity: what a known background still shows of itself gives the range away."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.realtime.assemble import (
    END_BAND,
    NEGATIVE,
    NOISE_BAND,
    Candidates,
    Outcome,
    assemble,
    reasons_of,
    up_to_wall,
)
from inference.realtime.free_light import free_light, may_be_none
from inference.realtime.from_curve import stacked
from inference.realtime.model_error import model_error_of
from inference.realtime.nearest_roots import nearest
from inference.realtime.net import Net, known_net_readings
from inference.realtime.solving.background_balance import solve_balance
from inference.realtime.solving.background_phase import End, Phase, solve_phase
from inference.realtime.solving.exact import cycles_phase
from inference.realtime.solving.known_background import Found, KnownBackground
from inference.realtime.solving.pulse_ratio import CONTRADICTED
from inference.technique import Task, Technique
from simulator.object_arrays import quadratics, shadows
from simulator.sensor import PulsedSensor, Sensor, SineWaveSensor
from simulator.shadow_error import shadow_errors

__all__ = ["BACKGROUND_INTENSITY"]

Array = NDArray[np.float64]

_REASONS = reasons_of(
    "no light: w2 is not positive",
    "w1 is not positive: at or near contact",
    "the readings lie at or beyond the background",
    "no signal: i and q are zero",
    "no range before the background gives these readings",
    NEGATIVE,
)
_DARK, _CONTACT, _BEYOND, _SILENT, _NO_RANGE, _NEGATIVE = range(len(_REASONS) - 6, len(_REASONS))
_SMALL = 0.005  # share of the range up to which the tangent says what noise does
_CHUNK = 200_000  # candidate roots held at a time, so that they stay in the cache


def _solve(task: Task) -> TechniqueResult:
    sensor, known = task.sensor, task.known
    net = known_net_readings(task)
    # lengths in a power of two near sqrt(c0'), so that nothing overflows
    c0 = known.get("background.shadow.c0")
    unit = 2.0 ** round(0.5 * math.log2(c0))
    background = KnownBackground(
        strength=known.get("background.strength"),
        distance=known.get("background.distance_m") / unit,
        c0=c0 / unit / unit,
        c1=known.get("background.shadow.c1") / unit,
    )
    n = net.first.size
    width = 3
    if isinstance(sensor, SineWaveSensor):
        width = int(sensor.wave_number * unit * background.distance / math.pi) + 12
    end, step = _end_of(task, background, unit), max(_CHUNK // width, 1)
    parts = [
        _part(sensor, net.select(slice(i, i + step)), background, unit, width, end)
        for i in range(0, n, step)
    ]
    roots, sds, late, near, near_frame, physical = zip(*parts, strict=True)
    ranges, error = stacked(roots), model_error_of(task)
    with np.errstate(all="ignore"):
        model = stacked(late) * error.range_m
        if error.shadow > 0:
            by_shadow = unit * _moved_by_shadow(sensor, net, background, unit, ranges)
            model = np.hypot(model, error.shadow * by_shadow)
        candidates = Candidates(
            ranges * unit,
            stacked(sds) * unit,
            stacked(near),
            np.concatenate(near_frame),
            model=np.abs(model) if error.range_m > 0 or error.shadow > 0 else None,
            merged=np.isnan(stacked(sds)) & stacked(near),
        )
        wall_m = known.get("background.distance_m")
        free, form = free_light(sensor, net, wall_m)
        bare = may_be_none(free, net.covariance(form, form))
        candidates = up_to_wall(candidates, wall_m, bare)
    if isinstance(sensor, PulsedSensor):
        reason = np.full(n, _BEYOND)
        reason[net.first <= 0] = _CONTACT
        reason[net.second <= 0] = _DARK
        with np.errstate(all="ignore"):
            moved = error.range_m / sensor.r0 * net.second
            reason[-net.first > CONTRADICTED * np.hypot(np.sqrt(net.var1), moved)] = _NEGATIVE
            reason[-net.second > CONTRADICTED * np.sqrt(net.var2)] = _NEGATIVE
    else:
        reason = np.where((net.first == 0) & (net.second == 0), _SILENT, _NO_RANGE)
    support = known.support if task.physical else (0.0, np.inf)
    outcome = Outcome(
        stacked(physical) if task.physical else None, support, reason.astype(np.uint8), _REASONS
    )
    return assemble("background_intensity", net.state, candidates, outcome)


def _end_of(task: Task, far: KnownBackground, unit: float) -> End | None:
    """Return what may have moved a root beyond the background; of a pulse it is the only one."""
    sensor, error = task.sensor, model_error_of(task)
    if isinstance(sensor, PulsedSensor):
        return None
    seen = shadows(np.array([far.distance]), far.c0, far.c1)
    turned = sensor.wave_number * far.distance * unit * shadow_errors(seen)[1]
    return End(
        END_BAND, sensor.wave_number * error.range_m, float((error.shadow * seen * turned)[0])
    )


def _moved_by_shadow(
    sensor: Sensor, net: Net, far: KnownBackground, unit: float, r: Array
) -> Array:
    """Return how far errors of the shadow move roots, in units of their size, shape (n, m).

    Of late and whole light F = w1 - r w2 - b S (R - r), of a sine wave what points across the
    object's own direction; docs/model.md, shadow-error.
    """
    q, share = quadratics(r, far.c0, far.c1), shadows(r, far.c0, far.c1)
    seen, slope = far.strength * share, far.strength * (far.c0 / q) * ((2.0 * r + far.c1) / q)
    by_light, by_distance = shadow_errors(share)
    first, second = net.first[:, None], net.second[:, None]
    if isinstance(sensor, PulsedSensor):
        across, turned = far.distance - r, np.full_like(r, far.distance)
        steep = second - seen + slope * across
    else:
        k, offset = sensor.wave_number * unit, sensor.known_phase_rad
        own = k * r + offset
        angle = cycles_phase(sensor.frequency_hz, far.distance * unit) + offset - own
        across, turned = np.sin(angle), k * far.distance * np.cos(angle)
        flux = first * np.cos(own) + second * np.sin(own) - seen * np.cos(angle)
        steep = k * flux + slope * across
    return np.asarray(seen * np.hypot(across * by_light, turned * by_distance) / np.abs(steep))


def _part(
    sensor: Sensor, net: Net, background: KnownBackground, unit: float, width: int, end: End | None
) -> Found:
    """Solve some of the frames, and widen the standard deviations that noise bends."""
    found = _solved(sensor, net, background, unit, width, end)
    with np.errstate(invalid="ignore"):
        bent = np.flatnonzero((found.sds > _SMALL * found.roots).any(axis=1))
    if not bent.size:
        return found
    some = net.select(bent)
    roots = found.roots[bent]
    square = np.zeros_like(roots)
    for d1, d2 in _principal(some):
        moves = np.zeros_like(roots)
        for side in (-NOISE_BAND, NOISE_BAND):
            moved = some._replace(first=some.first + side * d1, second=some.second + side * d2)
            others = _solved(sensor, moved, background, unit, width, end).roots
            moves = np.fmax(moves, _move(roots, others, background.distance))
        square += (moves / NOISE_BAND) ** 2
    found.sds[bent] = np.maximum(found.sds[bent], np.sqrt(square))
    return found


def _principal(net: Net) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return two independent errors of a standard deviation, each of both readings, shape (n,)."""
    with np.errstate(all="ignore"):
        first = np.sqrt(net.var1)
        along = np.where(first > 0, net.cov / np.where(first > 0, first, 1.0), 0.0)
        second = np.sqrt(np.maximum(net.var2 - along * along, 0.0))
    return (first, along), (np.zeros_like(second), second)


def _move(roots: Array, others: Array, distance: float) -> Array:
    """Return how far the nearest of other roots is, shape (n, m); to an end where there is none."""
    away = np.abs(roots - nearest(roots, others))
    return np.where(np.isnan(away), np.maximum(roots, distance - roots), away)


def _solved(
    sensor: Sensor, net: Net, background: KnownBackground, unit: float, width: int, end: End | None
) -> Found:
    """Solve some of the frames, and drop the columns that none of them uses."""
    n = net.first.size
    found = Found(
        roots=np.full((n, width), np.nan),
        sds=np.full((n, width), np.nan),
        late=np.full((n, width), np.nan),
        near=np.zeros((n, width), np.bool_),
        near_frame=np.zeros(n, np.bool_),
        physical=np.zeros((n, width), np.bool_),
    )
    if isinstance(sensor, PulsedSensor) or end is None:
        solve_balance(net, background, sensor.max_range_m / unit, NOISE_BAND, found)
    else:
        phase = Phase(
            wave=sensor.wave_number * unit,
            offset=sensor.known_phase_rad,
            far=cycles_phase(sensor.frequency_hz, background.distance * unit),
        )
        solve_phase(net, background, phase, NOISE_BAND, end, found)
    used = max(int(np.count_nonzero(np.isfinite(found.roots).any(axis=0))), 1)
    return Found(
        found.roots[:, :used],
        found.sds[:, :used],
        found.late[:, :used],
        found.near[:, :used],
        found.near_frame,
        found.physical[:, :used],
    )


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
    immune_to=("background", "discrepancy"),  # what the object sends plays no part
    uses_background=True,
    differential=False,
    cost=160.0,
    equations="4.76; of a sine wave docs/model.md, exact",
    roots="1 in (0, R) for c1' >= 0; sine wave: 1 if kR <= pi and c1' >= 0, else several",
    solve=_solve,
    farthest_m=lambda _: math.inf,
)
