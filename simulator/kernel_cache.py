"""Where machine code is kept: a folder for exactly these sources, of nobody else's making.

Kernels call one another across files, but numba's own cache looks at the caller's file alone: after
an edit of the callee it would go on running the old machine code. The folder of a file is therefore
named by a digest of it and of every file of kernels or named tuples that it uses, directly or not.
Times play no part, so that a copied cache is as good as the first.

What lies there is run. A folder that another user owns, or that others may write to, is refused.
"""

import functools
import hashlib
import os
import re
import stat
from pathlib import Path
from typing import NamedTuple

__all__ = ["CacheFolder", "base_folder", "digest_of_all", "folder_of"]

_ROOT = Path(__file__).resolve().parents[1]
# what kernels call, and what they take: their members are found by their places
_MARKS = (b"from simulator.compiled import compiled", b"(NamedTuple):")
_IMPORT = re.compile(rb"^from ((?:simulator|inference)[\w.]*) import ", re.MULTILINE)
_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH


class CacheFolder(NamedTuple):
    """A folder of machine code, and whether it can be added to."""

    path: Path
    writable: bool


@functools.cache
def _read(path: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Return the source and imports of a file of kernels or named tuples; nothing of others."""
    if not path.is_file():
        return b"", ()
    source = path.read_bytes()
    if not any(mark in source for mark in _MARKS):
        return b"", ()
    used: list[Path] = []
    for name in _IMPORT.findall(source):
        there = _ROOT.joinpath(*name.decode().split("."))
        # of a package any module may be meant
        used += sorted(there.glob("*.py")) if there.is_dir() else [there.with_suffix(".py")]
    return source, tuple(used)


@functools.cache
def _digest(path: Path) -> str:
    """Return a digest of a file and of all that its kernels are made of."""
    seen: set[Path] = set()
    ahead = [path]
    while ahead:
        here = ahead.pop()
        if here not in seen:
            seen.add(here)
            ahead += _read(here)[1]
    digest = hashlib.sha256(path.read_bytes())
    for one in sorted(seen):
        source, _ = _read(one)
        if source:
            digest.update(os.path.relpath(one, _ROOT).encode())
            digest.update(source)
    return digest.hexdigest()[:16]


def digest_of_all() -> str:
    """Return a digest of every file of kernels."""
    digest = hashlib.sha256()
    for package in ("simulator", "inference", "service"):
        for path in sorted((_ROOT / package).rglob("*.py")):
            digest.update(_read(path)[0])
    return digest.hexdigest()[:16]


def base_folder() -> CacheFolder | None:
    """Return the folder of all machine code, made if need be; None where there can be none."""
    stated = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        return _checked((Path(stated) if stated else Path.home() / ".cache") / "hybridtof")
    except RuntimeError:  # no home
        return None


def _warn(why: str) -> None:
    import logging  # seldom needed

    logging.getLogger("hybridtof").warning("%s: its machine code is not used", why)


@functools.cache
def _checked(path: Path) -> CacheFolder | None:
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = path.stat()
    except OSError:  # read-only, and not there: compile in memory
        return None
    own = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    # of the superuser's making: an image, as the sources themselves
    if not own and found.st_uid != 0:
        _warn(f"{path} belongs to another user")
        return None
    if found.st_mode & _OTHERS_MAY_WRITE:
        _warn(f"others may write to {path}")
        return None
    writable = own and os.access(path, os.W_OK | os.X_OK)
    if writable and stat.S_IMODE(found.st_mode) != 0o700:
        path.chmod(0o700)
    return CacheFolder(path, writable)


def folder_of(path: Path) -> CacheFolder | None:
    """Return the folder for machine code of a file of kernels; None where there can be none.

    Parameters
    ----------
    path : Path
        The file of the sources.
    """
    base = base_folder()
    if base is None:
        return None
    return CacheFolder(base.path / _digest(path), base.writable)
