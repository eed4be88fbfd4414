"""A clock that counts chunks: answers on a loaded machine are those on an idle one."""

from collections.abc import Callable
from typing import Any, TypeVar

__all__ = ["timed"]

T = TypeVar("T")


def timed(function: Callable[..., T], *arguments: Any) -> tuple[T, float]:
    """Let the start cost a second, and a chunk a second when it is merged."""
    return function(*arguments), float(function.__name__ in ("start", "merge"))
