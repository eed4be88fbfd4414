"""Good bodies of streams and of UM-Bridge, to be spoiled, and what their answers have to be."""

import json
import math
from typing import Any

import httpx

from tests.service.conftest import SENSOR

__all__ = ["LINE", "LINES", "MODELS", "STREAM", "STREAMS", "check_lines", "check_model"]

Body = dict[str, Any]

_NORMAL = {"prior": "normal", "mean": 0.0, "sd": 0.01}
_OBJECT = {"c0": 0.08, "c1": 0.01, "c2": 0.1}
_WALL = {"strength": 0.02, "distance_m": 3.0, "shadow": {"c0": 0.06, "c1": 0.01}}
_SINE_WAVE = {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1e-4, 1e-4]}}

STREAM: Body = {"sensor": SENSOR, "scene": {"object": _OBJECT, "crosstalk": [_NORMAL, 0.0]}}
STREAMS: tuple[Body, ...] = (
    STREAM | {"policy": "latest", "tracking": {"rate_sd": 0.3}},
    {"sensor": _SINE_WAVE, "scene": {"object": _OBJECT, "background": _WALL}, "policy": "all"},
    STREAM | {"calibrate": True, "seed": 3},
)
LINE: Body = {"time_s": 0.1, "w1": 0.0147, "w2": 0.441}
LINES: tuple[Body, ...] = (
    LINE | {"sequence": 2},
    LINE | {"object_present": True, "gain": 1.5, "note": {"any": [1]}},
    LINE | {"known_range_m": 0.5, "known_range_sd_m": 0.01, "dw1_dt": -0.03, "dw2_dt": None},
)
_CONFIG: Body = {
    "sensor": SENSOR,
    "scene": {"object": {"c0": 0.08, "c1": 0.01}, "crosstalk": [_NORMAL, 0.0]},
    "frames": {"w1": [0.0242, 0.012], "w2": [0.423, 0.1]},
    "nonfinite": -1e300,
}
_NAMED: tuple[Body, ...] = tuple(
    {"name": name, "config": _CONFIG} for name in ("log_posterior", "log_likelihood", "parameters")
)
MODELS: dict[str, tuple[Body, ...]] = {
    "ModelInfo": ({"name": "log_posterior"},),
    "InputSizes": _NAMED,
    "OutputSizes": _NAMED,
    "Evaluate": tuple(body | {"input": [[0.3, 0.01]]} for body in _NAMED),
    "Gradient": _NAMED,
}
"""Of every operation of UM-Bridge."""


def _finite(name: str) -> None:
    raise AssertionError(f"{name} was sent")


def check_lines(response: httpx.Response) -> None:
    """Hold answers to three lines: good, spoiled, good."""
    assert response.status_code == 200, response.text
    # what else Python takes for the end of a line may stand in a line
    lines = response.text.removesuffix("\n").split("\n")
    answers = [json.loads(line, parse_constant=_finite) for line in lines]
    assert len(answers) == 3
    assert answers[0]["status"] in {"unique", "ambiguous", "none", "saturated"}
    for answer in answers[1:]:
        if "error" in answer:
            assert answer["error"]["type"]
            assert answer["error"]["title"]
        else:
            assert (answer["range_m"] is not None) == (answer["status"] == "unique")


def check_model(response: httpx.Response) -> None:
    """Hold an answer to the protocol: what is asked for, or an error of the four that it knows."""
    # the word that a client may ask for in its config is minus infinity
    body = json.loads(response.text, parse_constant=lambda name: {"-Infinity": -math.inf}[name])
    if response.status_code == 200:
        assert body
        return
    assert response.status_code == 400, response.text
    kinds = {"InvalidInput", "InvalidOutput", "ModelNotFound", "UnsupportedFeature"}
    assert body["error"]["type"] in kinds
    assert body["error"]["message"]
