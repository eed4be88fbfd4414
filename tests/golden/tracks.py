"""Golden tracks: readings, one window, derivatives; crosstalk that is learnt; uncertain scenes."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import track
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from tests.golden.plain import of_track
from tests.golden.scenes import (
    BARE,
    BOTH_KINDS,
    CROSSTALK,
    OBJECT,
    REFERENCE,
    STROKE,
    UNKNOWN_CROSSTALK,
    Data,
    frames_of,
    sensor_of,
    with_derivatives,
)

__all__ = ["REQUESTS"]

_SPAN: Data = {"range_m": {"prior": "loguniform", "low": 0.2, "high": 2.9}}
# w2 falls to the fold at 0.986 m and rises beyond it
_FOLDED: Data = {
    "object": {**OBJECT, "c2": 0.03},
    "background": {"strength": 0.1, "distance_m": 10.0, "shadow": {"c0": 0.056, "c1": 0.01}},
}
_NOISE: Data = {"noise": {"shot": 1e-7, "relative": 0.01}}
_MEASURED: Data = {"noise": {"derivative": [2e-4, 2e-3]}}
_PLATE = BARE | _SPAN
_BUSY: Data = {"visit_s": 1.0, "absence_s": 1.0, "rate_sd": 0.5}

# name: sensor, truth, scene, settings, more of the sensor
_CASES: dict[str, tuple[str, Data, Data, Data, Data]] = {
    "readings_pulsed": ("pulsed", BARE, _PLATE, _BUSY, {}),
    "readings_sine_wave": ("sine_wave", BARE, _PLATE, _BUSY, _NOISE),
    "noisy_saturated": ("pulsed", BARE, _PLATE, {}, {**_NOISE, "full_scale": [0.05, 0.2]}),
    "one_window": ("pulsed", _FOLDED, _FOLDED | _SPAN, {"observables": "w2", **_BUSY}, {}),
    "late_window": ("pulsed", _FOLDED, _FOLDED | _SPAN, {"observables": "w1"}, _NOISE),
    "derivatives_pulsed": ("pulsed", BARE, _PLATE, {"observables": "derivatives"}, _MEASURED),
    "derivatives_sine_wave": (
        "sine_wave",
        BARE,
        _PLATE,
        {"observables": "derivatives", **_BUSY},
        _MEASURED,
    ),
    "unknown_crosstalk": (
        "pulsed",
        BARE | {"crosstalk": CROSSTALK},
        _PLATE | {"crosstalk": UNKNOWN_CROSSTALK},
        _BUSY,
        {},
    ),
    "drifting_crosstalk": (
        "sine_wave",
        BARE | {"crosstalk": CROSSTALK},
        _PLATE | {"crosstalk": CROSSTALK},
        {"crosstalk_drift": [1e-4, 2e-4]},
        _NOISE,
    ),
    "static": ("pulsed", BARE, _PLATE | {"motion": "static"}, {}, {}),
    "stroke": ("pulsed", BARE, BARE | {"range_m": STROKE}, {}, {}),
    "reference_discrepancy": (
        "sine_wave",
        BARE,
        BARE | {"range_m": REFERENCE, "discrepancy": 0.05},
        _BUSY,
        {},
    ),
}


def _ranges(count: int) -> list[float]:
    steps = np.arange(count)
    u = 0.7 * np.sin(0.07 * steps) + 0.05 * np.cos(0.9 * steps)
    return [float(r) for r in 0.8 * np.exp(u)]


def _request(name: str) -> dict[str, Any]:
    kind, truth, scene, settings, more = _CASES[name]
    sensor = sensor_of(kind, **{"read": 1e-4, **more})
    ranges = _ranges(60)
    frames = frames_of(sensor, truth, ranges)
    if settings.get("observables") == "derivatives":
        frames = with_derivatives(sensor, truth, frames, ranges)
    readings = frames.readings.copy()
    readings[30] *= 3.0  # an outlier
    present = np.ones(60, dtype=bool)
    present[40:45] = False
    crosstalk = np.asarray(truth.get("crosstalk", [0.0, 0.0]))
    if "background" not in truth:
        readings[40:45] = crosstalk + 1e-4 * np.random.default_rng(2).standard_normal((5, 2))
    frames = dataclasses.replace(frames, readings=readings, object_present=present)
    chosen = TrackingSettings.model_validate(settings)
    return of_track(track(sensor, parse_scene(scene), frames, chosen))


def _uncertain(kind: str) -> dict[str, Any]:
    """Unknowns of the scene that draws of a posterior tell, crosstalk among them."""
    sensor = sensor_of(kind, 1e-4)
    truth = BARE | {"crosstalk": CROSSTALK}
    frames = frames_of(sensor, truth, _ranges(40))
    scene = parse_scene(_SPAN | {"crosstalk": UNKNOWN_CROSSTALK})
    parameters = parameters_of(sensor, scene)
    centre = np.array([OBJECT["c0"], OBJECT["c1"], OBJECT["c2"], *CROSSTALK])
    z = parameters.standard(centre[None])
    spread = 0.02 * np.random.default_rng(3).standard_normal((150, 5)) * [1, 1, 1, 0.1, 0.1]
    draws = parameters.natural(z + spread)
    return of_track(track(sensor, scene, frames, None, draws))


def _bind(function: Callable[[str], dict[str, Any]], name: str) -> Callable[[], dict[str, Any]]:
    return lambda: function(name)


REQUESTS: dict[str, Callable[[], dict[str, Any]]] = {
    name: _bind(_request, name) for name in _CASES
} | {f"uncertain_scene_{kind}": _bind(_uncertain, kind) for kind in BOTH_KINDS}
