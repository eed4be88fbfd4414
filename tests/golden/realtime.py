"""Golden requests that are answered frame by frame."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from inference.estimate import all_roots, estimate
from simulator.frames import Frames
from simulator.scene import parse_scene
from tests.golden.plain import of_estimates, of_result
from tests.golden.scenes import (
    BARE,
    BOTH_KINDS,
    CROSSTALK,
    OBJECT,
    REFERENCE,
    UNKNOWN_CROSSTALK,
    WALL,
    Data,
    frames_of,
    moving,
    sensor_of,
    with_derivatives,
)

__all__ = ["REQUESTS"]

NOISE: Data = {"shot": 1e-9, "relative": 1e-3}
FREE_WALL: Data = {"strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0}}
_FREE = {**WALL, **FREE_WALL}
_LATE: Data = {"object": {**OBJECT, "c1": -0.54}}  # near the pole limit: three roots

# name: truth, scene, techniques (None: the plan), more of the sensor
_CASES: dict[str, tuple[Data, Data, list[str] | None, Data]] = {
    "bare_planned": (BARE, {}, None, {}),
    "bare": (BARE, BARE, ["conventional", "intensity", "intensity_w1", "differential"], {}),
    "bare_noisy": (BARE, BARE, ["conventional", "intensity", "intensity_w1"], {"noise": NOISE}),
    "folded": (_LATE, _LATE, ["intensity", "intensity_w1", "differential"], {"read": 3e-3}),
    "known_crosstalk": (
        BARE | {"crosstalk": CROSSTALK},
        BARE | {"crosstalk": CROSSTALK},
        ["conventional", "intensity", "intensity_w1"],
        {"noise": NOISE},
    ),
    "unknown_crosstalk": (
        BARE | {"crosstalk": CROSSTALK},
        BARE | {"crosstalk": UNKNOWN_CROSSTALK},
        None,
        {},
    ),
    "unknown_object_and_crosstalk": (
        BARE | {"crosstalk": CROSSTALK},
        {"crosstalk": UNKNOWN_CROSSTALK},
        None,
        {},
    ),
    "known_wall": (
        BARE | {"background": WALL},
        BARE | {"background": WALL},
        ["background_cancelling", "background_intensity", "background_cancelling_differential"],
        {"noise": NOISE},
    ),
    "unknown_wall": (
        BARE | {"background": WALL},
        BARE | {"background": _FREE},
        ["background_cancelling"],
        {},
    ),
    "shadow_as_object": (
        BARE | {"background": WALL | {"shadow": "object"}},
        BARE | {"background": WALL | {"shadow": "object"}},
        None,
        {},
    ),
    "wall_and_crosstalk": (
        BARE | {"background": WALL, "crosstalk": CROSSTALK},
        BARE | {"background": WALL, "crosstalk": UNKNOWN_CROSSTALK},
        None,
        {},
    ),
    "tangential": (BARE, BARE | {"motion": "tangential"}, ["differential"], {}),
    "saturated_and_bounded": (
        BARE,
        BARE | {"range_m": REFERENCE},
        ["conventional", "intensity"],
        {"full_scale": [0.1, 0.8]},
    ),
    "discrepancy": (BARE, BARE | {"discrepancy": 0.05}, None, {}),
}


def _request(kind: str, name: str) -> dict[str, Any]:
    truth, scene, techniques, more = _CASES[name]
    sensor = sensor_of(kind, **more)
    ranges = moving(16)
    frames = frames_of(sensor, truth, ranges, empty=1)
    return of_estimates(estimate(sensor, parse_scene(scene), frames, techniques))


def _measured_derivatives(kind: str) -> dict[str, Any]:
    sensor = sensor_of(kind, noise={"derivative": [1e-4, 1e-4], **NOISE})
    ranges = moving(12)
    found = {}
    for name, truth, scene in (
        ("bare", BARE, BARE),
        ("crosstalk", BARE | {"crosstalk": CROSSTALK}, BARE | {"crosstalk": UNKNOWN_CROSSTALK}),
        (
            "wall",
            BARE | {"background": WALL, "crosstalk": CROSSTALK},
            BARE | {"background": WALL, "crosstalk": UNKNOWN_CROSSTALK},
        ),
    ):
        frames = with_derivatives(sensor, truth, frames_of(sensor, truth, ranges), ranges)
        asked = ["differential", "background_cancelling_differential"]
        found[name] = of_estimates(estimate(sensor, parse_scene(scene), frames, asked))
    return found


def _gains(kind: str) -> dict[str, Any]:
    sensor = sensor_of(kind, gain=3.0, noise=NOISE)
    truth = BARE | {"crosstalk": CROSSTALK}
    frames = frames_of(sensor, truth, moving(8))
    gain = np.linspace(0.5, 2.0, 8)
    off = np.asarray(CROSSTALK)
    frames = dataclasses.replace(
        frames, readings=(frames.readings - off) * gain[:, None] + off, gain=gain
    )
    asked = ["conventional", "intensity", "differential"]
    return of_estimates(estimate(sensor, parse_scene(truth), frames, asked))


def _every_root(kind: str) -> dict[str, Any]:
    noise = {"derivative": [1e-6, 1e-6]}
    timing = {"frequency_hz": 2e7} if kind == "sine_wave" else {}
    sensor = sensor_of(kind, noise=noise, **timing)
    wall = _LATE | {"background": WALL}
    found = {}
    for name, scene in (
        ("conventional", _LATE),
        ("intensity", _LATE),
        ("differential", _LATE),
        ("background_cancelling", wall),
        ("background_intensity", wall),
        ("background_cancelling_differential", wall),
    ):
        ranges = moving(5, 0.05, 1.2)
        frames = with_derivatives(sensor, scene, frames_of(sensor, scene, ranges), ranges)
        found[name] = of_result(all_roots(name, sensor, parse_scene(scene), frames, 20.0))
    return found


def _odd_readings(kind: str) -> dict[str, Any]:
    sensor = sensor_of(kind, 1e-3)
    rows = [[0.5, 1.0], [0.5, 0.0], [0.5, -1.0], [-1e-9, 1.0], [1.1, 1.0], [0.0, 0.0], [1e-30, 1e9]]
    times = 0.01 * np.arange(len(rows), dtype=np.float64)
    frames = Frames(np.array(rows), time_s=times)
    asked = ["conventional", "intensity", "differential", "intensity_w1"]
    found = {"bare": of_estimates(estimate(sensor, parse_scene(BARE), frames, asked))}
    asked = ["background_cancelling", "background_intensity"]
    scene = parse_scene(BARE | {"background": WALL})
    found["wall"] = of_estimates(estimate(sensor, scene, frames, asked))
    return found


def _bind(function: Callable[..., dict[str, Any]], *more: Any) -> Callable[[], dict[str, Any]]:
    return lambda: function(*more)


REQUESTS: dict[str, Callable[[], dict[str, Any]]] = {
    f"{name}_{kind}": _bind(_request, kind, name) for name in _CASES for kind in BOTH_KINDS
} | {
    f"{function.__name__[1:]}_{kind}": _bind(function, kind)
    for function in (_measured_derivatives, _gains, _every_root, _odd_readings)
    for kind in BOTH_KINDS
}
