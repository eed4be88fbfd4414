"""Background cancelling: a background of known distance drops out, whatever its strength."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.realtime.assemble import NOISE_BAND, Outcome, assemble, reasons_of
from inference.realtime.from_curve import candidates_of
from inference.realtime.net import UNREPRESENTABLE, net_readings
from inference.realtime.solving import curves
from inference.realtime.solving.bracketing import EPSILON
from inference.realtime.solving.exact import cycles_phase, weighted_differences
from inference.technique import Task, Technique
from simulator.compiled import compiled
from simulator.object_model import quadratic
from simulator.sensor import PulsedSensor

__all__ = ["BACKGROUND_CANCELLING"]

Array = NDArray[np.float64]

_REASONS = reasons_of(
    "the readings lie at or beyond the background",
    "no range before the background gives these readings",
)
_BEYOND, _NO_RANGE = len(_REASONS) - 2, len(_REASONS) - 1


def _solve(task: Task) -> TechniqueResult:
    sensor, known = task.sensor, task.known
    assert known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    net = net_readings(sensor, known.crosstalk, task.frames)
    distance = known.get("background.distance_m")
    with np.errstate(all="ignore"):
        # the part free of background, and the part that holds all of the background
        if isinstance(sensor, PulsedSensor):
            kind = curves.CANCELLING_RATIO
            weight = sensor.r0 / distance
            free = weighted_differences(net.second, distance, net.first, sensor.r0) / distance
            whole = net.second
            towards_free, towards_whole = (-weight, 1.0), (0.0, 1.0)
        else:
            kind = curves.CANCELLING_QUADRATURE
            angle = cycles_phase(sensor.frequency_hz, distance) + sensor.phase_offset_rad
            cosine, sine = math.cos(angle), math.sin(angle)
            # free = - Im(x e^-j(kR + offset)), whole = its real part
            free = weighted_differences(net.first, sine, net.second, cosine)
            whole = weighted_differences(net.first, cosine, net.second, -sine)
            towards_free, towards_whole = (sine, -cosine), (cosine, sine)
        v11 = _product(net.var1, net.var2, net.cov, towards_free, towards_free)
        v12 = _product(net.var1, net.var2, net.cov, towards_free, towards_whole)
        v22 = _product(net.var1, net.var2, net.cov, towards_whole, towards_whole)
        scale = known.unit**2 / (sensor.gain * known.get("object.c2"))
        target = free * scale
        state = net.state.copy()
        lost = (free != 0) & ((target == 0) | ~np.isfinite(target))
        state[lost & (state == 0)] = UNREPRESENTABLE
        usable = state == 0
        if kind == curves.CANCELLING_RATIO:
            usable &= free > 0
        target = np.where(usable, target, np.nan)
        sd = np.hypot(np.sqrt(v11) * scale, sensor.noise.relative * target)
        candidates, slopes = candidates_of(task, kind, distance, target, sd)
        physical = None
        if task.physical and known.has("background.strength"):
            magnitude = np.abs(net.first) * abs(towards_free[0]) + np.abs(net.second)
            c0, c1 = known.get("object.c0"), known.get("object.c1")
            gain = sensor.gain * known.get("object.c2")
            physical = _physical(
                candidates.roots,
                slopes / scale,
                free,
                whole,
                v11,
                v12,
                v22,
                magnitude,
                (gain, c0, c1, known.get("background.strength")),
                None if isinstance(sensor, PulsedSensor) else (sensor.wave_number, distance),
                sensor.noise.relative,
                NOISE_BAND,
            )
    reason = np.where(free > 0, _NO_RANGE, _BEYOND).astype(np.uint8)
    if kind == curves.CANCELLING_QUADRATURE:
        reason[:] = _NO_RANGE
    support = known.support if task.physical else (0.0, np.inf)
    outcome = Outcome(physical, support, reason, _REASONS)
    return assemble("background_cancelling", state, candidates, outcome)


def _product(
    var1: Array, var2: Array, cov: Array, a: tuple[float, float], b: tuple[float, float]
) -> Array:
    """Return the covariance of two linear forms of the readings."""
    return a[0] * b[0] * var1 + a[1] * b[1] * var2 + (a[0] * b[1] + a[1] * b[0]) * cov


@compiled
def _physical(
    roots: Array,
    slopes: Array,
    free: Array,
    whole: Array,
    v11: Array,
    v12: Array,
    v22: Array,
    magnitude: Array,
    scene: tuple[float, float, float, float],
    wave: tuple[float, float] | None,
    relative: float,
    band: float,
) -> NDArray[np.bool_]:
    """Say at which roots the background is between nothing and its strength, within noise.

    The background is whole - C Phi(r), with C = 1 or cos k (R - r), and its first-order error
    d whole - (C Phi)' d free / free'(r). ``scene`` is (gain c2, c0, c1, strength), ``wave`` (k, R).
    """
    gain, c0, c1, strength = scene
    n, m = roots.shape
    accepted = np.zeros((n, m), dtype=np.bool_)
    for i in range(n):
        for j in range(m):
            r = roots[i, j]
            if not r > 0.0:
                continue
            q = quadratic(r, c0, c1)
            flux = gain * (c0 / q) / r / r
            change = -flux * (2.0 + r * (2.0 * r + c1) / q) / r
            part = flux
            if wave is not None:
                angle = wave[0] * (wave[1] - r)
                cosine, sine = math.cos(angle), math.sin(angle)
                part = flux * cosine
                change = change * cosine + wave[0] * flux * sine
            background = whole[i] - part
            lever = change / slopes[i, j]
            variance = v22[i] - 2.0 * (lever * v12[i]) + lever * (lever * v11[i])
            common = relative * (part - lever * free[i])
            variance = max(variance, 0.0) + common * common
            rounding = 64.0 * EPSILON * (magnitude[i] * (1.0 + abs(lever)) + flux)
            slack = band * math.sqrt(variance) + rounding
            accepted[i, j] = not (background < -slack or background > strength + slack)
    return accepted


BACKGROUND_CANCELLING = Technique(
    name="background_cancelling",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q",
    needs=("object.c0", "object.c1", "object.c2", "background.distance_m"),
    immune_to=("background",),
    uses_background=True,
    differential=False,
    cost=200.0,
    equations="4.73; for a sine wave errata section 5",
    roots="1 in (0, R) if c1^2 <= 32 c0 / 9; sine wave: 1 if kR <= pi, else up to 2 a half period",
    solve=_solve,
)
