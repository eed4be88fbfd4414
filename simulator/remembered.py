"""What was found out of the last scenes: who asks about one scene asks again and again."""

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

__all__ = ["remembered"]

P = ParamSpec("P")
R = TypeVar("R")

_MOST = 64


def remembered(function: Callable[P, R]) -> Callable[P, R]:
    """Let a pure function of frozen objects answer at once what it answered of the same objects.

    The same: objects are not compared but identical, since comparing scenes takes longer than most
    questions. A refusal is not kept.

    Parameters
    ----------
    function : callable
        Its positional arguments are frozen, or numbers; nobody changes what it returns.

    Returns
    -------
    callable
        Keeps the last answers, with what they are about.
    """
    kept: dict[tuple[int, ...], tuple[tuple[Any, ...], Any]] = {}

    @functools.wraps(function)
    def ask(*args: Any) -> Any:
        # what is kept is alive, so that no other object has its id
        key = tuple(arg if isinstance(arg, int) else id(arg) for arg in args)
        found = kept.get(key)
        if found is not None:
            return found[1]
        answer = cast("Callable[..., Any]", function)(*args)
        if len(kept) >= _MOST:
            kept.clear()
        kept[key] = (args, answer)
        return answer

    return cast("Callable[P, R]", ask)
