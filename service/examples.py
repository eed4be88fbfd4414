"""Examples of what clients send, for the OpenAPI document; tests send them."""

from collections.abc import Mapping
from typing import Any

import pydantic

from service.requests import (
    EstimateRequest,
    IdentifiabilityRequest,
    PosteriorRequest,
    SimulationRequest,
    StreamRequest,
)

__all__ = ["EXAMPLES"]

_NOISE = {"read": [1e-4, 1e-4]}
_PULSE = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": _NOISE}
_SINE_WAVE = {"kind": "sine_wave", "frequency_hz": 5e6, "noise": _NOISE}
_OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.1}
_CROSSTALK = [0.0, {"prior": "normal", "mean": 0.0, "sd": 0.1}]


def _example(summary: str, value: Mapping[str, Any]) -> dict[str, Any]:
    return {"summary": summary, "value": value}


EXAMPLES: Mapping[type[pydantic.BaseModel], Mapping[str, Mapping[str, Any]]] = {
    EstimateRequest: {
        "pulse": _example(
            "Two frames of a pulsed sensor",
            {
                "sensor": _PULSE,
                "scene": {"object": _OBJECT},
                "frames": {"w1": [0.01, 0.02], "w2": [1.5, 1.7]},
            },
        ),
        "background": _example(
            "A sine wave before a known background, by two techniques",
            {
                "sensor": _SINE_WAVE,
                "scene": {
                    "object": _OBJECT,
                    "background": {"strength": 0.8, "distance_m": 3.0, "shadow": "object"},
                },
                "frames": {"i": [0.1, 0.2], "q": [0.5, 0.4]},
                "techniques": ["background_cancelling", "background_intensity"],
            },
        ),
    },
    PosteriorRequest: {
        "crosstalk": _example(
            "Crosstalk and the object's reflectance are unknown",
            {
                "sensor": _PULSE,
                "scene": {
                    "object": {"c0": 0.0769, "c1": -0.123},
                    "crosstalk": _CROSSTALK,
                },
                "frames": {"w1": [0.0147, 0.0119, 0.0099], "w2": [0.441, 0.297, 0.212]},
                "sampler": {"max_seconds": 10.0, "seed": 1},
            },
        ),
    },
    StreamRequest: {
        "robot": _example(
            "A robot that prefers the latest to all",
            {
                "sensor": _PULSE,
                "scene": {"object": _OBJECT},
                "tracking": {"rate_sd": 0.5},
                "policy": "latest",
            },
        ),
    },
    SimulationRequest: {
        "radial": _example(
            "An object on its way",
            {
                "sensor": _PULSE,
                "scene": {"object": _OBJECT},
                "trajectory": {
                    "kind": "radial",
                    "from_m": 0.2,
                    "to_m": 2.0,
                    "frames": 5,
                    "spacing": "log",
                },
                "seed": 1,
            },
        ),
    },
    IdentifiabilityRequest: {
        "crosstalk": _example(
            "What four frames would tell, the last one without the object",
            {
                "sensor": _PULSE,
                "scene": {"crosstalk": _CROSSTALK},
                "ranges_m": [0.3, 0.6, 1.2, 1.0],
                "object_present": [True, True, True, False],
                "at": {"object.c0": 0.08},
            },
        ),
    },
}
