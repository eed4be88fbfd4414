"""Kernels that make no array of their own count no references to those that they are given.

numba counts the references to every array of every named tuple that is handed on, opened or left
behind, and finds out later that nearly all of it cancels: a third of what it writes for its
optimiser. A caller holds what it hands over until the call returns. What a kernel looks at in it,
without making or returning an array, needs no count.
"""

from typing import Any

from numba.core import compiler, ir, lowering, typed_passes, types
from numba.core.compiler_machinery import register_pass
from numba.core.runtime.context import NRTContext

__all__ = ["Compiler"]

# numba's classes carry no types
_Lower: Any = lowering.Lower
_NativeLowering: Any = typed_passes.NativeLowering
_Compiler: Any = compiler.Compiler
_Context: Any = NRTContext
_registered: Any = register_pass
_ir: Any = ir
_types: Any = types

# expressions whose value is part of their operands
_PARTS = frozenset({"getattr", "static_getitem", "build_tuple", "exhaust_iter", "cast"})


class _NoCount(_Context):  # type: ignore[misc]
    """References that nobody counts; to make an array is refused."""

    def incref(self, builder: Any, typ: Any, value: Any) -> None:
        """Count nothing."""

    def decref(self, builder: Any, typ: Any, value: Any) -> None:
        """Count nothing."""


class _Lowering(_Lower):  # type: ignore[misc]
    """numba's way from typed instructions to the optimiser's, without counts that cancel."""

    def lower(self) -> None:
        context = self.context
        if not (context.enable_nrt and self._borrows()):
            super().lower()
            return
        context.enable_nrt, context.nrt = False, _NoCount(context, False)
        try:
            super().lower()
        finally:
            context.enable_nrt = True
            del context.nrt

    def _holds(self, kind: Any) -> bool:
        """Tell whether values of a type hold references."""
        return bool(self.context.data_model_manager[kind].contains_nrt_meminfo())

    def _borrows(self) -> bool:
        """Tell whether all that holds references is part of an argument."""
        if self.generator_info is not None or self._holds(self.fndesc.restype):
            return False
        return all(
            self._is_part(each)
            for block in self.blocks.values()
            for each in block.body
            if isinstance(each, _ir.Assign) and self._holds(self.typeof(each.target.name))
        )

    def _is_part(self, assigned: Any) -> bool:
        """Tell whether an assigned value is part of what it is taken from."""
        value, kind = assigned.value, self.typeof(assigned.target.name)
        if not isinstance(kind, _types.Array | _types.BaseTuple | _types.NumpyFlatType):
            return False
        if isinstance(value, _ir.Arg | _ir.Var | _ir.Const | _ir.Global | _ir.FreeVar):
            return True
        if not isinstance(value, _ir.Expr):
            return False
        if value.op == "call":
            return isinstance(self.typeof(value.func.name), _types.NamedTupleClass)
        if value.op in {"getitem", "static_getitem"} and isinstance(kind, _types.Array):
            return self._is_view(value)
        # to numbers that are real numba makes an imaginary part
        return value.op in _PARTS and not (value.op == "getattr" and value.attr == "imag")

    def _is_view(self, value: Any) -> bool:
        """Tell whether an element of an array, or of a tuple, is no copy."""
        if isinstance(self.typeof(value.value.name), _types.BaseTuple):
            return True
        index = value.index_var if value.op == "static_getitem" else value.index
        if index is None:
            return False
        kind = self.typeof(index.name)
        parts = kind.types if isinstance(kind, _types.BaseTuple) else (kind,)
        return all(
            isinstance(
                each, _types.Integer | _types.SliceType | _types.EllipsisType | _types.NoneType
            )
            for each in parts
        )


@_registered(mutates_CFG=True, analysis_only=False)
class _BorrowedLowering(_NativeLowering):  # type: ignore[misc]
    _name = "borrowed_lowering"

    @property
    def lowering_class(self) -> Any:
        return _Lowering


class Compiler(_Compiler):  # type: ignore[misc]
    """numba's compiler, which counts no references where there is no need."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's passes with another lowering."""
        pipelines: list[Any] = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [
                (_BorrowedLowering, name) if made is _NativeLowering else (made, name)
                for made, name in pipeline.passes
            ]
        return pipelines
