"""Golden requests before any data: what frames at given ranges would tell."""

from collections.abc import Callable
from typing import Any

from inference.identifiability.before_data import identifiability
from simulator.scene import parse_scene
from tests.golden.plain import of_foresight
from tests.golden.scenes import (
    BARE,
    BOTH_KINDS,
    CROSSTALK,
    OBJECT,
    REFERENCE,
    STROKE,
    UNKNOWN_CROSSTALK,
    UNKNOWN_WALL,
    WALL,
    Data,
    moving,
    sensor_of,
)

__all__ = ["REQUESTS"]

_NOISE: Data = {"noise": {"shot": 1e-8, "relative": 3e-3}}
_SHADOW = WALL["shadow"]

# name: scene, more of the sensor, ranges, values at which to look
_CASES: dict[str, tuple[Data, Data, list[float], dict[str, float]]] = {
    "object": ({}, {}, moving(12), {"object.c1": -0.1}),
    "object_noisy": ({"crosstalk": CROSSTALK}, _NOISE, moving(12), {}),
    "crosstalk": ({"crosstalk": UNKNOWN_CROSSTALK}, _NOISE, moving(12), {"object.c0": 0.08}),
    "known_wall": ({"background": WALL}, {}, moving(12), {}),
    "wall": ({"background": UNKNOWN_WALL | {"shadow": _SHADOW}}, {}, moving(12), {}),
    "wall_free_shadow_crosstalk": (
        {"background": UNKNOWN_WALL, "crosstalk": UNKNOWN_CROSSTALK},
        _NOISE,
        moving(20),
        {},
    ),
    "shadow_as_object": ({"background": UNKNOWN_WALL | {"shadow": "object"}}, {}, moving(8), {}),
    "optional": (
        {"crosstalk": {"values": UNKNOWN_CROSSTALK, "optional": True}},
        {},
        moving(4),
        {},
    ),
    "static": (
        {"object": {"c0": OBJECT["c0"]}, "motion": "static", "crosstalk": UNKNOWN_CROSSTALK},
        {},
        [0.6] * 5,
        {},
    ),
    "stroke": ({"range_m": STROKE}, {}, moving(10), {}),
    "reference": ({"range_m": REFERENCE}, _NOISE, moving(10), {}),
    "discrepancy": (
        {"discrepancy": 0.05, "crosstalk": UNKNOWN_CROSSTALK},
        {},
        moving(10, 0.2, 0.6),
        {},
    ),
    "known": (BARE, _NOISE, moving(3), {}),
}


def _request(kind: str, name: str) -> dict[str, Any]:
    scene, more, ranges, at = _CASES[name]
    present = [True] * (len(ranges) - 1) + [name not in ("object", "crosstalk", "wall")]
    return of_foresight(
        identifiability(sensor_of(kind, **more), parse_scene(scene), ranges, present, at)
    )


def _bind(kind: str, name: str) -> Callable[[], dict[str, Any]]:
    return lambda: _request(kind, name)


REQUESTS: dict[str, Callable[[], dict[str, Any]]] = {
    f"{name}_{kind}": _bind(kind, name) for name in _CASES for kind in BOTH_KINDS
}
