"""JSON out: UTF-8, and never a number that is not finite."""

import json
import math
from typing import Any

import orjson

__all__ = ["encode"]


def encode(value: Any) -> bytes:
    """Return JSON text.

    Parameters
    ----------
    value : Any
        Dictionaries by text, lists, tuples, dataclasses, arrays, texts, numbers, booleans, None.

    Returns
    -------
    bytes
        UTF-8, without white space.

    Raises
    ------
    ValueError
        For a number that is not finite, outside of arrays, where it is null: what may be missing
        says so by None.
    """
    try:
        text = orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)
    except orjson.JSONEncodeError:  # integers of more than 64 bits, lone surrogates
        return json.dumps(value, allow_nan=False).encode("ascii")
    if b"null" in text:  # which is also how a number that is not finite is written
        _check(value)
    return text


def _check(value: Any) -> None:
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{value} is not JSON compliant")
    elif isinstance(value, dict):
        for member in value.values():
            _check(member)
    elif isinstance(value, list | tuple):
        for entry in value:
            _check(entry)
