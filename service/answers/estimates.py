"""Estimates as JSON text, columnwise: a dictionary a frame costs more than the estimate itself.

Frames of one kind (same status, reason, number of roots, near a fold or not) have the same JSON
but for their numbers, so each kind is one template that is filled from columns of number texts.
"""

import dataclasses
import json
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np
import pydantic
import pydantic_core
from numpy.typing import NDArray

from inference.estimates import Estimates, SdParts, Status, TechniqueResult

__all__ = [
    "EstimatesResponse",
    "FrameEstimate",
    "LeftOutTechnique",
    "TechniqueEstimates",
    "encode_estimates",
]

Array = NDArray[np.float64]


class ErrorBudget(pydantic.BaseModel):
    """Parts of a standard deviation; the sum of their squares is its square."""

    noise: float | None
    scene: float | None
    model: float | None


class FrameEstimate(pydantic.BaseModel):
    """One technique's answer for one frame; standard deviations are the whole."""

    status: Literal["unique", "ambiguous", "none", "saturated"]
    range_m: float | None
    sd_m: float | None
    roots_m: list[float]
    roots_sd_m: list[float | None]
    sd_parts_m: ErrorBudget | None = None
    near_fold: bool
    reason: str | None = None
    range_bounds_m: tuple[float, float] | None = None
    power_law: float | None = None
    power_law_sd: float | None = None
    zeta: float | None = None
    zeta_sd: float | None = None


class FittedParameter(pydantic.BaseModel):
    """An unknown that a technique of many frames found; sd is the whole."""

    value: float | None
    sd: float | None
    status: Literal["identified", "weak", "not_identified"]
    sd_parts: ErrorBudget | None = None
    reason: str | None = None


class FittedOptimum(pydantic.BaseModel):
    """One of the distinct optima of a fit; the deviance is -2 log likelihood."""

    excess_deviance: float
    parameters: dict[str, float | None]


class TechniqueFit(pydantic.BaseModel):
    """How well a technique of many frames explains them."""

    chi_square: float
    deviance: float | None = None
    degrees_of_freedom: int
    p_value: float
    misfit: bool
    rank: int
    widening: float | None = None
    optima: list[FittedOptimum]


class TechniqueEstimates(pydantic.BaseModel):
    """One technique's answer."""

    technique: str
    frames: list[FrameEstimate]
    parameters: dict[str, FittedParameter] | None
    fit: TechniqueFit | None = None
    runtime_s: float


class LeftOutTechnique(pydantic.BaseModel):
    """A technique that was not used, and why."""

    technique: str
    reason: str


class EstimatesResponse(pydantic.BaseModel):
    """Answer of ``POST /v1/estimates``."""

    chosen: str | None
    results: list[TechniqueEstimates]
    left_out: list[LeftOutTechnique]
    assumptions: list[str]


# frames that are encoded in one go: their texts stay in the processor's cache, and between two goes
# other threads get the interpreter
_BLOCK = 8192
_OF_MOTION = ("power_law", "power_law_sd", "zeta", "zeta_sd")


def encode_estimates(estimates: Estimates) -> bytes:
    """Return the body of ``POST /v1/estimates``.

    Parameters
    ----------
    estimates : Estimates
        Results for n frames each.

    Returns
    -------
    bytes
        JSON as in docs/http.md, estimates; null where a number is not available.
    """
    left_out = [{"technique": item.name, "reason": item.reason} for item in estimates.left_out]
    parts = [f'{{"chosen": {json.dumps(estimates.chosen)}, "results": [']
    for number, result in enumerate(estimates.results):
        parts.append(", " if number else "")
        parts += _technique(result)
    parts.append(f'], "left_out": {json.dumps(left_out)}')
    parts.append(f', "assumptions": {json.dumps(estimates.assumptions)}}}')
    # every part is ASCII: json.dumps escapes, numbers are
    return b"".join(part.encode("ascii") for part in parts)


def _technique(result: TechniqueResult) -> Iterator[str]:
    """Yield JSON text of one technique's results, block by block."""
    yield f'{{"technique": {json.dumps(result.technique)}, "frames": ['
    for start in range(0, len(result), _BLOCK):
        yield (", " if start else "") + ", ".join(_frames(_rows(result, start, start + _BLOCK)))
    parameters = None if result.parameters is None else dict(result.parameters)
    rest: dict[str, Any] = {"parameters": parameters}
    if result.fit is not None:
        rest["fit"] = dict(result.fit)
    rest["runtime_s"] = result.runtime_s
    yield "], " + json.dumps(rest, allow_nan=False)[1:]


