"""JSON in, strictly: nothing is dropped, coerced or followed into the depths silently.

What is good, which is nearly all, is read by orjson. What orjson refuses, and what may have a
member twice, is read again by the standard library, which can name the place.
"""

import json
import math
import re
from collections.abc import Iterator
from typing import Any

import orjson

from service.errors import MalformedError
from simulator.errors import InvalidInputError, Problem, escape
from simulator.known_ranges import MAY_BE_NULL

__all__ = ["MAX_DEPTH", "MAX_ENTRIES", "SHORT", "check_bulk", "decode"]

# no document of this project is nested deeper than about eight levels
MAX_DEPTH = 32
# a list or an object longer than this is a column of numbers or of booleans, or it is wrong
SHORT = 64
MAX_ENTRIES = 2_000_000
_NULLABLE = tuple(f"/{name}" for name in MAY_BE_NULL)

# a string that is never closed ends with the document: searching on from each of its quotes would
# take a time that grows with the square of its length
_TOKENS = re.compile(rb'"(?:[^"\\]|\\.)*+"?|[\[\]{}]', re.DOTALL)
# a longer text is no 64-bit integer: such a number is read as the float that it is close to
_MAX_DIGITS = 20


class _Repeated(dict[str, Any]):
    """An object in which ``name`` came more than once."""

    name: str


def _integer(digits: str) -> int | float:
    value = int(digits) if len(digits) <= _MAX_DIGITS else float(digits)
    return value if -(2**63) <= value < 2**64 else float(value)


def _real(digits: str) -> float:
    """Read a number as `float` does: in Python, so that other threads get their turns."""
    return float(digits)


def _members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) == len(pairs):
        return members
    repeated = _Repeated(members)
    seen: set[str] = set()
    for name, _ in pairs:
        if name in seen:
            repeated.name = name
        seen.add(name)
    return repeated


_decoder = json.JSONDecoder(object_pairs_hook=_members, parse_int=_integer, parse_float=_real)


def _too_deep(raw: bytes) -> bool:
    # counting bytes costs nothing and settles every ordinary document
    if raw.count(b"[") + raw.count(b"{") <= MAX_DEPTH:
        return False
    depth = 0
    for token in _TOKENS.finditer(raw):
        if token[0] in (b"[", b"{"):
            depth += 1
            if depth > MAX_DEPTH:
                return True
        elif token[0] in (b"]", b"}"):
            depth -= 1
    return False


def _count(value: Any) -> int:
    """Count the members of all objects but of those in columns."""
    count = 0
    if isinstance(value, dict):
        count, value = len(value), value.values()
    elif not isinstance(value, list) or len(value) > SHORT:
        return 0
    for inner in value:
        if isinstance(inner, dict | list):
            count += _count(inner)
    return count


