"""Estimates in files: a row or a line a frame and technique, or the document as it is sent."""

import csv
import io
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from service.errors import MalformedError

__all__ = ["check_estimate_suffix", "estimates_as"]

_COLUMNS = (
    "technique", "frame", "status", "range_m", "sd_m", "roots_m", "roots_sd_m", "near_fold",
    "sd_noise_m", "sd_scene_m", "sd_model_m",
    "power_law", "power_law_sd", "zeta", "zeta_sd", "range_bounds_m", "reason",
)  # fmt: skip


def check_estimate_suffix(path: Path) -> None:
    """Refuse a file whose name does not say in which form estimates go there.

    Raises
    ------
    MalformedError
        Naming the forms.
    """
    if path.suffix.lower() not in _WRITERS:
        known = ", ".join(_WRITERS)
        raise MalformedError(f"{path}: estimates are written to {known}, not '{path.suffix}'")


def estimates_as(suffix: str, document: Mapping[str, Any]) -> str:
    """Write estimates in the form of a file.

    Parameters
    ----------
    suffix : str
        ``.csv``: a row a frame of each technique, lists separated by spaces, empty where there is
        nothing; ``.ndjson``: a line a frame of each technique; ``.json``: the whole document.
    document : mapping
        As ``POST /v1/estimates`` answers.
    """
    return _WRITERS[suffix.lower()](document)


def _frames(document: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for result in document["results"]:
        for index, frame in enumerate(result["frames"]):
            yield {"technique": result["technique"], "frame": index} | frame


def _cell(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(map(_cell, value))
    if isinstance(value, str):
        return value
    return "" if value is None else json.dumps(value)


def _flat(frame: dict[str, Any]) -> dict[str, Any]:
    """Give the parts of the standard deviation names of their own."""
    parts = frame.get("sd_parts_m") or {}
    return frame | {f"sd_{name}_m": value for name, value in parts.items()}


def _csv(document: Mapping[str, Any]) -> str:
    rows = [
        [_cell(frame.get(name)) for name in _COLUMNS] for frame in map(_flat, _frames(document))
    ]
    # of columns that only some techniques have, those that are used
    used = [k for k, name in enumerate(_COLUMNS) if name not in _SOME or any(r[k] for r in rows)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([_COLUMNS[k] for k in used])
    writer.writerows([row[k] for k in used] for row in rows)
    return text.getvalue()


def _ndjson(document: Mapping[str, Any]) -> str:
    return "".join(json.dumps(frame, allow_nan=False) + "\n" for frame in _frames(document))


def _json(document: Mapping[str, Any]) -> str:
    return json.dumps(document, allow_nan=False) + "\n"


_SOME = (
    "sd_noise_m", "sd_scene_m", "sd_model_m",
    "power_law", "power_law_sd", "zeta", "zeta_sd", "range_bounds_m",
)  # fmt: skip
_WRITERS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    ".csv": _csv,
    ".ndjson": _ndjson,
    ".json": _json,
}