def _rows(result: TechniqueResult, start: int, stop: int) -> TechniqueResult:
    """Return the same result for some frames alone."""
    arrays: dict[str, Any] = {
        field.name: value[start:stop]
        for field in dataclasses.fields(result)
        if isinstance(value := getattr(result, field.name), np.ndarray)
    }
    if result.sd_parts_m is not None:
        arrays["sd_parts_m"] = SdParts(*(part[start:stop] for part in result.sd_parts_m))
    return dataclasses.replace(result, **arrays)


def _texts(column: Array) -> list[str]:
    """JSON texts of numbers, "null" for what is not finite."""
    if column.size == 0:
        return []
    text: str = pydantic_core.to_json(column.tolist(), inf_nan_mode="null").decode("ascii")
    return text[1:-1].split(",")


def _kinds(result: TechniqueResult) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Yield, for each kind of frame, one of its frames and the indices of all."""
    near = result.near_fold.astype(np.int64) * 2 + np.isfinite(result.roots_sd_m[:, 0])
    code = result.status.astype(np.int64)
    code = code * len(result.reasons) + result.reason
    code = (code * (result.roots_m.shape[1] + 1) + result.root_count) * 4 + near
    if result.range_bounds_m is not None:
        code = code * 2 + np.isfinite(result.range_bounds_m).all(axis=1)
    order = np.argsort(code, kind="stable")
    borders = np.flatnonzero(np.diff(code[order])) + 1
    for index in np.split(order, borders):
        yield int(index[0]), index


def _frames(result: TechniqueResult) -> Sequence[str]:
    """JSON text of every frame."""
    n = result.status.size
    frames = np.empty(n, dtype=object)
    if n == 0:
        return []
    named = ((name, getattr(result, name)) for name in _OF_MOTION)
    extra: list[tuple[str, Array]] = [(name, x) for name, x in named if x is not None]
    for first, index in _kinds(result):
        count = int(result.root_count[first])
        columns = [result.roots_m[index, k] for k in range(count)]
        columns += [result.roots_sd_m[index, k] for k in range(count)]
        if _has_parts(result, first):
            assert result.sd_parts_m is not None  # noqa: S101  # what `_has_parts` says
            columns += [part[index, 0] for part in result.sd_parts_m]
        columns += [values[index] for _, values in extra]
        if result.range_bounds_m is not None and np.isfinite(result.range_bounds_m[first]).all():
            columns += [result.range_bounds_m[index, k] for k in (0, 1)]
        template = _template(result, first, count, [name for name, _ in extra])
        texts = [_texts(np.asarray(column, dtype=float)) for column in columns]
        if texts:
            frames[index] = list(map(template.format, *texts))
        else:
            frames[index] = template.format()
    return frames.tolist()


def _has_parts(result: TechniqueResult, frame: int) -> bool:
    """Whether a frame has one standard deviation whose parts are known."""
    unique = result.status[frame] == Status.UNIQUE and result.root_count[frame] == 1
    known = bool(unique and np.isfinite(result.roots_sd_m[frame, 0]))
    return known and result.sd_parts_m is not None


def _template(result: TechniqueResult, first: int, count: int, extra: Sequence[str]) -> str:
    """Format string of one kind of frame; columns are numbered as in `_frames`."""
    status = Status(int(result.status[first]))
    unique = status is Status.UNIQUE and count == 1
    members = {
        "status": f'"{status.name.lower()}"',
        "range_m": "{0}" if unique else "null",
        "sd_m": f"{{{count}}}" if unique else "null",
        "roots_m": "[" + ", ".join(f"{{{k}}}" for k in range(count)) + "]",
        "roots_sd_m": "[" + ", ".join(f"{{{count + k}}}" for k in range(count)) + "]",
        "near_fold": "true" if result.near_fold[first] else "false",
    }
    reason = result.reasons[int(result.reason[first])]
    if reason:
        members["reason"] = json.dumps(reason).replace("{", "{{").replace("}", "}}")
    position = 2 * count
    if _has_parts(result, first):
        parts = (f'"{name}": {{{position + i}}}' for i, name in enumerate(SdParts._fields))
        members["sd_parts_m"] = "{{" + ", ".join(parts) + "}}"
        position += len(SdParts._fields)
    for name in extra:
        members[name] = f"{{{position}}}"
        position += 1
    if result.range_bounds_m is not None:
        known = np.isfinite(result.range_bounds_m[first]).all()
        members["range_bounds_m"] = f"[{{{position}}}, {{{position + 1}}}]" if known else "null"
    body = ", ".join(f'"{name}": {value}' for name, value in members.items())
    return "{{" + body + "}}"
