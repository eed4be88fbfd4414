"""Jobs and checkpoints as bytes: numpy archives without pickle, for any store."""

import dataclasses
import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.posterior.sampling.ensemble import Ensemble
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.proposal import Mixture, Proposal
from inference.posterior.sampling.reparametrisation import Reparametrisation
from inference.posterior.sampling.transport import TriangularMap
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.selection.models import Candidate
from inference.posterior.selection.selection import Decision, Selection
from inference.posterior.stages.stage import (
    Selecting,
    Settled,
    Starting,
    Tempering,
    Walking,
    Weighted,
)
from simulator.frames import Frames

__all__ = ["pack", "pack_parts", "unpack", "unpack_parts"]

Arrays = dict[str, NDArray[Any]]


def pack(meta: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Write plain JSON data and named arrays.

    Parameters
    ----------
    meta : mapping
        JSON data; floats survive exactly.
    arrays : mapping of str to ndarray
        Any shape, no objects.

    Returns
    -------
    bytes
        An npz archive.
    """
    buffer = io.BytesIO()
    text = np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8)
    np.savez(buffer, allow_pickle=False, meta=text, **arrays)
    return buffer.getvalue()


def unpack(data: bytes) -> tuple[dict[str, Any], Arrays]:
    """Read what `pack` wrote."""
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    meta: dict[str, Any] = json.loads(arrays.pop("meta").tobytes())
    return meta, arrays


# frozen dataclasses of arrays, numbers and one another; anything else is a mistake
_PARTS = {
    part.__name__: part
    for part in (
        Candidate,
        Decision,
        Ensemble,
        Frames,
        Settled,
        Mixture,
        Population,
        Proposal,
        Selecting,
        Selection,
        Reparametrisation,
        Starting,
        Tempering,
        TriangularMap,
        Verdict,
        Walking,
        Weighted,
        WeightedDraws,
    )
}


def pack_parts(value: Any, path: str, arrays: Arrays) -> Any:
    """Describe a value in JSON, its arrays put aside under their path."""
    if isinstance(value, np.ndarray):
        arrays[path] = value
        return {"array": path}
    if dataclasses.is_dataclass(value) and type(value).__name__ in _PARTS:
        fields = {
            field.name: pack_parts(getattr(value, field.name), f"{path}.{field.name}", arrays)
            for field in dataclasses.fields(value)
        }
        return {"part": type(value).__name__, "fields": fields}
    if isinstance(value, tuple):
        return {"tuple": [pack_parts(v, f"{path}.{i}", arrays) for i, v in enumerate(value)]}
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise TypeError(f"{path}: cannot archive {type(value).__name__}")


def unpack_parts(description: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Rebuild what `pack_parts` described."""
    if not isinstance(description, dict):
        return description
    if "array" in description:
        return arrays[description["array"]]
    if "tuple" in description:
        return tuple(unpack_parts(item, arrays) for item in description["tuple"])
    fields = {name: unpack_parts(item, arrays) for name, item in description["fields"].items()}
    return _PARTS[description["part"]](**fields)
