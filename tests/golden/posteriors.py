"""Golden posteriors: small, driven by chunks whose number is fixed, so that no clock enters."""

from collections.abc import Callable
from typing import Any

from inference.posterior import fold
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from tests.golden.plain import of_posterior
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
)

__all__ = ["REQUESTS"]

_SEEN: Data = {"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}}
_WALL_SEEN = UNKNOWN_WALL | {"shadow": WALL["shadow"]}
_NOISE: Data = {"noise": {"shot": 1e-8, "relative": 3e-3}}

# name: sensor, truth, scene, method, chunks, frames, of which empty, more of the sensor
_CASES: dict[str, tuple[str, Data, Data, str, int, int, int, Data]] = {
    "object_pulsed": ("pulsed", BARE, {}, "emcee", 2, 6, 1, {}),
    "object_sine_wave_noisy": ("sine_wave", BARE, _SEEN, "emcee", 1, 6, 0, _NOISE),
    "crosstalk": (
        "pulsed",
        BARE | {"crosstalk": CROSSTALK},
        _SEEN | {"crosstalk": UNKNOWN_CROSSTALK},
        "emcee",
        1,
        6,
        1,
        _NOISE,
    ),
    "importance": ("pulsed", BARE, _SEEN, "importance", 1, 6, 0, {}),
    "auto_known_wall": (
        "sine_wave",
        BARE | {"background": WALL},
        _SEEN | {"background": WALL},
        "auto",
        1,
        5,
        0,
        {"full_scale": [0.5, 0.5]},
    ),
    "static": (
        "pulsed",
        BARE,
        _SEEN | {"motion": "static", "crosstalk": UNKNOWN_CROSSTALK},
        "emcee",
        1,
        5,
        1,
        {},
    ),
    "discrepancy": ("pulsed", BARE, _SEEN | {"discrepancy": 0.05}, "emcee", 1, 4, 0, {}),
    "reference": ("pulsed", BARE, _SEEN | {"range_m": REFERENCE}, "emcee", 1, 5, 0, _NOISE),
    "stroke": ("sine_wave", BARE, _SEEN | {"range_m": STROKE}, "emcee", 1, 5, 0, {}),
    "wall_confounded_with_crosstalk": (
        "pulsed",
        BARE | {"background": WALL, "crosstalk": CROSSTALK},
        BARE | {"background": _WALL_SEEN, "crosstalk": UNKNOWN_CROSSTALK},
        "emcee",
        1,
        5,
        0,
        {},
    ),
    "populations": (
        "pulsed",
        BARE | {"background": WALL},
        BARE | {"background": UNKNOWN_WALL},
        "emcee",
        3,
        5,
        0,
        {},
    ),
    "optional_crosstalk": (
        "pulsed",
        BARE,
        _SEEN | {"crosstalk": {"values": UNKNOWN_CROSSTALK, "optional": True}},
        "emcee",
        3,
        6,
        0,
        {},
    ),
    "known": ("pulsed", BARE, BARE | {"crosstalk": CROSSTALK}, "emcee", 1, 4, 0, {}),
}


def _request(name: str) -> dict[str, Any]:
    kind, truth, scene, method, chunks, count, empty, more = _CASES[name]
    sensor = sensor_of(kind, **{"read": 7.72e-5, **more})
    ranges = [0.6] * count if "motion" in scene else moving(count)
    frames = frames_of(sensor, truth, ranges, empty)
    settings = SamplerSettings.model_validate(
        {"method": method, "ensembles": 2, "target_ess": 100, "seed": 5}
    )
    job = fold.prepare(sensor, parse_scene(scene), frames, settings)
    checkpoint = fold.start(job)
    for _ in range(chunks):
        pieces = [fold.run(task) for task in fold.tasks(job, checkpoint)]
        if not pieces:
            break
        checkpoint = fold.merge(job, checkpoint, pieces)
    return of_posterior(fold.summarise(job, checkpoint, 0.0, 0.0))


def _bind(name: str) -> Callable[[], dict[str, Any]]:
    return lambda: _request(name)


REQUESTS: dict[str, Callable[[], dict[str, Any]]] = {name: _bind(name) for name in _CASES}
