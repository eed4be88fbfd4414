"""Estimates as JSON text: a dictionary a frame costs more than the estimate itself.

Frames of one kind (same status, reason, number of roots, near a fold or not) have the same JSON
but for their numbers: of each kind the texts of columns are laid between texts that do not change.
"""

import dataclasses
import math
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import orjson
from numpy.typing import NDArray

from inference.estimates import Estimates, LeftOut, SdParts, Status, TechniqueResult
from service.json_text import encode
from simulator.remembered import remembered

__all__ = ["AnswerShape", "encode_around", "encode_estimates", "encode_result"]

AnswerShape = Literal["rows", "columns"]

Array = NDArray[np.float64]
# text between numbers, and texts of numbers
_Piece = str | list[str]

# frames that are encoded in one go: their texts stay in the processor's cache, and between two goes
# other threads get the interpreter
_BLOCK = 8192
_OF_MOTION = ("power_law", "power_law_sd", "zeta", "zeta_sd")
_STATUS = tuple(status.name.lower() for status in Status)
_ALL = slice(None)


def encode_estimates(estimates: Estimates, shape: AnswerShape = "rows") -> bytes:
    """Return the body of ``POST /v1/estimates``.

    Parameters
    ----------
    estimates : Estimates
        Results for n frames each.
    shape : str
        ``rows``: ``frames`` is a list of objects; ``columns``: an object of lists.

    Returns
    -------
    bytes
        JSON as in docs/http.md, estimates; null where a number is not available.
    """
    before, after = encode_around(estimates)
    parts = [before]
    for number, result in enumerate(estimates.results):
        parts.append(b"," if number else b"")
        parts += encode_result(result, shape)
    parts.append(after)
    return b"".join(parts)


def encode_around(estimates: Estimates) -> tuple[bytes, bytes]:
    """Return what stands before and behind the results.

    Parameters
    ----------
    estimates : Estimates
        Of which the results are not looked at.
    """
    parts = [b'],"left_out":', _left_out(estimates.left_out)]
    parts += [b',"assumptions":', encode(estimates.assumptions)]
    if estimates.do_first is not None:
        parts += [b',"do_first":', encode(estimates.do_first)]
    parts.append(b"}")
    return b'{"chosen":' + encode(estimates.chosen) + b',"results":[', b"".join(parts)


@remembered
def _left_out(items: tuple[LeftOut, ...]) -> bytes:
    """JSON text; a plan that is remembered has one tuple."""
    return encode([{"technique": item.name, "reason": item.reason} for item in items])


def encode_result(result: TechniqueResult, shape: AnswerShape) -> Iterator[bytes]:
    """Yield JSON text of one technique's results, block by block.

    Parameters
    ----------
    result, shape
        As of `encode_estimates`.
    """
    yield b'{"technique":' + encode(result.technique) + b',"frames":'
    if shape == "columns":
        yield from _columns(result)
    elif len(result) == 1:
        yield b"[" + _dumps(_frame(result)) + b"]"
    else:
        yield b"["
        for start in range(0, len(result), _BLOCK):
            block = _rows(result, start, start + _BLOCK)
            yield (("," if start else "") + _frames(block)).encode()
        yield b"]"
    parameters = None if result.parameters is None else dict(result.parameters)
    rest: dict[str, Any] = {"parameters": parameters}
    if result.fit is not None:
        rest["fit"] = dict(result.fit)
    rest["runtime_s"] = result.runtime_s
    yield b"," + encode(rest)[1:]


def _dumps(value: Any) -> bytes:
    """JSON text of numbers, null for what is not finite."""
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)


def _columns(result: TechniqueResult) -> Iterator[bytes]:
    """Yield JSON text of all frames, column by column."""
    known = (result.status == Status.UNIQUE) & np.isfinite(result.roots_sd_m[:, 0])
    bounds = result.range_bounds_m
    columns: dict[str, Any] = {
        "status": list(map(_STATUS.__getitem__, result.status.tolist())),
        "range_m": result.range_m,
        "sd_m": result.sd_m,
        "roots_m": _ragged(result.roots_m, result.root_count),
        "roots_sd_m": _ragged(result.roots_sd_m, result.root_count),
        "near_fold": result.near_fold,
        "reason": [result.reasons[code] or None for code in result.reason.tolist()],
    }
    if (parts := result.sd_parts_m) is not None:
        named = zip(SdParts._fields, parts, strict=True)
        columns["sd_parts_m"] = {name: np.where(known, x[:, 0], np.nan) for name, x in named}
    if bounds is not None:
        columns["range_bounds_m"] = [
            pair if math.isfinite(sum(pair)) else None for pair in bounds.tolist()
        ]
    columns |= {name: x for name in _OF_MOTION if (x := getattr(result, name)) is not None}
    for number, (name, column) in enumerate(columns.items()):
        yield (f',"{name}":' if number else f'{{"{name}":').encode() + _dumps(column)
    yield b"}"


def _ragged(values: Array, count: NDArray[np.intp]) -> Any:
    """Leave the padding out: for every frame as many values as it has roots."""
    if values.shape[1] == 1:
        inside = count > 0
        if np.isfinite(values[inside, 0]).all():
            text = _dumps(np.where(inside, values[:, 0], np.nan))[1:-1]
            lists = text.replace(b",", b"],[").replace(b"null", b"")
            return orjson.Fragment(b"[[" + lists + b"]]" if text else b"[]")
    return [row[:n] for row, n in zip(values.tolist(), count.tolist(), strict=True)]


