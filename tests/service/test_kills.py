"""Services, workers and databases are killed while jobs run; a longer version is `make kills`."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from benchmarks.fleet import Fleet, fleet
from benchmarks.kills import survived
from benchmarks.postgres import postgres, restart
from tests.service.conftest import FRAMES, SENSOR
from tests.service.fake_fold import CHUNKS, STEPS
from tests.service.test_jobs import undisturbed
from tests.service.test_server import fake_server

pytestmark = pytest.mark.slow


@pytest.fixture(params=["sqlite", pytest.param("postgresql", marks=pytest.mark.thorough)])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[str, int]]:
    """Address of a database, and how many services share it."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path}/jobs.sqlite", 1
        return
    with postgres() as address:
        if address is None:
            pytest.skip("no PostgreSQL server is installed")
        yield address, 2


def test_kills_change_nothing(database: tuple[str, int]) -> None:
    address, services = database
    sampler = {"seed": 5, "ensembles": 2}
    body = {"sensor": SENSOR, "scene": {}, "frames": FRAMES, "sampler": sampler}
    reached = [0]

    def further(running: Fleet) -> None:
        """Wait until something was computed since the last kill, or all is."""
        while reached[0] >= (steps := sum(running.steps())) < 3 * CHUNKS * STEPS:
            time.sleep(0.02)
        reached[0] = steps

    settings = {"HYBRIDTOF_DATABASE": address}
    with fleet(fake_server(sleep=0.2), settings, services) as running:
        bodies = dict.fromkeys("abc", body)
        # one of each kind: a start takes longer than all that is computed
        kills: list[Callable[[], str]] = [running.kill_worker, running.kill_service]
        if services > 1:
            kills.insert(1, lambda: restart(address))
        found = survived(running, bodies, kills, further)
    answers = [answer for answer, _ in found.values()]
    assert [a["parameters"]["object.c0"]["mean"] for a in answers] == [undisturbed()] * 3
    assert all(one == found["a"] for one in found.values())
