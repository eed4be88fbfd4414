"""Golden requests that are answered by a fit over many frames."""

from collections.abc import Callable
from typing import Any

from inference.estimate import estimate
from simulator.scene import parse_scene
from tests.golden.plain import of_estimates
from tests.golden.scenes import (
    BARE,
    CROSSTALK,
    OBJECT,
    REFERENCE,
    STROKE,
    UNKNOWN_CROSSTALK,
    UNKNOWN_WALL,
    WALL,
    Data,
    frames_of,
    moving,
    sensor_of,
    with_derivatives,
)

__all__ = ["REQUESTS"]

_SEEN: Data = {"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}}
_DEEP: Data = {"object": {**OBJECT, "c1": 0.05}}
_SHADOW = WALL["shadow"]

# name: sensor, truth, scene, techniques, frames, of which empty, more of the sensor
_CASES: dict[str, tuple[str, Data, Data, list[str], int, int, Data]] = {
    "object_pulsed": ("pulsed", BARE, {}, ["object_fit", "joint_fit"], 10, 0, {}),
    "object_sine_wave": ("sine_wave", BARE, {}, ["object_fit", "joint_fit"], 10, 1, {}),
    "object_noisy": (
        "pulsed",
        BARE,
        {"object": {"c2": OBJECT["c2"]}},
        ["object_fit", "joint_fit"],
        10,
        0,
        {"noise": {"shot": 1e-9, "relative": 1e-3}},
    ),
    "object_before_wall": (
        "sine_wave",
        BARE | {"background": WALL},
        {"background": WALL},
        ["object_fit", "joint_fit"],
        10,
        0,
        {},
    ),
    "known_crosstalk": (
        "pulsed",
        BARE | {"crosstalk": CROSSTALK},
        {"crosstalk": CROSSTALK},
        ["object_fit"],
        8,
        0,
        {"full_scale": [0.2, 1.0]},
    ),
    "unknown_crosstalk_pulsed": (
        "pulsed",
        BARE | {"crosstalk": CROSSTALK},
        {"crosstalk": UNKNOWN_CROSSTALK},
        ["joint_fit", "iterative_differential"],
        10,
        1,
        {},
    ),
    "unknown_crosstalk_sine_wave": (
        "sine_wave",
        BARE | {"crosstalk": CROSSTALK},
        {"crosstalk": UNKNOWN_CROSSTALK},
        ["iterative_differential"],
        10,
        0,
        {},
    ),
    "crosstalk_by_differences": (
        "pulsed",
        BARE | {"crosstalk": CROSSTALK},
        _SEEN | {"crosstalk": UNKNOWN_CROSSTALK},
        ["crosstalk_fit"],
        20,
        0,
        {},
    ),
    "shadow_pulsed": (
        "pulsed",
        BARE | {"background": WALL},
        BARE | {"background": {**WALL, "shadow": {}}},
        ["shadow_fit", "joint_fit"],
        12,
        0,
        {"read": 7.72e-7},
    ),
    "shadow_sine_wave": (
        "sine_wave",
        BARE | {"background": WALL},
        BARE | {"background": {**WALL, "shadow": {"c0": _SHADOW["c0"]}}},
        ["shadow_fit"],
        12,
        1,
        {"read": 7.72e-7},
    ),
    "strength": (
        "pulsed",
        BARE | {"background": WALL},
        BARE | {"background": {**WALL, "strength": UNKNOWN_WALL["strength"]}},
        ["shadow_fit"],
        8,
        0,
        {},
    ),
    "shadow_as_object": (
        "pulsed",
        _DEEP | {"background": {**WALL, "shadow": "object"}},
        {"background": {**WALL, "shadow": "object"}},
        ["joint_fit", "iterative_background_cancelling"],
        10,
        0,
        {},
    ),
    "unknown_wall": (
        "sine_wave",
        BARE | {"background": WALL},
        _SEEN | {"background": UNKNOWN_WALL | {"shadow": _SHADOW}},
        ["joint_fit"],
        10,
        1,
        {},
    ),
    "wall_and_crosstalk": (
        "pulsed",
        BARE | {"background": WALL, "crosstalk": CROSSTALK},
        _SEEN | {"background": UNKNOWN_WALL | {"shadow": _SHADOW}, "crosstalk": UNKNOWN_CROSSTALK},
        ["joint_fit"],
        12,
        1,
        {"noise": {"shot": 1e-9}},
    ),
    "stroke": ("pulsed", BARE, {"range_m": STROKE}, ["joint_fit"], 8, 0, {}),
    "reference": ("sine_wave", BARE, {"range_m": REFERENCE}, ["joint_fit"], 8, 0, {}),
    "too_noisy": ("pulsed", BARE, {}, ["joint_fit", "object_fit"], 8, 0, {"read": 3e-3}),
    "misfit": (
        "pulsed",
        BARE | {"crosstalk": CROSSTALK},
        {},
        ["joint_fit", "object_fit"],
        8,
        0,
        {},
    ),
    "too_few": ("pulsed", BARE, {}, ["joint_fit", "object_fit", "shadow_fit"], 2, 0, {}),
    "optional": (
        "pulsed",
        BARE,
        {"crosstalk": {"values": UNKNOWN_CROSSTALK, "optional": True}},
        ["joint_fit", "crosstalk_fit"],
        8,
        0,
        {},
    ),
}


def _request(name: str) -> dict[str, Any]:
    kind, truth, scene, techniques, count, empty, more = _CASES[name]
    sensor = sensor_of(kind, **more)
    frames = frames_of(sensor, truth, moving(count), empty)
    return of_estimates(estimate(sensor, parse_scene(scene), frames, techniques))


def _at_rest() -> dict[str, Any]:
    sensor = sensor_of("pulsed")
    frames = frames_of(sensor, BARE, [0.5] * 8)
    scene = parse_scene(_SEEN | {"motion": "static"})
    return of_estimates(estimate(sensor, scene, frames, ["object_fit", "joint_fit"]))


def _measured_derivatives(kind: str) -> dict[str, Any]:
    sensor = sensor_of(kind, noise={"derivative": [1e-6, 1e-6]})
    truth = BARE | {"crosstalk": CROSSTALK}
    ranges = moving(10, 0.2, 1.2)
    frames = with_derivatives(sensor, truth, frames_of(sensor, truth, ranges), ranges)
    scene = parse_scene(_SEEN | {"crosstalk": UNKNOWN_CROSSTALK})
    return of_estimates(estimate(sensor, scene, frames, ["crosstalk_fit"]))


def _bind(function: Callable[..., dict[str, Any]], *more: Any) -> Callable[[], dict[str, Any]]:
    return lambda: function(*more)


REQUESTS: dict[str, Callable[[], dict[str, Any]]] = {
    **{name: _bind(_request, name) for name in _CASES},
    "at_rest": _at_rest,
    "measured_derivatives_pulsed": _bind(_measured_derivatives, "pulsed"),
    "measured_derivatives_sine_wave": _bind(_measured_derivatives, "sine_wave"),
}
