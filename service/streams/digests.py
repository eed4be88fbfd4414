"""What lines say, as 64 bits each: by these a line that comes again is told from another one.

The digest of a line is the sum of those of its members, so that their order does not matter, and
`1` is `1.0`. One member that differs always changes it, as the mixing is one to one; two or more
leave it by chance alone, once in 2^64.
"""

import functools
import hashlib
import json
import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Digests", "digests_of", "split", "with_digests"]

Digests = NDArray[np.uint64]

_MARK = b"\2"  # neither JSON nor `service.streams.said.MARKS` begin with it
_HEAD = struct.Struct("<cI")
_NUMBERS = frozenset({int, float})


def digests_of(
    names: Sequence[str], values_of: Callable[[str], Sequence[Any]], count: int
) -> Digests:
    """Return the digests of lines with the same members.

    Parameters
    ----------
    names : sequence of str
        Of the members that count.
    values_of : callable
        Returns the values of a member, one a line.
    count : int
        How many lines there are.

    Returns
    -------
    ndarray of uint64, shape (count,)
    """
    if not names:
        return np.zeros(count, dtype=np.uint64)
    words = np.array([_words(values_of(name)) for name in names])
    words += np.array([_of_text(name) for name in names], dtype=np.uint64)[:, None]
    digests: Digests = _mixed(words).sum(axis=0, dtype=np.uint64)
    return digests


def _mixed(words: Digests) -> Digests:
    """Mix the bits of words, one to one (the finaliser of splitmix64, Steele et al. 2014)."""
    words ^= words >> np.uint64(30)
    words *= np.uint64(0xBF58476D1CE4E5B9)
    words ^= words >> np.uint64(27)
    words *= np.uint64(0x94D049BB133111EB)
    words ^= words >> np.uint64(31)
    return words


def _words(values: Sequence[Any]) -> Digests:
    """Return 64 bits for each value."""
    if set(map(type, values)) <= _NUMBERS:
        # plus zero: -0.0 is 0
        return (np.array(values, dtype=np.float64) + 0.0).view(np.uint64)
    return np.array([_word(value) for value in values], dtype=np.uint64)


def _word(value: Any) -> int:
    number = _alike(value)
    if type(number) is float:
        return int(np.float64(number + 0.0).view(np.uint64))
    return _of_text(json.dumps(number, sort_keys=True))


@functools.lru_cache(maxsize=256)
def _of_text(text: str) -> int:
    data = text.encode("utf-8", "surrogatepass")
    return int.from_bytes(hashlib.blake2b(data, digest_size=8).digest(), "big")


def _alike(value: Any) -> Any:
    """Return a value with floats for the integers in it, where there are such."""
    if type(value) is int:
        return float(value)
    if isinstance(value, dict):
        return {name: _alike(member) for name, member in value.items()}
    return [_alike(entry) for entry in value] if isinstance(value, list) else value


def with_digests(kept: bytes, digests: Sequence[int] | Digests) -> bytes:
    """Return what a store keeps of answers, with the digests of the lines that they are for."""
    if not kept:
        return kept
    words = np.array(digests, dtype="<u8")
    return b"".join([_HEAD.pack(_MARK, words.size), words.tobytes(), kept])


def split(kept: bytes) -> tuple[bytes, list[int] | None]:
    """Return what `with_digests` was given; without digests where it was kept before there were."""
    if not kept.startswith(_MARK):
        return kept, None
    _, count = _HEAD.unpack_from(kept)
    words = np.frombuffer(kept, dtype="<u8", count=count, offset=_HEAD.size)
    return kept[_HEAD.size + words.nbytes :], words.tolist()