def _walk(value: Any, pointer: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every container with its pointer, without entering columns."""
    if isinstance(value, dict):
        yield pointer, value
        for name, member in value.items():
            yield from _walk(member, f"{pointer}/{escape(name)}")
    elif isinstance(value, list):
        yield pointer, value
        if len(value) <= SHORT:
            for index, entry in enumerate(value):
                yield from _walk(entry, f"{pointer}/{index}")


def decode(raw: bytes) -> Any:
    """Read one JSON document.

    ``NaN`` and infinities are read, so that validation can name the field that holds them; no
    type of this project accepts them.

    Parameters
    ----------
    raw : bytes
        UTF-8.

    Returns
    -------
    Any
        dict, list, str, int, float, bool or None.

    Raises
    ------
    MalformedError
        Where it is not JSON, not UTF-8, or nested deeper than `MAX_DEPTH`.
    InvalidInputError
        Where a member's name is repeated in an object, or a string is not Unicode text: one of
        two values would be dropped, or could not be repeated to the client.
    """
    if not _too_deep(raw):
        try:
            value = orjson.loads(raw)
        except orjson.JSONDecodeError:
            pass
        else:
            # a member that is repeated has a colon, and so may texts have: then it is looked at
            if raw.count(b":") == _count(value):
                return value
    return _decode_slowly(raw)


def _decode_slowly(raw: bytes) -> Any:
    """Read what is good as `decode` does, and say of the rest what is wrong, and where."""
    if not raw.strip():
        raise MalformedError("the document is empty; it must be JSON")
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise MalformedError(f"the document is not UTF-8 at byte {error.start}") from None
    if _too_deep(raw):
        raise MalformedError(f"the document is nested deeper than {MAX_DEPTH} levels")
    try:
        value = _decoder.decode(text)
    except json.JSONDecodeError as error:
        message = f"not JSON: {error.msg} at line {error.lineno}, column {error.colno}"
        raise MalformedError(message) from None
    for pointer, container in _walk(value):
        if isinstance(container, _Repeated):
            where = f"{pointer}/{escape(container.name)}"
            raise InvalidInputError.at(where, "the member is repeated")
    if b"\\u" in raw:
        _check_text(value)
    return value


def _check_text(value: Any) -> None:
    """Refuse lone surrogates, which JSON can spell and UTF-8 cannot."""
    for pointer, container in _walk(value):
        entries = [*container, *container.values()] if isinstance(container, dict) else container
        for entry in entries:
            if isinstance(entry, str) and not entry.isascii():
                try:
                    entry.encode()
                except UnicodeEncodeError:
                    message = "holds text with a lone surrogate"
                    raise InvalidInputError.at(pointer, message) from None


def check_bulk(value: Any) -> None:
    """Check what is long before a validator reports on each of a million entries.

    Parameters
    ----------
    value : Any
        Decoded JSON.

    Raises
    ------
    InvalidInputError
        For a list of more than `SHORT` entries that is not all finite numbers (or null, in a column
        that may hold it) or all booleans (the first offending entry is named), for one of more than
        `MAX_ENTRIES`, for one of more than `SHORT` that are text, and for an object of more
        than `SHORT` members.
    """
    if _is_plain(value):
        return
    problems = []
    for pointer, container in _walk(value):
        if len(container) <= SHORT:
            continue
        if isinstance(container, dict):
            problems.append(Problem(pointer, f"has more than {SHORT} members"))
        elif len(container) > MAX_ENTRIES:
            problems.append(Problem(pointer, f"has more than {MAX_ENTRIES} entries"))
        elif all(isinstance(entry, str) for entry in container):  # names, not a column
            problems.append(Problem(pointer, f"has more than {SHORT} entries that are text"))
        elif (index := _first_odd(container, pointer.endswith(_NULLABLE))) is not None:
            wanted = "true or false" if isinstance(container[0], bool) else "a finite number"
            problems.append(Problem(f"{pointer}/{index}", f"must be {wanted}"))
        if len(problems) == SHORT:
            break
    if problems:
        raise InvalidInputError(*problems)


def _is_plain(value: Any) -> bool:
    """Tell at once of nearly every good document that it is good."""
    if isinstance(value, dict):
        return len(value) <= SHORT and all(map(_is_plain, value.values()))
    if isinstance(value, list):
        if len(value) <= SHORT:
            return all(map(_is_plain, value))
        return len(value) <= MAX_ENTRIES and _is_column(value)
    return True


def _is_column(column: list[Any]) -> bool:
    types = set(map(type, column))
    if types == {bool}:
        return True
    # numbers whose sum is finite are finite; of the few others each is looked at
    return types <= {int, float} and (math.isfinite(sum(column)) or all(map(math.isfinite, column)))


def _first_odd(column: list[Any], nullable: bool = False) -> int | None:
    """Index of the first entry that does not fit a column of numbers or of booleans."""
    if nullable:
        column = [0.0 if entry is None else entry for entry in column]
    if _is_column(column):
        return None
    boolean = isinstance(column[0], bool)
    for index, entry in enumerate(column):
        if boolean:
            fits = isinstance(entry, bool)
        else:
            fits = type(entry) in (int, float) and math.isfinite(entry)
        if not fits:
            return index
    return None
