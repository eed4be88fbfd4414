"""Object parameters by linear least squares on ranges that need no object (5.6-5.8).

1 / Phi = x1 r^2 + x2 r^3 + x3 r^4 with x1 = 1 / c2, x2 = c1 / (c0 c2), x3 = 1 / (c0 c2). Ranges
come from conventional time of flight, or from background intensity before a known background.
Their noise is treated to first order here; from the values found the likelihood of all frames is
climbed, in which every range is unknown.
"""

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.fits.answer.counts import linear_obstacle, too_few
from inference.fits.likelihood.unknowns import unknowns_of
from inference.fits.linear.at_rest import refuse_at_rest
from inference.fits.linear.equations import Equations, Observed, fit_equations, without_warnings
from inference.fits.linear.least_squares import LinearFit
from inference.fits.linear.light import background_light, carrier, component
from inference.known import Known
from inference.realtime.techniques.background_intensity import BACKGROUND_INTENSITY
from inference.realtime.techniques.conventional import CONVENTIONAL
from inference.technique import Task, Technique
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["OBJECT_FIT"]

Array = NDArray[np.float64]

_OBJECT = _C0, _C1, _C2 = ("object.c0", "object.c1", "object.c2")
_BACKGROUND = (
    "background.strength",
    "background.distance_m",
    "background.shadow.c0",
    "background.shadow.c1",
)
_SIGNIFICANT = 3.0  # standard deviations that a coefficient must be above zero
_NARROW = 0.1  # relative standard deviation of a range up to which first order describes it
_POWER_LAW = 0.15  # distance of the exponent from a whole number


def _flux(task: Task, r: Array, frames: Frames) -> Array:
    """Phi / (Phi0 A_D) of the object, shape (n,) [1/m^2]."""
    sensor, crosstalk = task.sensor, task.known.crosstalk
    assert crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    net = frames.readings - np.asarray(crosstalk)
    if task.scene.background is not None:
        strength, distance, c0, c1 = (task.known.get(path) for path in _BACKGROUND)
        net = net - background_light(sensor, (strength, distance, c0, c1), r, frames)
    return np.asarray(component(sensor, net, r) / frames.gains / sensor.known_gain)


def _signal(task: Task, r: Array, frames: Frames) -> Array:
    """Return the object's part of the readings as its flux has it, shape (n, 2)."""
    size = task.sensor.known_gain * frames.gains * _flux(task, r, frames)
    return np.asarray(size[:, None] * carrier(task.sensor, r))


def _map(unknown: tuple[str, ...], known: Known) -> tuple[Array, Array]:
    """Return T and t with (x1, x2, x3) = T y + t for the unknown members, whichever they are."""
    c0, c1, c2 = (known.numbers.get(path) for path in _OBJECT)
    t, columns = np.zeros(3), []
    if c2 is not None:
        t[0] = 1.0 / c2
    if c0 is not None and c2 is not None:
        t[2] = 1.0 / (c0 * c2)
        columns.append(np.array([0.0, 1.0, 0.0]))
    elif c0 is not None:
        # x1 = c0 x3
        columns.append(np.array([c0, c1 if c1 is not None else 0.0, 1.0]))
        if c1 is None:
            columns.append(np.array([0.0, 1.0, 0.0]))
    else:
        if c2 is None:
            columns.append(np.array([1.0, 0.0, 0.0]))
        if c1 is None:
            columns.append(np.array([0.0, 1.0, 0.0]))
        columns.append(np.array([0.0, c1 if c1 is not None else 0.0, 1.0]))
    assert len(columns) == len(unknown)  # noqa: S101
    return np.stack(columns, axis=1), t


def _exponent(task: Task, fit: LinearFit) -> float:
    """Return the power of 1/r with which the flux falls over the ranges of a fit."""
    used = task.frames.select(np.flatnonzero(fit.used))
    r = fit.ranges[fit.used]
    light = np.log(np.maximum(_flux(task, r, used), np.finfo(float).tiny))
    return -float(np.polynomial.polynomial.polyfit(np.log(r), light, 1)[1])


def _open(
    x: Array, sd: Array, unknown: tuple[str, ...], reach: float, exponent: float
) -> dict[str, str]:
    """Return which members are not identified, and why."""
    (x1, x2, x3), (sd1, _, sd3) = x, sd
    square = x3 <= _SIGNIFICANT * sd3 or x3 * reach * reach <= 1e-12 * abs(x1)
    fourth = x1 <= _SIGNIFICANT * sd1
    missing: dict[str, str] = {}
    if (square and abs(exponent - 2) > _POWER_LAW) or (fourth and abs(exponent - 4) > _POWER_LAW):
        reason = (
            f"the flux falls as r^-{exponent:.2g} over these ranges, and noise hides how that "
            "changes: too uncertain; move the object nearer and farther, or lower the noise"
        )
        return dict.fromkeys(unknown, reason)
    if square:
        reason = "the flux follows a square law over these ranges: c0 and c1 not identifiable"
        missing |= {path: reason for path in (_C0, _C1) if path in unknown}
    if fourth:
        reason = "the flux follows a fourth law over these ranges: only c0 c2 is identifiable"
        missing |= {path: reason for path in (_C0, _C2) if path in unknown}
    if not missing and not x2 / x3 > -2.0 * math.sqrt(x1 / x3):
        reason = "the best fit has c1 <= -2 sqrt(c0), where the flux would have poles"
        missing |= {path: reason for path in (_C0, _C1) if path in unknown}
    return missing


