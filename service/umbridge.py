"""Densities of posteriors as models of UM-Bridge 1.0, by which clients of many languages ask.

The protocol has its own answers and its own errors (https://um-bridge-benchmarks.readthedocs.io).
What is asked for stands in ``config``: sensor, scene and frames as of ``POST /v1/posteriors``.
"""

import marshal
import math
from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.job import prepare
from inference.posterior.settings import SamplerSettings
from service.json_text import encode
from service.known_systems import read_system
from service.strict_json import check_bulk, decode
from service.system_description import SystemDescription
from simulator.errors import HybridTofError, InvalidInputError
from simulator.frames import FrameColumns, frames_from_columns

__all__ = ["INFO", "OPERATIONS", "UNSUPPORTED", "answer", "refusal"]

Array = NDArray[np.float64]
Answer = tuple[int, bytes]

_BAD = 400
# a client asks about one config again and again
_KEPT = 4
_LARGEST = 2**20


class DensityConfig(SystemDescription):
    """What a density is of.

    Attributes
    ----------
    nonfinite : float or "-Infinity", optional
        What stands for a log density of minus infinity, which JSON cannot say: a number, or the
        word that Python and C++ read. Left out, it is an error.
    """

    frames: FrameColumns
    nonfinite: float | Literal["-Infinity"] | None = None


def _posterior(density: CollapsedDensity, z: Array) -> Array:
    return density(z)


def _likelihood(density: CollapsedDensity, natural: Array) -> Array:
    with np.errstate(all="ignore"):  # beyond its prior a value has no coordinates
        z = density.parameters.standard(natural)
    inside = np.isfinite(z).all(axis=1)
    out = np.full(len(z), -np.inf)
    out[inside] = density.log_likelihood(z[inside])
    return np.where(np.isnan(out), -np.inf, out)


def _natural(density: CollapsedDensity, z: Array) -> Array:
    found: Array = density.parameters.natural(z)[0]
    return found


_MODELS: Mapping[str, Callable[[CollapsedDensity, Array], Array]] = {
    "log_posterior": _posterior,
    "log_likelihood": _likelihood,
    "parameters": _natural,
}
INFO = encode({"protocolVersion": 1.0, "models": list(_MODELS)})
"""What ``GET /Info`` says."""

UNSUPPORTED = ("Gradient", "ApplyJacobian", "ApplyHessian")
"""What UM-Bridge knows beside, and these models have not."""


class _RefusedError(Exception):
    """An error of the protocol: its type and its message."""


def refusal(kind: str, message: str) -> Answer:
    """Return an error as UM-Bridge has it.

    Parameters
    ----------
    kind : str
        InvalidInput, InvalidOutput, ModelNotFound or UnsupportedFeature.
    message : str
        For a person.

    Returns
    -------
    tuple
        Status and body.
    """
    return _BAD, encode({"error": {"type": kind, "message": message}})


def answer(operation: str, raw: bytes) -> Answer:
    """Answer a request.

    Parameters
    ----------
    operation : str
        One of `OPERATIONS`.
    raw : bytes
        Its body.

    Returns
    -------
    tuple
        Status and body.
    """
    try:
        return 200, _ANSWERS[operation](_body(operation, raw))
    except _RefusedError as error:
        return refusal(*error.args)
    except InvalidInputError as error:
        told = "; ".join(f"{problem.pointer}: {problem.message}" for problem in error.problems)
        return refusal("InvalidInput", told)
    except HybridTofError as error:
        return refusal("InvalidInput", str(error))


def _body(operation: str, raw: bytes) -> dict[str, Any]:
    """Return the members of a request for a model that there is."""
    data = decode(raw)
    if not isinstance(data, dict):
        raise InvalidInputError.at("", "must be a JSON object")
    if not isinstance(name := data.get("name"), str) or name not in _MODELS:
        raise _RefusedError("ModelNotFound", f"name must be one of {', '.join(_MODELS)}")
    check_bulk(data)
    known = {"ModelInfo": set[str](), "Evaluate": {"config", "input"}}.get(operation, {"config"})
    if odd := data.keys() - known - {"name"}:
        raise InvalidInputError.at(f"/{min(odd)}", f"is no member of {operation}")
    return data


def _model_info(_: dict[str, Any]) -> bytes:
    return encode({"support": {"Evaluate": True} | dict.fromkeys(UNSUPPORTED, False)})


_densities: dict[bytes, tuple[CollapsedDensity, DensityConfig]] = {}


def _density(body: dict[str, Any]) -> tuple[CollapsedDensity, DensityConfig]:
    """Return what a config states."""
    given = body.get("config", {})
    if not isinstance(given, dict):
        raise InvalidInputError.at("/config", "must be a JSON object")
    key = marshal.dumps(given, 2)
    if (kept := _densities.get(key)) is not None:
        return kept
    try:
        config = read_system(DensityConfig, given)
        try:
            frames = frames_from_columns(config.sensor, config.frames)
        except InvalidInputError as error:
            raise error.below("/frames") from None
        job = prepare(config.sensor, config.scene, frames, SamplerSettings(seed=0))
        found = job.density(), config
    except InvalidInputError as error:
        raise error.below("/config") from None
    if len(key) <= _LARGEST:
        while len(_densities) >= _KEPT:
            del _densities[next(iter(_densities))]
        _densities[key] = found
    return found


def _input_sizes(body: dict[str, Any]) -> bytes:
    return encode({"inputSizes": [len(_density(body)[0].parameters)]})


def _output_sizes(body: dict[str, Any]) -> bytes:
    many = len(_density(body)[0].parameters)
    return encode({"outputSizes": [many if body["name"] == "parameters" else 1]})


def _point(given: object, size: int) -> Array:
    """Return the one block of an input, shape (1, size)."""
    if not (isinstance(given, list) and len(given) == 1 and isinstance(given[0], list)):
        raise InvalidInputError.at("/input", "must be a list of one list of numbers")
    values = given[0]
    if len(values) != size:
        raise InvalidInputError.at("/input/0", f"must have {size} numbers, has {len(values)}")
    for index, value in enumerate(values):
        if type(value) not in (int, float) or not math.isfinite(value):
            raise InvalidInputError.at(f"/input/0/{index}", "must be a finite number")
    return np.array([values], dtype=np.float64)


def _evaluate(body: dict[str, Any]) -> bytes:
    density, config = _density(body)
    point = _point(body.get("input"), len(density.parameters))
    output = _MODELS[body["name"]](density, point).tolist()
    if all(map(math.isfinite, output)):
        return encode({"output": [output]})
    if body["name"] == "parameters":
        raise _RefusedError("InvalidOutput", "a value is not finite so far from its prior's centre")
    if config.nonfinite is None:
        message = "the log density is minus infinity: state config.nonfinite, which stands for it"
        raise _RefusedError("InvalidOutput", message)
    if isinstance(config.nonfinite, str):
        return b'{"output":[[-Infinity]]}'
    return encode({"output": [[config.nonfinite]]})


_ANSWERS: Mapping[str, Callable[[dict[str, Any]], bytes]] = {
    "ModelInfo": _model_info,
    "InputSizes": _input_sizes,
    "OutputSizes": _output_sizes,
    "Evaluate": _evaluate,
}
OPERATIONS = tuple(_ANSWERS)
"""What `answer` answers."""
