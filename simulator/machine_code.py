"""Kernels as machine code: what is used of numba, imported when it is first needed."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import extending, types
from numba.core import sigutils

from simulator.borrowed import Compiler
from simulator.closed import CLOSED
from simulator.compile_lock import turn
from simulator.inner_code import ClosedCompiler, InnerCompiler
from simulator.kept_code import KeptCode
from simulator.kernel_cache import CacheFolder, base_folder
from simulator.quick_compiler import quicken, rare_collections

__all__ = ["dispatcher", "is_none", "is_number", "overload", "unliteral"]

F = TypeVar("F", bound=Callable[..., Any])
# numba's classes carry no types, and its stubs know a part of its options
_njit: Any = numba.njit
_normalized: Any = sigutils.normalize_signature

_overload: Any = extending.overload
unliteral: Any = types.unliteral

quicken()


def overload(function: Callable[..., Any]) -> Callable[[F], F]:
    """Choose the body of a function that kernels call by the types of its arguments."""
    chosen: Callable[[F], F] = _overload(function, strict=False)
    return chosen


def is_none(kind: object) -> bool:
    """Tell whether a type is that of None."""
    return kind is types.none


def is_number(kind: object) -> bool:
    """Tell whether a type is that of a number."""
    return isinstance(kind, types.Number)


def dispatcher(
    function: Callable[..., Any],
    folder: CacheFolder | None,
    options: dict[str, bool],
    inner: bool = False,
) -> Any:
    """Return numba's dispatcher of a function, with its machine code in a folder.

    One of an inner function answers kernels alone (`simulator.inner_code`), and one of a closed
    kernel Python alone (`simulator.closed`).

    Division by zero gives inf or nan as in numpy; the interpreter lock is released; no fast-math,
    because error-free transformations and tests for nan must survive.
    """
    hidden = {name: value for name, value in options.items() if name.startswith("_")}
    pipeline: dict[str, Any] = {
        "pipeline_class": ClosedCompiler if hidden.pop(CLOSED, 0) else Compiler
    }
    if inner:
        pipeline = {"no_cpython_wrapper": True, "pipeline_class": InnerCompiler}
    made = _njit(
        nogil=True,
        error_model="numpy",
        fastmath=False,
        no_cfunc_wrapper=True,  # nothing here is called from C
        **{name: value for name, value in options.items() if not name.startswith("_")},
        **pipeline,
    )(function)
    made.targetoptions.update(hidden)
    made.compile = rare_collections()(made.compile)
    if folder is not None:
        made._cache = KeptCode(function, folder, inner)
        if folder.writable:
            _in_turn(made, f"{folder.path.name}/{function.__qualname__}")
    return made


def _in_turn(made: Any, name: str) -> None:
    """Let a dispatcher wait for the process that compiles the same, and load what that has kept."""
    compile_now, base = made.compile, base_folder()

    def compile_in_turn(signature: Any) -> Any:
        types_of, _ = _normalized(signature)
        if base is None or tuple(types_of) in made.overloads:
            return compile_now(signature)
        with turn(base.path, f"{name}{types_of}"):
            return compile_now(signature)

    made.compile = compile_in_turn