def _natural(x: Array, factor: Array) -> dict[str, tuple[float, Array]]:
    """Values of c0, c1, c2 with gradients along the fit's coordinates; ``factor`` is dx/dy."""
    (x1, x2, x3), (f1, f2, f3) = x, factor
    c2, c1, c0 = 1.0 / x1, x2 / x3, x1 / x3
    g0, g1, g2 = (f1 - c0 * f3) / x3, (f2 - c1 * f3) / x3, -c2 * c2 * f1
    return {_C0: (c0, g0), _C1: (c1, g1), _C2: (c2, g2)}


def _solve(task: Task) -> TechniqueResult:
    technique = CONVENTIONAL if task.scene.background is None else BACKGROUND_INTENSITY
    # imported where a fit is asked for: plans of single frames go without
    from inference.fits.answer.likelihood_answer import likelihood_answer
    from inference.fits.linear.follow import Follow
    from inference.fits.linear.linear_answer import linear_answer

    unknown = unknowns_of(task.sensor, task.scene)
    to_x, fixed = _map(unknown, task.known)

    def equation(r: Array, frames: Frames) -> Observed:
        flux = _flux(task, r, frames)
        powers = np.stack([r**2, r**3, r**4], axis=1) * flux[:, None]
        return Observed(powers @ to_x, 1.0 - powers @ fixed)

    signal = functools.partial(_signal, task)
    equations = Equations(technique, task, equation, signal, unknown, _NARROW)
    fit, single = fit_equations(equations)
    refuse_at_rest(fit, single, unknown)
    x = to_x @ fit.x + fixed
    sd = np.linalg.norm(to_x @ fit.factor, axis=1)
    reach = float(np.nanmax(fit.ranges))
    missing = _open(x, np.where(fixed != 0, 0.0, sd), unknown, reach, _exponent(task, fit))
    if len(missing) == len(unknown) and not missing.get("object.c1", "").startswith("the flux"):
        raise RefusedError("; ".join(dict.fromkeys(missing.values())))
    if "object.c0" in missing and "object.c2" not in missing and "object.c2" in unknown:
        equations, fit, to_x = _square_law(equations, fit, to_x)
        x = to_x @ fit.x + fixed
    with np.errstate(divide="ignore", invalid="ignore"):
        natural = _natural(x, to_x)
    if not missing:
        # the ranges that were regressed on are no truth: the likelihood knows their noise
        values = {path: natural[path][0] for path in unknown}
        return likelihood_answer("object_fit", task, values)
    kept = {path: natural[path] for path in unknown if path not in missing}

    def again(moved: Task) -> tuple[Array, Array]:
        found, _ = fit_equations(dataclasses.replace(equations, task=moved))
        values = _natural(to_x @ found.x + fixed, to_x)
        return np.array([values[path][0] for path in kept]), found.residuals

    # only derivatives in time ask for the slopes of the light
    light = _signal(task, fit.ranges, task.frames)
    follow = Follow(again, fit.ranges, light, np.zeros_like(light))
    # their ranges stand, with their own error budget
    single = technique.solve(task)
    return linear_answer("object_fit", task, fit, kept, single, missing, follow)


def _square_law(
    equations: Equations, fit: LinearFit, to_x: Array
) -> tuple[Equations, LinearFit, Array]:
    """Fit c2 alone where nothing else is seen."""
    task = equations.task

    def equation(r: Array, frames: Frames) -> Observed:
        return Observed((r**2 * _flux(task, r, frames))[:, None], np.ones(r.size))

    alone = dataclasses.replace(equations, equation=equation, unknowns=("object.c2",))
    flat, _ = fit_equations(alone)
    # a cubic term without a fourth-order one is no square law: keep the whole fit's c2
    if flat.chi_square - fit.chi_square > _SIGNIFICANT**2 * 2:
        return equations, fit, to_x
    return alone, flat, np.array([[1.0], [0.0], [0.0]])


def _obstacle(sensor: Sensor, scene: Scene, known: Known, frames: Frames | None) -> str | None:
    unknown = unknowns_of(sensor, scene)
    unserved = linear_obstacle(scene, unknown)
    if unserved:
        return unserved
    if scene.background is not None:
        missing = [path for path in _BACKGROUND if not known.has(path)]
        if missing:
            return f"needs a background that is known, and {', '.join(missing)} is not"
    if not any(path in _OBJECT for path in unknown):
        return "fits the object, and the scene's is known"
    return too_few(frames, unknown)


OBJECT_FIT = Technique(
    name="object_fit",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q, of all frames",
    needs=(),
    immune_to=("background",),
    uses_background=False,
    differential=False,
    cost=5e4,
    equations="5.6-5.8: 1/Phi linear in 1/c2, c1/(c0 c2), 1/(c0 c2)",
    roots="as `conventional`, or `background_intensity` before a known background",
    solve=without_warnings(_solve),
    obstacle=_obstacle,
)
