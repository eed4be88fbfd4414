"""numba's compiler without what it does again and again: the same machine code, sooner.

Most of the time of compiling is spent in numba's own Python. What is replaced here takes a quarter
of it, and comes to the same: lists of variables by a chain of `isinstance` for every operand,
settings compared member by member for every call, a lock that tells listeners of each of 80,000
steps, lifetimes that no later step asks for, runnable copies of functions that nobody runs, what a
sum of two numbers may be, and hashes of types of tuples.
"""

import contextlib
import gc
import os
import threading
from collections.abc import Callable, Iterator
from typing import Any

from numba.core import codegen, ir, postproc, targetconfig, transforms, types
from numba.core.typing import templates

from simulator.inner_code import InnerCompiler

__all__ = ["quicken", "rare_collections"]

# objects between collections
_RARE = 50_000
_lock = threading.Lock()
_depth, _before = [0], [0, 0, 0]
# what an operand is: a variable, an instruction, several, named ones, or nothing that has variables
_VARIABLE, _INSTRUCTION, _SEVERAL, _NAMED, _NOTHING = range(5)
_kinds: dict[type, int] = {}
_ir: Any = ir
_Config: Any = targetconfig.TargetConfig
_Overload: Any = templates._OverloadFunctionTemplate
_equal_by_members: Any = _Config.__eq__
_jit_of_target: Any = _Overload._get_jit_decorator
_Post: Any = postproc.PostProcessor
_Lifetime: Any = postproc.VariableLifetime
_canonical: Any = transforms.canonicalize_cfg
_run_all: Any = _Post.run
_codegen: Any = codegen
_types: Any = types
_Function: Any = _types.functions.BaseFunction
_call_type: Any = _Function.get_call_type
_NUMBERS: Any = (_types.Number, _types.Boolean)
# hashes hold in one process
_PROCESS = os.urandom(8)
# signatures of calls of numbers, by function and arguments
_signatures: dict[Any, Any] = {}
_lock_of_llvm: Any = _codegen.ll.ffi.lib._lock
# hashes of settings by their class
_hashes: dict[type, int] = {}


@contextlib.contextmanager
def rare_collections() -> Iterator[None]:
    """Look for cycles of objects that nobody has more rarely: of what a compiler makes few are."""
    with _lock:
        _depth[0] += 1
        if _depth[0] == 1:
            _before[:] = gc.get_threshold()
            gc.set_threshold(_before[0] and max(_before[0], _RARE), *_before[1:])
    try:
        yield
    finally:
        with _lock:
            _depth[0] -= 1
            if _depth[0] == 0:
                gc.set_threshold(*_before)


def _kind_of(kind: type) -> int:
    """Return what operands of a type are, in the order in which numba asks."""
    for each, number in (
        (_ir.Var, _VARIABLE),
        (_ir.Inst, _INSTRUCTION),
        ((list, tuple), _SEVERAL),
        (dict, _NAMED),
    ):
        if issubclass(kind, each):
            return number
    return _NOTHING


def _collect(value: Any, found: list[Any]) -> None:
    kind = type(value)
    number = _kinds.get(kind)
    if number is None:
        number = _kinds[kind] = _kind_of(kind)
    if number == _NOTHING:
        return
    if number == _VARIABLE:
        found.append(value)
    elif number == _INSTRUCTION:
        found += value.list_vars()
    else:
        for each in value.values() if number == _NAMED else value:
            _collect(each, found)


def _list_variables(self: object, value: Any) -> list[Any]:  # noqa: ARG001
    """Return the variables in operands of an instruction, in their order."""
    found: list[Any] = []
    _collect(value, found)
    return found


def _equal(self: Any, other: Any) -> Any:
    """Compare settings; what is set alike is alike."""
    if self is other or (type(self) is type(other) and self._values == other._values):
        return True
    return _equal_by_members(self, other)


def _hash(self: Any) -> int:
    """Return a hash of the names of settings, which is what numba takes."""
    kind = type(self)
    found = _hashes.get(kind)
    if found is None:
        found = _hashes[kind] = hash(tuple(sorted(self.options)))
    return found


def _run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """Prepare lifetimes of variables; what lives at the entry of blocks only generators ask."""
    if self.func_ir.is_generator:
        _run_all(self, emit_dels, extend_lifetimes)
        return
    self.func_ir.blocks = _canonical(self.func_ir.blocks)
    self.func_ir.variable_lifetime = _Lifetime(self.func_ir.blocks)
    self.func_ir.generator_info = None
    if emit_dels:
        self._insert_var_dels(extend_lifetimes=extend_lifetimes)


def _jit_of_inner_code(self: Any) -> Callable[..., Any]:
    """Return what compiles numba's functions for kernels: into them, and not runnable."""
    jit = _jit_of_target(self)

    def inner(**options: Any) -> Any:
        return jit(**{"no_cfunc_wrapper": True, "pipeline_class": InnerCompiler} | options)

    return inner


def _get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
    """Return the signature of a call; of numbers it is found once.

    numba asks every template of an operator anew, those for strings, lists and arrays first.
    """
    if kws or not all(isinstance(kind, _NUMBERS) for kind in args):
        return _call_type(self, context, args, kws)
    found = _signatures.get((self, args))
    if found is None:
        found = _signatures[self, args] = _call_type(self, context, args, kws)
    return found


def _hash_of_tuple(self: Any) -> int:
    """Return the hash of a type of tuples, which numba makes of all its members' every time."""
    whose, found = self.__dict__.get("_hash", (None, 0))
    if whose != _PROCESS:  # also one that the disk has kept
        found = hash(self.key)
        self._hash = _PROCESS, found
    return int(found)


def quicken() -> None:
    """Put all of it in the places of numba's own."""
    _ir.Inst._rec_list_vars = _list_variables
    _Config.__eq__, _Config.__hash__ = _equal, _hash
    _Post.run = _run
    _Overload._get_jit_decorator = _jit_of_inner_code
    _Function.get_call_type = _get_call_type
    _types.BaseTuple.__hash__ = _hash_of_tuple
    # they count how long the lock is held, for a number that nobody reads
    _lock_of_llvm._cblist[:] = [
        pair for pair in _lock_of_llvm._cblist if pair[0].__module__ != "numba.core.base"
    ]
