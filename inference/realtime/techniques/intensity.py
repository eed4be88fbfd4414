"""Range from the amount of light of a known object: from w2 or the modulus, and from w1."""

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.realtime.assemble import Outcome, assemble, reasons_of
from inference.realtime.from_curve import candidates_of
from inference.realtime.net import UNREPRESENTABLE, Net, net_readings
from inference.realtime.solving import curves
from inference.technique import Task, Technique
from simulator.sensor import PulsedSensor

__all__ = ["INTENSITY", "INTENSITY_W1"]

Array = NDArray[np.float64]

_DARK = "no light from the object: the reading is not positive"
_BEYOND = "the late window reads less than from an object at r0"
_REASONS = reasons_of(_DARK, _BEYOND)


def _solve(task: Task) -> TechniqueResult:
    net = _net(task)
    if isinstance(task.sensor, PulsedSensor):
        reading, variance = net.second, net.var2
    else:
        with np.errstate(all="ignore"):
            reading = np.hypot(net.first, net.second)
            safe = np.where(reading > 0, reading, 1.0)
            variance = net.variance(net.first / safe, net.second / safe)
    scale = task.known.unit**2 / (task.sensor.gain * task.known.get("object.c2"))
    return _finish("intensity", task, curves.INTENSITY, np.inf, reading, variance, scale)


def _solve_w1(task: Task) -> TechniqueResult:
    assert isinstance(task.sensor, PulsedSensor)  # noqa: S101  # the registry's `kinds`
    net = _net(task)
    r0 = task.sensor.r0
    scale = task.known.unit * r0 / (task.sensor.gain * task.known.get("object.c2"))
    return _finish("intensity_w1", task, curves.INTENSITY_W1, r0, net.first, net.var1, scale)


def _net(task: Task) -> Net:
    assert task.known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    return net_readings(task.sensor, task.known.crosstalk, task.frames)


def _finish(
    name: str,
    task: Task,
    kind: int,
    high_m: float,
    reading: Array,
    variance: Array,
    scale: float,
) -> TechniqueResult:
    with np.errstate(all="ignore"):
        state = _net(task).state.copy()
        target = reading * scale
        lost = (reading > 0) & ~((target > 0) & np.isfinite(target))
        state[lost & (state == 0)] = UNREPRESENTABLE
        usable = (state == 0) & (reading > 0)
        target = np.where(usable, target, np.nan)
        sd = np.hypot(np.sqrt(variance) * scale, task.sensor.noise.relative * target)
        candidates, _ = candidates_of(task, kind, high_m, target, sd)
    dark = len(_REASONS) - 2
    reason = np.where(reading > 0, dark + 1, dark).astype(np.uint8)
    support = task.known.support if task.physical else (0.0, np.inf)
    return assemble(name, state, candidates, Outcome(None, support, reason, _REASONS))


INTENSITY = Technique(
    name="intensity",
    kinds=("pulsed", "sine_wave"),
    observables="w2, or the modulus of i + jq",
    needs=("object.c0", "object.c1", "object.c2"),
    immune_to=(),
    uses_background=False,
    differential=False,
    cost=150.0,
    equations="4.1-4.3",
    roots="1 if c1 >= -1.886 sqrt(c0), else up to 3",
    solve=_solve,
)

INTENSITY_W1 = Technique(
    name="intensity_w1",
    kinds=("pulsed",),
    observables="w1",
    needs=("object.c0", "object.c1", "object.c2"),
    immune_to=(),
    uses_background=False,
    differential=False,
    cost=150.0,
    equations="4.4",
    roots="1 if c1 >= -1.732 sqrt(c0), else up to 3",
    solve=_solve_w1,
)
