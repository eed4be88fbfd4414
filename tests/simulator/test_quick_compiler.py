"""What stands in the place of numba's own comes to the same."""

import gc
import math
import operator
import pickle
from collections.abc import Callable
from typing import Any

import pytest
from numba import types
from numba.core import compiler, ir, postproc, targetconfig
from numba.core.registry import cpu_target

from simulator import inner_code, quick_compiler

# numba's classes carry no types
_ir: Any = ir
_Flags: Any = compiler.Flags
_Config: Any = targetconfig.TargetConfig
quick_compiler.quicken()  # as whoever compiles does


def branching(x: float, several: tuple[float, float], times: int) -> float:
    total = 0.0
    for i in range(times):
        total += math.sqrt(x) if x > several[0] else min(x, several[1]) * i
        if total > 100.0:
            break
    return total


def representation(function: Callable[..., Any]) -> Any:
    """Return a function as numba's passes take it."""
    made: Any = compiler
    return made.run_frontend(function)


def by_chains(value: Any) -> list[Any]:
    """Return variables as numba's own code finds them."""
    if isinstance(value, _ir.Var):
        return [value]
    if isinstance(value, _ir.Expr):
        return by_chains(value._kws)
    if isinstance(value, _ir.Stmt):
        return by_chains(value.__dict__)
    if isinstance(value, dict):
        return by_chains(list(value.values()))
    if isinstance(value, list | tuple):
        return [found for each in value for found in by_chains(each)]
    return []


def test_the_same_variables_are_found_in_the_same_order() -> None:
    statements = [
        each for block in representation(branching).blocks.values() for each in block.body
    ]
    assert len(statements) > 30
    found = [each.list_vars() for each in statements]
    assert found == [by_chains(each) for each in statements]
    assert max(map(len, found)) > 2
    kinds = {type(each.value) for each in statements if isinstance(each, _ir.Assign)}
    assert {_ir.Var, _ir.Expr, _ir.Const, _ir.Global, _ir.Arg} <= kinds


def test_settings_are_equal_where_all_their_members_are() -> None:
    plain, stated, other = _Flags(), _Flags(), _Flags()
    stated.nrt, other.nrt = False, True  # false by default
    assert plain == stated
    assert hash(plain) == hash(stated)
    assert stated.copy() == stated
    assert plain != other
    assert stated != other
    other.nrt = False
    assert stated == other
    assert plain != _Config()


def test_lifetimes_are_those_of_the_whole_preparation(monkeypatch: pytest.MonkeyPatch) -> None:
    def lines(run: Callable[..., None]) -> list[str]:
        monkeypatch.setattr(postproc.PostProcessor, "run", run)
        found = representation(branching)
        made: Any = postproc
        made.PostProcessor(found).run(emit_dels=True)
        return [str(each) for block in found.blocks.values() for each in block.body]

    quick = lines(quick_compiler._run)
    assert any(each.startswith("del ") for each in quick)
    assert quick == lines(quick_compiler._run_all)


def test_generators_get_the_whole_preparation() -> None:
    def counting(times: int) -> Any:
        for i in range(times):
            yield i * times

    made: Any = representation(counting)
    assert made.generator_info.state_vars


def test_collections_are_rare_while_a_kernel_is_compiled_and_as_before_afterwards() -> None:
    before, within = gc.get_threshold(), []

    @quick_compiler.rare_collections()
    def compiling(deeper: int) -> None:
        within.append(gc.get_threshold()[0])
        if deeper:
            compiling(deeper - 1)
            within.append(gc.get_threshold()[0])
        else:
            raise ArithmeticError

    with pytest.raises(ArithmeticError):
        compiling(1)
    assert gc.get_threshold() == before
    assert within == [quick_compiler._RARE] * 2
    gc.set_threshold(0, *before[1:])  # whoever wants none has none
    try:
        with quick_compiler.rare_collections():
            assert gc.get_threshold()[0] == 0
    finally:
        gc.set_threshold(*before)


def test_numbas_own_functions_for_kernels_are_inner_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quick_compiler, "_jit_of_target", lambda _: dict)
    options = quick_compiler._jit_of_inner_code(None)(no_cpython_wrapper=True, inline="never")
    assert options == {
        "no_cpython_wrapper": True,
        "no_cfunc_wrapper": True,
        "pipeline_class": inner_code.InnerCompiler,
        "inline": "never",
    }


@pytest.mark.parametrize(
    "kinds", [("float64", "int64"), ("int64", "int64"), ("boolean", "float64")]
)
def test_the_signature_of_numbers_is_found_once(
    monkeypatch: pytest.MonkeyPatch, kinds: tuple[str, str]
) -> None:
    context: Any = cpu_target.typing_context
    context.refresh()
    function: Any = context.resolve_value_type(operator.truediv)
    args = tuple(getattr(types, kind) for kind in kinds)
    wanted = quick_compiler._call_type(function, context, args, {})
    assert function.get_call_type(context, args, {}) == wanted
    monkeypatch.setattr(quick_compiler, "_call_type", None)
    assert function.get_call_type(context, args, {}) == wanted
    assert function.get_impl_key(wanted)


def test_the_hash_of_a_type_of_tuples_holds_in_its_process() -> None:
    made: Any = types
    kind = made.Tuple((made.float64, made.Tuple((made.int64, made.none))))
    assert hash(kind) == hash(kind.key) == hash(kind)
    kind._hash = b"of another", 1  # kept on the disk
    assert hash(kind) == hash(kind.key)
    assert hash(pickle.loads(pickle.dumps(kind))) == hash(kind.key)  # noqa: S301


def test_nobody_counts_how_long_the_lock_of_llvm_is_held() -> None:
    assert not quick_compiler._lock_of_llvm._cblist
