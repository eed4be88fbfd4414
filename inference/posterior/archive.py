"""Jobs and checkpoints as bytes: numpy archives without pickle, for any store."""

import dataclasses
import hashlib
import io
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.representatives import Representatives
from inference.posterior.sampling.ensemble import Ensemble
from inference.posterior.sampling.flux_coordinate import FluxCoordinate
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.light_at_rest import LightAtRest
from inference.posterior.sampling.pool import Pool
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.proposal import Local, Mixture, Proposal
from inference.posterior.sampling.reparametrisation import Reparametrisation
from inference.posterior.sampling.rounds_so_far import LastDraws, RoundsSoFar, Wanted
from inference.posterior.sampling.scouts import Scouts
from inference.posterior.sampling.shape import Shape
from inference.posterior.sampling.start import Optimum
from inference.posterior.sampling.transport import TriangularMap
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.selection.consequence import Reported
from inference.posterior.selection.models import Candidate
from inference.posterior.selection.selection import Decision, Selection
from inference.posterior.stages.stage import (
    Outset,
    Selecting,
    Settled,
    Starting,
    Tempering,
    Walking,
    Weighted,
)
from simulator.frames import Frames

__all__ = ["FORMAT", "pack", "pack_addition", "pack_parts", "unpack", "unpack_parts"]

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


def pack_addition(
    meta: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], before: Mapping[str, NDArray[Any]]
) -> bytes | None:
    """Write what was appended to arrays that were written before.

    Parameters
    ----------
    meta, arrays : mapping
        As of `pack`.
    before : mapping of str to ndarray
        The arrays that were written before.

    Returns
    -------
    bytes or None
        An npz archive that `unpack` reads behind those of before; None where less than half of what
        was written is still of use: all is better written anew.
    """
    continued = [name for name, array in before.items() if _continues(arrays.get(name), array)]
    kept = sum(before[name].nbytes for name in continued)
    if 2 * kept < sum(array.nbytes for array in before.values()) or not kept:
        return None
    added = {name: a[len(before[name]) :] if name in continued else a for name, a in arrays.items()}
    return pack({"continued": continued, "meta": dict(meta)}, added)


def _continues(array: NDArray[Any] | None, before: NDArray[Any]) -> bool:
    """Tell whether an array begins with all of another one, to the last bit."""
    if array is None or array.ndim == 0 or not before.size:
        return False
    if array.dtype != before.dtype or array.shape[1:] != before.shape[1:]:
        return False
    return array[: len(before)].tobytes() == before.tobytes()


def unpack(*pieces: bytes) -> tuple[dict[str, Any], Arrays]:
    """Read what `pack` wrote, and what `pack_addition` wrote after it, in this order."""
    meta: dict[str, Any] = {}
    parts: dict[str, list[NDArray[Any]]] = {}
    for data in pieces:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        meta = json.loads(arrays.pop("meta").tobytes())
        continued = meta.get("continued", ())
        parts = {
            name: [*parts[name], array] if name in continued else [array]
            for name, array in arrays.items()
        }
        meta = meta["meta"] if "continued" in meta else meta
    return meta, {name: _joined(found) for name, found in parts.items()}


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Join what was appended; the order in memory stays, which decides last bits of sums."""
    first, *others = parts
    added = [part for part in others if part.size]
    if not added:
        return first
    joined = np.concatenate([first, *added])
    return np.asfortranarray(joined) if first.flags.fnc else joined


# frozen dataclasses of arrays, numbers and one another; anything else is a mistake
_PARTS = {
    part.__name__: part
    for part in (
        Candidate,
        Decision,
        Ensemble,
        FluxCoordinate,
        LightAtRest,
        Frames,
        LastDraws,
        Local,
        Mixture,
        Optimum,
        Outset,
        Pool,
        Population,
        Proposal,
        Reported,
        Selecting,
        Selection,
        Reparametrisation,
        Representatives,
        RoundsSoFar,
        Scouts,
        Settled,
        Shape,
        Starting,
        Tempering,
        TriangularMap,
        Verdict,
        Walking,
        Wanted,
        Weighted,
        WeightedDraws,
    )
}


def _format() -> str:
    named = {name: [f.name for f in dataclasses.fields(part)] for name, part in _PARTS.items()}
    return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()[:12]


FORMAT = _format()
"""Names the parts and their fields: what was written under another one cannot be read."""


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
