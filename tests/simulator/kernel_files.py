"""The files of kernels and of named tuples, found by their text."""

from pathlib import Path

import simulator.compiled

ROOT = Path(simulator.compiled.__file__).resolve().parents[1]

DECORATORS = {"compiled", "compiled_for_both"}

KERNELS = sorted(
    path
    for package in ("simulator", "inference")
    for path in (ROOT / package).rglob("*.py")
    if "@compiled" in path.read_text() and path.name != "compiled.py"
)
