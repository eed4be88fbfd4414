"""What holds for every test."""

import os

# before numpy is loaded: with threads of its own the last bits of a product differ from run to run
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


import itertools
import sys
import time
from types import SimpleNamespace

import pytest


@pytest.fixture(autouse=True)
def _chunks_for_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `infer` count its chunks, which are about a second of work each, for seconds.

    A limit of ``max_seconds`` is then one of progress, and an answer the same on a machine that is
    loaded as on one that is idle.
    """
    infer = sys.modules.get("inference.posterior.infer")
    if infer is not None:
        ticks = itertools.count(0.0, 1.0)
        clock = SimpleNamespace(perf_counter=ticks.__next__, process_time=time.process_time)
        monkeypatch.setattr(infer, "time", clock)
