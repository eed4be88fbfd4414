"""Range from the amount of light of a known object: w2, or the modulus."""

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.realtime.assemble import NEGATIVE, Outcome, assemble, reasons_of
from inference.realtime.from_curve import candidates_of
from inference.realtime.net import UNREPRESENTABLE, Net, known_net_readings
from inference.realtime.solving.curves import intensity
from inference.realtime.solving.curves.curve import Curve
from inference.realtime.solving.pulse_ratio import CONTRADICTED
from inference.technique import Task, Technique
from simulator.sensor import PulsedSensor

__all__ = ["INTENSITY", "range_from_light"]

Array = NDArray[np.float64]

_REASONS = reasons_of(
    "no light from the object: the reading is not positive",
    "the late window reads less than from an object at r0",
    NEGATIVE,
)
_DARK, _BEYOND, _NEGATIVE = range(len(_REASONS) - 3, len(_REASONS))


def range_from_light(
    name: str, task: Task, curve: Curve, high_m: float, net: Net, light: tuple[Array, Array, float]
) -> TechniqueResult:
    """Answer from one positive reading that the range alone decides.

    Parameters
    ----------
    name : str
        The technique.
    curve : Curve
        What the reading is of the range.
    high_m : float
        Upper end of the technique's interval [m].
    net : Net
        Readings net of crosstalk.
    light : (ndarray, ndarray, float)
        The reading and its variance, both of shape (n,), and what turns it into the curve's value.
    """
    reading, variance, scale = light
    with np.errstate(all="ignore"):
        state = net.state.copy()
        target = reading * scale
        lost = (reading > 0) & ~((target > 0) & np.isfinite(target))
        state[lost & (state == 0)] = UNREPRESENTABLE
        usable = (state == 0) & (reading > 0)
        target = np.where(usable, target, np.nan)
        sd = np.hypot(np.sqrt(variance) * scale, net.relative * target)
        candidates, _ = candidates_of(task, curve, high_m, target, sd)
        negative = -reading > CONTRADICTED * np.sqrt(variance)
    reason = np.where(reading > 0, _BEYOND, np.where(negative, _NEGATIVE, _DARK)).astype(np.uint8)
    support = task.known.support if task.physical else (0.0, np.inf)
    return assemble(name, state, candidates, Outcome(None, support, reason, _REASONS))


def _solve(task: Task) -> TechniqueResult:
    net = known_net_readings(task)
    if isinstance(task.sensor, PulsedSensor):
        reading, variance = net.second, net.var2
    else:
        with np.errstate(all="ignore"):
            reading = np.hypot(net.first, net.second)
            safe = np.where(reading > 0, reading, 1.0)
            variance = net.variance(net.first / safe, net.second / safe)
    scale = task.known.unit**2 / (task.sensor.known_gain * task.known.get("object.c2"))
    light = (reading, variance, scale)
    return range_from_light("intensity", task, intensity.CURVE, np.inf, net, light)


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
    farthest_m=lambda _: np.inf,
)
