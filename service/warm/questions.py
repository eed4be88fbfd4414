"""Questions of every kind, with data of their own: what asks them all has all machine code.

Frames are made without a kernel, and what answers is imported by the question.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

__all__ = ["FIRST_STEPS", "QUESTIONS"]

Body = dict[str, Any]
_PULSED: Body = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-4]}}
_SINE: Body = {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [3e-5, 3e-5]}}
_OBJECT: Body = {"c0": 0.0817, "c1": 0.0574, "c2": 0.103}
_SHADOW: Body = {"c0": 0.056, "c1": 0.013}
_WALL: Body = {"strength": 0.0177, "distance_m": 3.0, "shadow": _SHADOW}
_FREE_WALL: Body = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 0.5},
    "distance_m": {"prior": "uniform", "low": 2.5, "high": 4.0},
}
_VAGUE: Body = {"prior": "normal", "mean": 0.0, "sd": 0.05}
_CROSSTALK: Body = {"crosstalk": [_VAGUE, _VAGUE]}
_FRAMES = 12


def _data(sensor: Any, wall: bool, crosstalk: bool) -> Any:
    """Return frames on a way from 0.3 to 1.5 m, without a kernel."""
    import numpy as np

    from simulator.frames import Frames
    from simulator.sensor import PulsedSensor

    c0, c1, gain = _OBJECT["c0"], _OBJECT["c1"], _OBJECT["c0"] * _OBJECT["c2"]
    r = np.geomspace(0.3, 1.5, _FRAMES)
    q = r * r + c1 * r + c0
    flux = gain / (r * r * q)
    change = -flux * (4 * r * r + 3 * c1 * r + 2 * c0) / (r * q)
    far, s0, s1 = _WALL["distance_m"], _SHADOW["c0"], _SHADOW["c1"]
    qs = r * r + s1 * r + s0
    back = wall * _WALL["strength"] * (r * r + s1 * r) / qs
    back_change = wall * _WALL["strength"] * s0 * (2 * r + s1) / qs**2
    if isinstance(sensor, PulsedSensor):
        pair = (flux * r + back * far) / sensor.r0, flux + back
        rate = (change * r + flux + back_change * far) / sensor.r0, change + back_change
    else:
        k = sensor.wave_number
        turn, end = np.exp(1j * k * r), np.exp(1j * k * far)
        x, dx = flux * turn + back * end, (change + 1j * k * flux) * turn + back_change * end
        pair, rate = (x.real, x.imag), (dx.real, dx.imag)
    readings = np.column_stack(pair) + np.multiply(crosstalk, (0.003, 0.01))
    noise = np.random.default_rng(1).normal(size=readings.shape)
    return Frames(
        readings + noise * sensor.noise.read,
        time_s=np.linspace(0.0, 1.0, _FRAMES),
        derivatives=np.column_stack(rate),
    )


def _question(sensor: Body, scene: Body, wall: bool = False, crosstalk: bool = False) -> Any:
    from simulator.scene import parse_scene
    from simulator.sensor import parse_sensor

    parsed = parse_sensor(sensor)
    return parsed, parse_scene(scene), _data(parsed, wall, crosstalk)


def _estimate(technique: str, sensor: Body, scene: Body, **data: bool) -> object:
    from inference.estimate import estimate

    parsed, known, frames = _question(sensor, scene, **data)
    return estimate(parsed, known, frames, [technique]).results


def _track(sensor: Body, scene: Body, **data: bool) -> None:
    from inference.tracking.track import step
    from inference.tracking.tracker import tracker

    parsed, known, frames = _question(sensor, scene, **data)
    model = tracker(parsed, known)
    step(model, model.first, frames)


def _posterior(sensor: Body, scene: Body, whole_start: bool, **data: bool) -> None:
    """Ask for the first step of a posterior, or for its whole start and one step more."""
    from inference.posterior import fold
    from inference.posterior.settings import SamplerSettings
    from inference.posterior.stages.stage import Selecting, Starting

    parsed, known, frames = _question(sensor, scene, **data)
    job = fold.prepare(parsed, known, frames, SamplerSettings(seed=1))
    checkpoint = fold.start(job)
    while whole_start and isinstance(checkpoint.stage, Selecting | Starting):
        pieces = [fold.run(task) for task in fold.tasks(job, checkpoint)]
        checkpoint = fold.merge(job, checkpoint, pieces)
    for task in fold.tasks(job, checkpoint)[: 1 if whole_start else None]:
        fold.run(task)


def _lines() -> object:
    """Read lines of a stream, and write as many answers; neither needs a tracker."""
    from itertools import repeat

    import numpy as np

    from service.streams.laying import laid
    from service.streams.number_lines import number_lines

    n = 40
    numbers = number_lines([*repeat(b'{"time_s":0.1,"w1":1e-3,"w2":1}', n)])
    return numbers and laid([b"[", b",", b"]\n"], [np.arange(n), [*repeat(b"a", n)]], n)


def _single() -> dict[str, Callable[[], object]]:
    plain, wall = {"object": _OBJECT}, {"object": _OBJECT, "background": _WALL}
    without = ("conventional", "intensity", "intensity_w1", "differential")
    behind = ("cancelling", "intensity", "cancelling_differential")
    found: dict[str, Callable[[], object]] = {}
    for kind, sensor in (("pulsed", _PULSED), ("sine wave", _SINE)):
        for name in without:
            if (kind, name) != ("sine wave", "intensity_w1"):
                found[f"{name}, {kind}"] = partial(_estimate, name, sensor, plain)
        for name in behind:
            whole = f"background_{name}"
            found[f"{whole}, {kind}"] = partial(_estimate, whole, sensor, wall, wall=True)
    return found


def _many() -> dict[str, Callable[[], object]]:
    plain = {"object": _OBJECT}
    return {
        "object_fit": partial(_estimate, "object_fit", _PULSED, {}),
        "joint_fit, object": partial(_estimate, "joint_fit", _PULSED, {}),
        "joint_fit, crosstalk": partial(
            _estimate, "joint_fit", _PULSED, _CROSSTALK, crosstalk=True
        ),
        "joint_fit, sine wave": partial(_estimate, "joint_fit", _SINE, {}),
        "tracker": partial(_track, _PULSED, plain),
        "tracker, crosstalk": partial(_track, _PULSED, plain | _CROSSTALK, crosstalk=True),
        "lines of a stream": _lines,
    }


def _posteriors(whole_start: bool) -> dict[str, Callable[[], object]]:
    ask = partial(_posterior, whole_start=whole_start)
    optional = {"crosstalk": {"values": [_VAGUE, _VAGUE], "optional": True}}
    both = _CROSSTALK | {"background": _FREE_WALL}
    return {
        "posterior, object": partial(ask, _PULSED, {}),
        "posterior, at rest": partial(ask, _PULSED, {"motion": "static"}),
        "posterior, sine wave": partial(ask, _SINE, {}),
        "posterior, crosstalk": partial(ask, _PULSED, _CROSSTALK, crosstalk=True),
        "posterior, optional": partial(ask, _PULSED, optional, crosstalk=True),
        "posterior, wall": partial(ask, _PULSED, both, wall=True, crosstalk=True),
    }


QUESTIONS: dict[str, Callable[[], object]] = {
    **_single(),
    **_many(),
    **_posteriors(whole_start=True),
}
"""What a process may be asked first, by its name."""

FIRST_STEPS: dict[str, Callable[[], object]] = {
    f"first step of a {name}": step for name, step in _posteriors(whole_start=False).items()
}
"""What is there of a posterior when something of it can be told, stored or cancelled."""
