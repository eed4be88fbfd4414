"""What holds for every test."""

import os
import shutil
import tempfile

# before numpy is loaded: with threads of its own the last bits of a product differ from run to run
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# most kinds of calls come often in all tests together: what the interpreter answers is lost
os.environ.setdefault("KERNELS_COMPILE", "soon")
# servers of tests make the machine code that they need, and no other
os.environ.setdefault("HYBRIDTOF_WARM", "off")
# jobs and streams of the user are not the tests': a fixture that lives longer than a test has this
os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="hybridtof-tests-")


import sys
import uuid
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from tests.chunk_clock import timed
from tests.groups import TOGETHER, group_of
from tests.thorough import THOROUGH

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.scheduler import LoadScopeScheduling

_STATE = os.environ["XDG_STATE_HOME"]

# a busy machine is no fault of what is tested
settings.register_profile(
    "busy", settings(), deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("busy")


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with what takes long, and leave out what is thorough, but in `make thorough`."""
    if not THOROUGH:
        left_out = [item for item in items if item.get_closest_marker("thorough")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not item.get_closest_marker("thorough")]
    slow = {group_of(item.nodeid) for item in items if item.get_closest_marker("slow")}
    slow.update(TOGETHER.values())
    items.sort(key=lambda item: group_of(item.nodeid) not in slow)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: "Producer") -> "LoadScopeScheduling":
    """Let one process run what compiles the same kernels."""
    from tests.grouped_scheduling import GroupedScheduling

    return GroupedScheduling(config, log)


def pytest_unconfigure() -> None:
    """Leave nothing of the store of all tests."""
    shutil.rmtree(_STATE, ignore_errors=True)


@pytest.fixture(autouse=True)
def _chunks_for_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `infer` count its chunks, which are about a second of work each, for seconds.

    A limit of ``max_seconds`` is then one of progress, and an answer the same on a machine that is
    loaded as on one that is idle.
    """
    infer = sys.modules.get("inference.posterior.infer")
    if infer is not None:
        monkeypatch.setattr(infer, "timed", timed)


@pytest.fixture(autouse=True)
def _state_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Let every test have a store of jobs of its own, and leave the user's alone."""
    home = tmp_path_factory.getbasetemp() / "state" / uuid.uuid4().hex
    monkeypatch.setenv("XDG_STATE_HOME", str(home))
