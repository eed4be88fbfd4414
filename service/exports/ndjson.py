"""Draws as NDJSON: one object a draw."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.exports.described import DescribedDraws
from service.exports.export import Export
from service.json_text import encode

__all__ = ["EXPORT", "to_ndjson"]


def _plain(values: NDArray[Any]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]


def _lines(described: DescribedDraws) -> Iterator[bytes]:
    draws = described.draws
    where = {int(step): k for k, step in enumerate(draws.thinned)}
    for ensemble, walker, step in np.ndindex(draws.log_density.shape):
        at = (ensemble, walker, step)
        line: dict[str, Any] = {
            "ensemble": ensemble,
            "walker": walker,
            "step": int(draws.step[step]),
            "log_density": float(draws.log_density[at]),
            "accepted": bool(draws.accepted[at]),
            "mode": int(draws.mode[at]),
            "parameters": dict(zip(draws.names, draws.parameters[at].tolist(), strict=True)),
        }
        if step in where:
            at = (ensemble, walker, where[step])
            line["range_m"] = _plain(draws.range_m[at])
            line["log_likelihood"] = _plain(draws.log_likelihood[at])
            line["readings"] = {
                column: _plain(draws.readings[at][:, k])
                for k, column in enumerate(described.columns)
            }
        yield encode(line)


def to_ndjson(described: DescribedDraws) -> bytes:
    """Write draws as NDJSON.

    Returns
    -------
    bytes
        A line a draw, ensemble by ensemble, walker by walker, step by step. Draws with ranges
        have ``range_m``, ``log_likelihood`` and replicated ``readings`` of all frames, null where
        a frame was saturated or holds no object; the others lack these members.
    """
    return b"".join(line + b"\n" for line in _lines(described))


EXPORT = Export("application/x-ndjson", ".ndjson", to_ndjson)
