"""The shadow, or the background's strength, by linear least squares (5.2.3 and Table 5.1).

Ranges come from background cancelling, which needs the object and the background's distance but
not what is fitted here. With S the visible share, S / (1 - S) = r^2 / c0' + r c1' / c0' is linear
in 1 / c0' and c1' / c0'; with a known shadow the readings are linear in the strength.
"""

import functools
import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.fits.answer.counts import linear_obstacle, too_few
from inference.fits.likelihood.unknowns import unknowns_of
from inference.fits.linear.at_rest import refuse_at_rest
from inference.fits.linear.equations import Equations, Observed, fit_equations, without_warnings
from inference.fits.linear.light import background_light, component, object_light
from inference.known import Known
from inference.realtime.net import SATURATED, rule_out
from inference.realtime.techniques.background_cancelling import BACKGROUND_CANCELLING
from inference.technique import Task, Technique
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["SHADOW_FIT"]

Array = NDArray[np.float64]

_C0, _C1 = "background.shadow.c0", "background.shadow.c1"
_STRENGTH = "background.strength"
_SIGNIFICANT = 3.0


def _signal(task: Task, r: Array, frames: Frames) -> Array:
    """Return the known object's readings, shape (n, 2)."""
    c0, c1, c2 = (task.known.get(f"object.{name}") for name in ("c0", "c1", "c2"))
    return object_light(task.sensor, (c0, c1, c2), r, frames)[0]


def _from_background(task: Task, readings: Array, frames: Frames) -> Array:
    """Return the size of the background's light in readings, over the gain factor, shape (n,)."""
    distance = np.full(len(frames), task.known.get("background.distance_m"))
    return np.asarray(component(task.sensor, readings, distance) / frames.gains)


def _visible(task: Task, signal: Array, frames: Frames) -> Array:
    """Return the size of the background in readings of which the object's part is given."""
    crosstalk = task.known.crosstalk
    assert crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    return _from_background(task, frames.readings - np.asarray(crosstalk) - signal, frames)


def _solve(task: Task) -> TechniqueResult:
    unknown = unknowns_of(task.sensor, task.scene)
    if unknown == (_STRENGTH,):
        return _solve_strength(task)
    strength = task.known.get(_STRENGTH)
    c0, c1 = (task.known.numbers.get(path) for path in (_C0, _C1))
    # (y1, y2) = (1 / c0', c1' / c0') = T y + t
    if c0 is not None:
        to_y, fixed = np.array([[0.0], [1.0]]), np.array([1.0 / c0, 0.0])
    elif c1 is not None:
        to_y, fixed = np.array([[1.0], [c1]]), np.zeros(2)
    else:
        to_y, fixed = np.eye(2), np.zeros(2)

    def equation(r: Array, frames: Frames) -> Observed:
        share = _visible(task, _signal(task, r, frames), frames) / strength
        powers = np.stack([r**2, r], axis=1) * (1.0 - share)[:, None]
        return Observed(powers @ to_y, share - powers @ fixed)

    signal = functools.partial(_signal, task)
    fit, single = fit_equations(Equations(BACKGROUND_CANCELLING, task, equation, signal, unknown))
    refuse_at_rest(fit, single, unknown)
    y = to_y @ fit.x + fixed
    sd = np.linalg.norm(to_y @ fit.factor, axis=1)
    reason = None
    if y[0] <= _SIGNIFICANT * sd[0] and fixed[0] == 0.0:
        reason = "no term in r^2 is seen over these ranges: the shadow is not identifiable"
    elif not y[1] / y[0] > -2.0 / math.sqrt(y[0]):
        reason = "the best fit has c1' <= -2 sqrt(c0'), where the shadow would have poles"
    if reason:
        raise RefusedError(
            f"{reason}; move the object nearer, lower the noise, or use a posterior with priors"
        )
    # the ranges that were regressed on are no truth: the likelihood knows their noise
    values = {_C0: 1.0 / y[0], _C1: y[1] / y[0]}
    return _by_likelihood(task, {path: values[path] for path in unknown})


def _by_likelihood(task: Task, values: dict[str, float]) -> TechniqueResult:
    # imported where a fit is asked for: plans of single frames go without
    from inference.fits.answer.likelihood_answer import likelihood_answer

    return likelihood_answer("shadow_fit", task, values)


def _solve_strength(task: Task) -> TechniqueResult:
    distance, c0, c1 = (task.known.get(path) for path in ("background.distance_m", _C0, _C1))
    clipped = rule_out(task.sensor, task.frames) == SATURATED

    def equation(r: Array, frames: Frames) -> Observed:
        visible = _visible(task, _signal(task, r, frames), frames)
        unit = background_light(task.sensor, (1.0, distance, c0, c1), r, frames)
        share = _from_background(task, unit, frames)
        # an empty scene shows all of it, unless it is beyond full scale
        empty = ~frames.present
        bare = np.where(clipped, np.nan, _visible(task, np.zeros_like(unit), frames))
        share, visible = np.where(empty, 1.0, share), np.where(empty, bare, visible)
        return Observed(share[:, None], visible)

    def signal(r: Array, frames: Frames) -> Array:
        return np.where(frames.present[:, None], _signal(task, r, frames), 0.0)

    fit, _ = fit_equations(Equations(BACKGROUND_CANCELLING, task, equation, signal, (_STRENGTH,)))
    value = float(fit.x[0])
    if not value > 0.0:
        raise RefusedError(
            f"the best fit has a background of strength {value:.3g}; leave the background out of "
            "the scene, or use a posterior with priors"
        )
    return _by_likelihood(task, {_STRENGTH: value})


def _obstacle(sensor: Sensor, scene: Scene, known: Known, frames: Frames | None) -> str | None:
    unknown = unknowns_of(sensor, scene)
    unserved = linear_obstacle(scene, unknown)
    if unserved:
        return unserved
    if not unknown:
        return "fits the shadow or the background's strength, and both are known"
    if _STRENGTH in unknown and len(unknown) > 1:
        return "strength and shadow together are not linear in the readings: take joint_fit"
    if not known.has(_STRENGTH) and _STRENGTH not in unknown:
        return "needs background.strength as a number, or as an unknown of a term that stays"
    return too_few(frames, unknown)


SHADOW_FIT = Technique(
    name="shadow_fit",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q, of all frames",
    needs=("object.c0", "object.c1", "object.c2", "background.distance_m"),
    immune_to=("background",),
    uses_background=True,
    differential=False,
    cost=2e4,
    equations="Table 5.1: S/(1-S) linear in 1/c0', c1'/c0'; or readings linear in the strength",
    roots="as `background_cancelling`; the fit decides between several",
    solve=without_warnings(_solve),
    obstacle=_obstacle,
)
