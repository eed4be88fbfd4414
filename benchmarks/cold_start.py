"""Processor time from the start of a process to its first answer.

    python -m benchmarks.cold_start [--only WORD] [--caches empty,warm,read-only]

One new process for each question, on an empty kernel cache, on one that holds all machine code
that the question can use, and on that one made read-only. The time is that of all threads of the
process, from its start, until the answer is there. Bytecode is there before, as in an installation.
The baseline is a process that imports numpy and nothing else. The first step of a posterior is
`prepare`, `start` and one task, behind which its progress is told and stored; `posterior` without
these words goes on to the first task behind its whole start.
"""

import argparse
import compileall
import json
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from service.warm.questions import FIRST_STEPS, QUESTIONS

__all__ = ["main"]


def _numpy() -> None:
    import numpy  # noqa: F401


def _command() -> None:
    """``hybridtof estimate`` of one frame."""
    from service.cli import main as hybridtof

    noise = {"read": [2e-5, 1e-3]}
    system = {"sensor": {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise}, "scene": {}}
    with tempfile.TemporaryDirectory() as folder:
        frames, scene = Path(folder, "frames.csv"), Path(folder, "scene.json")
        frames.write_text("w1,w2\n0.0242,0.4230\n")
        scene.write_text(json.dumps(system))
        # the words of the process, as its user gives them
        sys.argv = ["hybridtof", "estimate", str(frames), "--scene", str(scene), "--quiet"]
        assert hybridtof() == 0


def _started() -> dict[str, Callable[[], object]]:
    return {"numpy": _numpy, "hybridtof estimate": _command} | FIRST_STEPS | QUESTIONS


def _seconds(name: str, cache: Path, **settings: str) -> float:
    """Processor time of a new process until its answer [s]."""
    command = [sys.executable, "-m", "benchmarks.cold_start", "--answer", name]
    settings |= {"NUMBA_CACHE_DIR": str(cache), "OPENBLAS_NUM_THREADS": "1"}
    environment = os.environ | settings
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(  # noqa: S603
        command, env=environment, stdout=subprocess.PIPE, text=True, check=True
    )
    return float(done.stdout.split()[-1])


def _seal(cache: Path, sealed: bool) -> None:
    """Make a tree read-only, or writable again; root may write all the same."""
    for path in (cache, *cache.rglob("*")):
        mode = path.stat().st_mode
        path.chmod(mode & ~0o222 if sealed else mode | stat.S_IWUSR)


def _row(name: str, caches: list[str]) -> list[float]:
    folder = Path(tempfile.mkdtemp())
    found = {}
    try:
        found["empty"] = _seconds(name, folder)
        if "warm" in caches or "read-only" in caches:
            _seconds(name, folder, KERNELS_COMPILE="always")
            found["warm"] = min(_seconds(name, folder) for _ in range(3))
        if "read-only" in caches:
            _seal(folder, True)
            found["read-only"] = min(_seconds(name, folder) for _ in range(3))
    finally:
        _seal(folder, False)
        shutil.rmtree(folder)
    return [found[cache] for cache in caches]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="questions whose name contains this")
    parser.add_argument("--caches", default="empty,warm,read-only")
    parser.add_argument("--answer", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.answer is not None:
        _started()[args.answer]()
        print(time.process_time(), flush=True)
        os._exit(0)  # what is still compiling is nobody's any more
    for package in ("simulator", "inference", "service", "benchmarks"):
        compileall.compile_dir(Path(__file__).parents[1] / package, quiet=1)
    caches = args.caches.split(",")
    print(f"{'processor time [s], cache:':<40}" + "".join(f"{cache:>11}" for cache in caches))
    for name in _started():
        if args.only in name:
            row = _row(name, caches)
            print(f"{name:<40}" + "".join(f"{seconds:>11.2f}" for seconds in row), flush=True)


if __name__ == "__main__":
    main()
