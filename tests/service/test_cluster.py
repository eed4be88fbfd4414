"""Chunks on a real Dask cluster, with TLS: its workers and its scheduler may die."""

import contextlib
import random
import shutil
import socket
import time
from functools import partial
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="Dask is not installed: hybridtof[cluster]")

from benchmarks.cluster import Cluster, listens
from benchmarks.fleet import Fleet, fleet
from benchmarks.kills import survived
from benchmarks.ports import own_port
from benchmarks.postgres import postgres
from service import cluster
from service.cli import main
from tests.service.conftest import FRAMES, SENSOR
from tests.service.fake_fold import CHUNKS, STEPS
from tests.service.test_compose import certified
from tests.service.test_jobs import undisturbed
from tests.service.test_server import fake_server


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("ftp://127.0.0.1:8786", "must be local, tls://host:port"),
        ("tcp://127.0.0.1", "must be local, tls://host:port"),
        ("tcp://127.0.0.1:99999", "must be local, tls://host:port"),
        ("tcp://cluster.example:8786", "tcp is for loopback alone"),
        ("tls://127.0.0.1:8786", "tls needs DASK_DISTRIBUTED__COMM__TLS__CA_FILE, "),
        ("tcp://127.0.0.1:1", "there is no scheduler to be reached at tcp://127.0.0.1:1: "),
    ],
)
def test_refused_at_the_start(
    address: str,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("HYBRIDTOF_DATABASE", f"sqlite:///{tmp_path}/jobs.sqlite")
    monkeypatch.setenv("HYBRIDTOF_EXECUTOR", address)
    monkeypatch.setattr(cluster, "_CONNECT_S", 0.5)
    assert main(["serve", "--port", "0"]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith(f"hybridtof: error: /HYBRIDTOF_EXECUTOR: {said}")
    assert captured.err.count("\n") == 1


def test_a_scheduler_listens_once_its_file_is_whole(tmp_path: Path) -> None:
    """Dask writes it in place: a busy machine lets others read the first half of it."""
    file, whole = tmp_path / "scheduler.json", '{"type": "Scheduler", "address": "tcp://[::1]:1"}'
    found = [listens(file)]
    for written in ("", whole[:20], whole):
        file.write_text(written)
        found.append(listens(file))
    assert found == [False, False, False, True]


def test_a_port_of_its_own_is_given_to_nobody_who_asks_for_any() -> None:
    given = set()
    with contextlib.ExitStack() as open_ones:
        for _ in range(50):
            one = open_ones.enter_context(socket.socket())
            one.bind(("127.0.0.1", 0))
            given.add(one.getsockname()[1])
        own = own_port()
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", own))
    assert own < min(given)


@pytest.mark.slow
def test_kills_of_a_cluster_change_nothing(tmp_path: Path) -> None:
    """The parts of compose.yaml together: a chunk's process, a worker, then the scheduler die."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl is installed to make certificates")
    body = {
        "sensor": SENSOR,
        "scene": {},
        "frames": FRAMES,
        "sampler": {"seed": 5, "ensembles": 2},
    }
    rng, reached = random.Random(2), [0]

    def further(running: Fleet) -> None:
        """Wait until something was computed since the last kill, or all is."""
        while reached[0] >= (steps := sum(running.steps())) < 2 * CHUNKS * STEPS:
            time.sleep(0.02)
        reached[0] = steps

    with contextlib.ExitStack() as parts:
        database = parts.enter_context(postgres()) or f"sqlite:///{tmp_path}/jobs.sqlite"
        run = Cluster(certified(tmp_path), tmp_path, 2)
        parts.callback(run.end)
        kills = [partial(run.kill, rng, what) for what in ("process", "worker", "scheduler")]
        settings = run.settings | {"HYBRIDTOF_DATABASE": database}
        running = parts.enter_context(fleet(fake_server(sleep=0.2), settings, 1))
        found = survived(running, dict.fromkeys("ab", body), kills, further)
    answers = [answer for answer, _ in found.values()]
    assert [a["parameters"]["object.c0"]["mean"] for a in answers] == [undisturbed()] * 2
    assert found["a"] == found["b"]
