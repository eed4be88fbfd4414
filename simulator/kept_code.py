"""Machine code on the disk: numba's cache of a function, to which processes may add side by side.

numba numbers the files of a function, and lists in an index which is of what kind of call. Where
two processes keep the code of two kinds at the same time, both take one number, and the index may
name a file as that of a kind whose code is not in it: what calls the function so can then never be
compiled again. Here every kind has a file of its own name, the index is written by one process at a
time, and what is read is held to what was asked for.
"""

import contextlib
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba.core import caching, sigutils

from simulator.compile_lock import turn
from simulator.inner_code import rebuilt
from simulator.kernel_cache import CacheFolder, base_folder

__all__ = ["KeptCode"]

# numba's classes carry no types
_FunctionCache: Any = caching.FunctionCache
_IndexDataCacheFile: Any = caching.IndexDataCacheFile
_CacheLocator: Any = caching._CacheLocator
_CacheImpl: Any = caching.CompileResultCacheImpl
_normalized: Any = sigutils.normalize_signature


class _Locator(_CacheLocator):  # type: ignore[misc]
    """Names files by function and line: the folder is that of exactly these sources."""

    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._folder, self._line = folder, function.__code__.co_firstlineno

    def ensure_cache_path(self) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return ""  # the folder says it all: no times, so that a copy is as good

    def get_disambiguator(self) -> str:
        return str(self._line)


class _Impl(_CacheImpl):  # type: ignore[misc]
    def __init__(self, function: Callable[..., Any], folder: Path) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = _Locator(function, folder)
        self._filename_base = self.get_filename_base(
            f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}", ""
        )


class _InnerImpl(_Impl):
    def rebuild(self, target_context: Any, payload: Any) -> Any:
        return rebuilt(target_context, payload)


class _Files(_IndexDataCacheFile):  # type: ignore[misc]
    """Index and data of one function."""

    def save(self, key: Any, data: Any) -> None:
        """Keep the code of a kind of call, listed only when it is there."""
        base = self._index_name.removesuffix(".nbi")
        name = f"{base}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"
        self._save_data(name, data)
        found = base_folder()
        with contextlib.nullcontext() if found is None else turn(found.path, self._index_path):
            self._save_index(self._load_index() | {key: name})

    def load(self, key: Any) -> Any:
        """Return what is kept of a kind of call; None where that is of another one."""
        found = super().load(key)
        if found is None:
            return None
        asked, (_, _, _, kept, *_) = _normalized(key[0])[0], found
        return found if tuple(kept.args) == tuple(asked) else None


class KeptCode(_FunctionCache):  # type: ignore[misc]
    """numba's cache of a function, in a folder that may be read-only."""

    def __init__(self, function: Callable[..., Any], folder: CacheFolder, inner: bool) -> None:
        self._writable = folder.writable
        impl = _InnerImpl if inner else _Impl
        self._impl_class = lambda one: impl(one, folder.path)
        super().__init__(function)
        here = self._impl.locator
        self._cache_file = _Files(
            here.get_cache_path(), self._impl.filename_base, here.get_source_stamp()
        )

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep the code of a kind of call, if the folder can be written to."""
        if self._writable:
            super().save_overload(signature, result)
