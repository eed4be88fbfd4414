"""Background cancelling: a background of known distance drops out, whatever its strength."""

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.realtime.assemble import (
    END_BAND,
    NOISE_BAND,
    Outcome,
    assemble,
    reasons_of,
    up_to_wall,
)
from inference.realtime.free_light import free_light, may_be_none
from inference.realtime.from_curve import candidates_of, curve_parameters
from inference.realtime.model_error import model_error_of, point_error, sd_of_roots
from inference.realtime.net import UNREPRESENTABLE, Form, Net, known_net_readings
from inference.realtime.open_background import (
    OpenBackground,
    SeenScene,
    Wave,
    left_open,
    or_none,
    seen_scene,
)
from inference.realtime.solving.bracketing import EPSILON
from inference.realtime.solving.curves import cancelling_quadrature, cancelling_ratio
from inference.realtime.solving.curves.curve import Curve
from inference.realtime.solving.exact import cycles_phase, weighted_differences
from inference.technique import Task, Technique
from simulator.compiled import compiled
from simulator.object_arrays import object_fluxes, shadows
from simulator.object_model import quadratic
from simulator.sensor import PulsedSensor, SineWaveSensor
from simulator.shadow_error import shadow_errors

__all__ = ["BACKGROUND_CANCELLING"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_REASONS = reasons_of(
    "the readings lie at or beyond the background",
    "no range before the background gives these readings",
)
_BEYOND, _NO_RANGE = len(_REASONS) - 2, len(_REASONS) - 1


class _Parts(NamedTuple):
    """A frame's part that is free of background and the one that holds all of it, with noise.

    Attributes
    ----------
    free, whole : ndarray, shape (n,)
        Both parts [reading units].
    var_free, cov, var_whole : ndarray, shape (n,)
        Their covariance, but for the relative error.
    size : ndarray, shape (n,)
        What was subtracted from one another: its rounding is theirs.
    """

    free: Array
    whole: Array
    var_free: Array
    cov: Array
    var_whole: Array
    size: Array


def _parts(task: Task, net: Net) -> tuple[Curve, _Parts]:
    sensor, distance = task.sensor, task.known.get("background.distance_m")
    free, to_free = free_light(sensor, net, distance)
    if isinstance(sensor, PulsedSensor):
        curve = cancelling_ratio.CURVE
        whole, to_whole = net.second, Form(0.0, 1.0)
    else:
        curve = cancelling_quadrature.CURVE
        angle = cycles_phase(sensor.frequency_hz, distance) + sensor.known_phase_rad
        cosine, sine = math.cos(angle), math.sin(angle)
        # Re(x e^-j(kR + offset))
        whole = weighted_differences(net.first, cosine, net.second, -sine)
        to_whole = Form(cosine, sine)
    parts = _Parts(
        free=free,
        whole=whole,
        var_free=net.covariance(to_free, to_free),
        cov=net.covariance(to_free, to_whole),
        var_whole=net.covariance(to_whole, to_whole),
        size=np.abs(net.first) * abs(to_free.first) + np.abs(net.second),
    )
    return curve, parts


def _light(task: Task) -> tuple[Array, Array]:
    """Return a frame's part that is free of background, and the one that holds all of it."""
    _, parts = _parts(task, known_net_readings(task))
    return parts.free, parts.whole


def _solve(task: Task) -> TechniqueResult:
    sensor, known = task.sensor, task.known
    net = known_net_readings(task)
    with np.errstate(all="ignore"):
        curve, parts = _parts(task, net)
        free = parts.free
        scale = known.unit**2 / (sensor.known_gain * known.get("object.c2"))
        target = free * scale
        state = net.state.copy()
        lost = (free != 0) & ((target == 0) | ~np.isfinite(target))
        state[lost & (state == 0)] = UNREPRESENTABLE
        usable = state == 0
        if isinstance(sensor, PulsedSensor):
            usable &= free > 0
        target = np.where(usable, target, np.nan)
        sd = np.hypot(np.sqrt(parts.var_free) * scale, net.relative * target)
        distance = known.get("background.distance_m")
        beside = None
        if model_error_of(task).shadow > 0:
            beside = functools.partial(_by_shadow, task, parts.whole * scale, scale)
        # what frames of the bare background read is at the end: not seldom, and far from the rest
        candidates, slopes = candidates_of(
            task, curve, distance, target, sd, beside=beside, end_band=END_BAND
        )
        candidates = up_to_wall(candidates, distance, may_be_none(free, parts.var_free))
        physical = None
        if task.physical and known.has("background.strength"):
            scene, wave = seen_scene(task, net.relative)
            by_model = _moved(task, curve, candidates.roots, slopes)
            if beside is not None:
                by_model = np.hypot(by_model, beside(candidates.roots) / np.abs(slopes))
            open_ = left_open(task, _light, candidates.roots, slopes / scale)
            candidates = or_none(candidates, parts.free, open_)
            physical = _physical(
                candidates.roots, slopes / scale, by_model, open_, parts, scene, wave, NOISE_BAND
            )
    reason = np.full(free.size, _NO_RANGE, dtype=np.uint8)
    if isinstance(sensor, PulsedSensor):
        reason[~(free > 0)] = _BEYOND
    support = known.support if task.physical else (0.0, np.inf)
    outcome = Outcome(physical, support, reason, _REASONS)
    return assemble("background_cancelling", state, candidates, outcome)


def _moved(task: Task, curve: Curve, roots: Array, slopes: Array) -> Array:
    """Return how far errors of the time of flight move roots [m], shape (n, m)."""
    unit = task.known.unit
    late = point_error(task, unit)._replace(flux=0.0, flux_slope=0.0)
    p = curve_parameters(task.known, task.sensor)
    return unit * sd_of_roots(curve.kind, p, roots / unit, slopes * unit, late)


def _by_shadow(task: Task, whole: Array, scale: float, roots: Array) -> Array:
    """Return what errors of the shadow leave of a background, shape (n, m), in units of ``whole``.

    Light that is farther away than the background is not cancelled: docs/model.md, shadow-error.
    Where no number tells the shadow, it is taken for as large as the object. How much light there
    is the readings tell, but for these errors themselves; where its strength is known, also that.
    """
    sensor, known = task.sensor, task.known
    c0, c1 = known.get("object.c0"), known.get("object.c1")
    flux = object_fluxes(roots, sensor.known_gain * known.get("object.c2") * c0 * scale, c0, c1)
    turn = 1.0
    if isinstance(sensor, SineWaveSensor):
        turn = sensor.wave_number * known.get("background.distance_m")
        flux = flux * np.cos(turn - sensor.wave_number * roots)
    if known.has("background.shadow.c0", "background.shadow.c1"):
        c0, c1 = known.get("background.shadow.c0"), known.get("background.shadow.c1")
    seen = shadows(roots, c0, c1)
    _, by_distance = shadow_errors(seen)
    light = np.abs(whole[:, None] - flux)
    if known.has("background.strength"):
        light = np.maximum(light, known.get("background.strength") * scale * seen)
    return np.asarray(model_error_of(task).shadow * light * turn * by_distance)


@compiled
def _physical(
    roots: Array,
    slopes: Array,
    by_model: Array,
    open_: OpenBackground,
    parts: _Parts,
    scene: SeenScene,
    wave: Wave | None,
    band: float,
) -> Flags:
    """Say at which roots the background is between nothing and its strength, within its errors.

    The background is whole - C Phi(r), with C = 1 or cos k (R - r), and its first-order error
    d whole - (C Phi)' d free / free'(r). Errors of the model move r by ``by_model``, and the
    scene's joint law leaves ``open_`` what the background is, and how far below its strength. At a
    fold or an end the slope is 0, and any background is possible.
    """
    n, m = roots.shape
    accepted = np.zeros((n, m), dtype=np.bool_)
    for i in range(n):
        for j in range(m):
            r = roots[i, j]
            if not r > 0.0:
                continue
            if slopes[i, j] == 0.0:
                accepted[i, j] = True
                continue
            q = quadratic(r, scene.c0, scene.c1)
            flux = scene.gain * (scene.c0 / q) / r / r
            change = -flux * (2.0 + r * (2.0 * r + scene.c1) / q) / r
            part = flux
            if wave is not None:
                angle = wave.number * (wave.distance - r)
                cosine, sine = math.cos(angle), math.sin(angle)
                part = flux * cosine
                change = change * cosine + wave.number * flux * sine
            background = parts.whole[i] - part
            lever = change / slopes[i, j]
            variance = parts.var_whole[i] - 2.0 * (lever * parts.cov[i])
            variance += lever * (lever * parts.var_free[i])
            common = scene.relative * (part - lever * parts.free[i])
            moved = change * by_model[i, j]
            variance = max(variance, 0.0) + common * common + moved * moved
            rounding = 64.0 * EPSILON * (parts.size[i] * (1.0 + abs(lever)) + flux)
            below, above = open_.light[i, j], open_.left[i, j]
            slack = band * math.sqrt(variance + below * below) + rounding
            room = band * math.sqrt(variance + above * above) + rounding
            accepted[i, j] = not (background < -slack or background > scene.strength + room)
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
    equations="4.73; of a sine wave docs/model.md, exact",
    roots="1 in (0, R) if c1^2 <= 32 c0 / 9; sine wave: 1 if kR <= pi, else up to 2 a half period",
    solve=_solve,
    farthest_m=lambda _: math.inf,
)
