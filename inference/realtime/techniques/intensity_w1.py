"""Range from the amount of light in the late window of a pulse, of a known object."""

from inference.estimates import TechniqueResult
from inference.realtime.net import known_net_readings
from inference.realtime.solving.curves import intensity_w1
from inference.realtime.techniques.intensity import range_from_light
from inference.technique import Task, Technique
from simulator.sensor import PulsedSensor

__all__ = ["INTENSITY_W1"]


def _solve(task: Task) -> TechniqueResult:
    assert isinstance(task.sensor, PulsedSensor)  # noqa: S101  # the registry's `kinds`
    net = known_net_readings(task)
    r0 = task.sensor.r0
    scale = task.known.unit * r0 / (task.sensor.known_gain * task.known.get("object.c2"))
    light = (net.first, net.var1, scale)
    return range_from_light("intensity_w1", task, intensity_w1.CURVE, r0, net, light)


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
    solve=_solve,
)