def _rows(result: TechniqueResult, start: int, stop: int) -> TechniqueResult:
    """Return the same result for some frames alone."""
    if start == 0 and stop >= len(result):
        return result
    arrays: dict[str, Any] = {
        field.name: value[start:stop]
        for field in dataclasses.fields(result)
        if isinstance(value := getattr(result, field.name), np.ndarray)
    }
    if result.sd_parts_m is not None:
        arrays["sd_parts_m"] = SdParts(*(part[start:stop] for part in result.sd_parts_m))
    return dataclasses.replace(result, **arrays)


def _kinds(result: TechniqueResult) -> Iterator[tuple[int, Any]]:
    """Yield, for each kind of frame, one of its frames and the index of all."""
    near = result.near_fold.astype(np.int64) * 2 + np.isfinite(result.roots_sd_m[:, 0])
    code = result.status.astype(np.int64)
    code = code * len(result.reasons) + result.reason
    code = (code * (result.roots_m.shape[1] + 1) + result.root_count) * 4 + near
    if result.range_bounds_m is not None:
        code = code * 2 + np.isfinite(result.range_bounds_m).all(axis=1)
    if (code == code[0]).all():
        yield 0, _ALL
        return
    order = np.argsort(code, kind="stable")
    borders = np.flatnonzero(np.diff(code[order])) + 1
    for index in np.split(order, borders):
        yield int(index[0]), index


def _frame(result: TechniqueResult) -> dict[str, Any]:
    """Return the one frame of a result."""
    count, status = int(result.root_count[0]), result.status.item()
    roots, sds = result.roots_m[0, :count].tolist(), result.roots_sd_m[0, :count].tolist()
    unique = status == Status.UNIQUE and count == 1
    frame: dict[str, Any] = {
        "status": _STATUS[status],
        "range_m": roots[0] if unique else None,
        "sd_m": sds[0] if unique else None,
        "roots_m": roots,
        "roots_sd_m": sds,
        "near_fold": result.near_fold.item(),
    }
    if reason := result.reasons[result.reason.item()]:
        frame["reason"] = reason
    parts = result.sd_parts_m
    if parts is not None and unique and math.isfinite(sds[0]):
        frame["sd_parts_m"] = dict(zip(SdParts._fields, (x[0, 0] for x in parts), strict=True))
    for name in _OF_MOTION:
        if (column := getattr(result, name)) is not None:
            frame[name] = column.item()
    if (bounds := result.range_bounds_m) is not None:
        frame["range_bounds_m"] = bounds[0].tolist() if np.isfinite(bounds[0]).all() else None
    return frame


def _frames(result: TechniqueResult) -> str:
    """JSON text of every frame, separated by commas."""
    n = len(result)
    frames = np.empty(n, dtype=object)
    for first, index in _kinds(result):
        pieces = _pieces(result, first, index)
        if index is _ALL:
            return _laid([*pieces, "},"], n)[:-1]
        # no JSON text has a line break of its own
        frames[index] = _laid([*pieces, "}\n"], index.size).split("\n")[:-1]
    return ",".join(frames.tolist())


def _laid(pieces: list[_Piece], n: int) -> str:
    """Lay the texts of n frames between those that they have in common."""
    merged: list[_Piece] = []
    for piece in pieces:
        last = merged[-1] if merged else None
        if isinstance(piece, str) and isinstance(last, str):
            merged[-1] = last + piece
        else:
            merged.append(piece)
    laid = [""] * (n * len(merged))
    for number, piece in enumerate(merged):
        laid[number :: len(merged)] = [piece] * n if isinstance(piece, str) else piece
    return "".join(laid)


def _pieces(result: TechniqueResult, first: int, index: Any) -> list[_Piece]:
    """Texts of the frames of one kind, of which ``first`` is one, but for the last brace."""

    def texts(column: Array) -> list[str]:
        return _dumps(np.ascontiguousarray(column[index]))[1:-1].decode("ascii").split(",")

    count, status = int(result.root_count[first]), Status(int(result.status[first]))
    unique = status is Status.UNIQUE and count == 1
    roots = [texts(result.roots_m[:, k]) for k in range(count)]
    sds = [texts(result.roots_sd_m[:, k]) for k in range(count)]
    pieces: list[_Piece] = [f'{{"status":"{_STATUS[status]}"']
    pieces += [',"range_m":', roots[0] if unique else "null"]
    pieces += [',"sd_m":', sds[0] if unique else "null"]
    pieces += [',"roots_m":[', *_listed(roots), '],"roots_sd_m":[', *_listed(sds)]
    pieces.append('],"near_fold":true' if result.near_fold[first] else '],"near_fold":false')
    if reason := result.reasons[int(result.reason[first])]:
        pieces.append(',"reason":' + encode(reason).decode())
    parts = result.sd_parts_m
    if parts is not None and unique and np.isfinite(result.roots_sd_m[first, 0]):
        for number, (name, part) in enumerate(zip(SdParts._fields, parts, strict=True)):
            pieces.append(f',"{name}":' if number else f',"sd_parts_m":{{"{name}":')
            pieces.append(texts(part[:, 0]))
        pieces.append("}")
    for name in _OF_MOTION:
        if (column := getattr(result, name)) is not None:
            pieces += [f',"{name}":', texts(column)]
    if (bounds := result.range_bounds_m) is not None:
        if np.isfinite(bounds[first]).all():
            low, high = texts(bounds[:, 0]), texts(bounds[:, 1])
            pieces += [',"range_bounds_m":[', *_listed([low, high]), "]"]
        else:
            pieces.append(',"range_bounds_m":null')
    return pieces


def _listed(columns: list[list[str]]) -> Iterator[_Piece]:
    for number, column in enumerate(columns):
        if number:
            yield ","
        yield column
