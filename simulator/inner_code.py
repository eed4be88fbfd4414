"""Kernels that only kernels call: code that the caller takes in, and that is not run by itself.

numba makes every function runnable, and optimises it, before the next takes it in and optimises
all of it again. What Python never calls is spared both here: its code is kept as the compiler left
it, and optimised once, in the kernel that Python calls.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba.core import codegen, compiler, runtime

from simulator.borrowed import Compiler

__all__ = ["ClosedCompiler", "InnerCompiler", "rebuilt"]

# numba's classes carry no types, and its stubs know a part of its names
_numba: Any = numba
_runtime: Any = runtime
_Library: Any = codegen.JITCodeLibrary
_CompileResult: Any = compiler.CompileResult
_make_function: Any = _numba._dynfunc.make_function
_codegen: Any = codegen


class _InnerLibrary(_Library):  # type: ignore[misc]
    """Code of a kernel and of all that it calls, not optimised and not runnable."""

    def finalize(self) -> None:
        """Take in what is called; the last caller has numba's own functions anyway."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            if library is not _runtime.rtsys.library:
                self._reload_init.update(library._reload_init)
                self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Return what the disk keeps: there is no object code."""
        self._ensure_finalized()
        return self.name, "inner", self._get_module_for_linking().as_bitcode()


class InnerCompiler(Compiler):
    """numba's compiler, up to where code would be made runnable."""

    def __init__(self, typing: Any, target: Any, library: Any, *more: Any) -> None:
        super().__init__(typing, target, library, *more)
        self.state.library = _InnerLibrary(target.codegen(), "inner")
        self.state.targetctx.get_executable = _key  # of a context of this compiling alone


class _ClosedLibrary(_Library):  # type: ignore[misc]
    """Code of a kernel, and of all that it calls, which is its own (`simulator.closed`)."""

    def _optimize_final_module(self) -> None:
        functions = list(self._final_module.functions)
        ours = [each for each in functions if each.linkage.name == "external"]
        whose = next(each.name for each in ours if not each.is_declaration)
        for function in functions:
            # numba gives functions such names; others are of its runtime, and known by theirs
            if function.linkage.name == "linkonce_odr" and function.name.startswith("_ZN"):
                function.linkage = "internal"
                # the linker would give others of that name this one, which is called in another way
                function.name = f"{whose}.{function.name}"
        super()._optimize_final_module()


class ClosedCompiler(Compiler):
    """numba's compiler, of a kernel that Python alone calls."""

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        """Compile a function as numba does, but for its library."""
        library = _ClosedLibrary(self.state.targetctx.codegen(), function.__qualname__)
        library.enable_object_caching()
        self.state.library = library
        return super().compile_extra(function)


def _key(library: Any, described: Any, environment: Any) -> Any:
    """Return what numba knows a function by; it cannot be called."""
    library._ensure_finalized()
    module, name = described.lookup_module(), described.qualname.rpartition(".")[2]
    return _make_function(module, name, "", 0, environment, (library,))


def rebuilt(target: Any, payload: tuple[Any, ...]) -> Any:
    """Return what was kept on the disk."""
    kept, described, environment, signature, *_, reload_init, environments = payload
    load: Callable[[], None]
    for load in reload_init:
        load()
    name, _, code = kept
    library = _InnerLibrary(target.codegen(), name)
    library._final_module = library._shared_module = _codegen.ll.parse_bitcode(code)
    library._finalize_final_module()
    return _CompileResult(
        **dict.fromkeys(_CompileResult._fields)
        | {
            "target_context": target,
            "typing_context": target.typing_context,
            "library": library,
            "environment": environment,
            "entry_point": _key(library, described, environment),
            "fndesc": described,
            "signature": signature,
            "objectmode": False,
            "lifted": (),
            "reload_init": reload_init,
            "referenced_envs": environments,
        }
    )
