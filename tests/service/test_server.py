"""Processes of their own: the server over a real socket, signals, pipes."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.service.conftest import FRAMES, JSON, SCENE, SENSOR

pytestmark = pytest.mark.slow


def fake_server(max_body_bytes: int = 10**6, **orders: Any) -> tuple[str, ...]:
    """Command of a server whose posteriors are `fake_fold` with these orders."""
    arguments = (json.dumps(orders), str(max_body_bytes))
    return (sys.executable, "-m", "tests.service.fake_server", *arguments)


def environment(**extra: str) -> dict[str, str]:
    """Environment without settings, coverage of the project's own folder."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("HYBRIDTOF_")}
    kept["HYBRIDTOF_WARM"] = "off"
    return kept | {"PYTHONPATH": str(Path(__file__).parents[2])} | extra


@contextmanager
def server(*command: str, **settings: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A server on a port that the system picks, and its address."""
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=environment(**settings)
    )
    assert process.stderr is not None
    try:
        for line in process.stderr:
            if match := re.search(r"running on (http://\S+)", line):
                yield process, match[1]
                break
        else:
            raise AssertionError("the server does not start")
    finally:
        process.kill()
        process.wait()
        process.stderr.close()


def hybridtof(*arguments: str) -> tuple[str, ...]:
    return (sys.executable, "-m", "service.cli", *arguments)


def status(pid: int) -> tuple[str, int] | None:
    """State and parent of a process, from /proc; None where there is none."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except (FileNotFoundError, ProcessLookupError):
        return None
    return fields[0], int(fields[1])


def children(pid: int) -> list[int]:
    pids = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    return [p for p in pids if (found := status(p)) is not None and found[1] == pid]


def alive(pid: int) -> bool:
    found = status(pid)
    return found is not None and found[0] != "Z"


def end(*pids: int) -> bool:
    """Whether processes end before one that counts for a minute or so and starts only now.

    On a loaded machine it counts for longer: what moves at all has its share of the processors.
    """
    count = (sys.executable, "-c", "for _ in range(2 * 10**9): pass")
    with subprocess.Popen(count) as yardstick:
        try:
            while yardstick.poll() is None and any(map(alive, pids)):
                time.sleep(0.02)
        finally:
            yardstick.kill()
    return not any(map(alive, pids))


def client(address: str) -> httpx.Client:
    """A client that waits for as long as the server lives."""
    return httpx.Client(base_url=address, timeout=None)  # noqa: S113  (a clock knows no load)


def test_serves_without_configuration_and_ends_on_sigterm() -> None:
    with server(*hybridtof("serve", "--port", "0")) as (process, address):
        with client(address) as http:
            assert http.get("/health/live").status_code == 200
            assert http.get("/health/ready").status_code == 200
            body = {"sensor": SENSOR, "scene": SCENE, "frames": FRAMES}
            assert http.post("/v1/estimates", json=body).status_code == 200
            # more lines than a pipe holds, of which nobody reads any
            for _ in range(400):
                assert http.get("/v1/nothing").status_code == 404
        process.send_signal(signal.SIGTERM)
        assert end(process.pid)


@pytest.mark.parametrize("sleep", [0.2, 3600])
def test_sigterm_with_jobs_running(sleep: float) -> None:
    with server(*fake_server(sleep=sleep)) as (process, address), client(address) as http:
        body = {"sensor": SENSOR, "scene": {}, "frames": FRAMES}
        for _ in range(4):
            assert http.post("/v1/posteriors", json=body).status_code == 202
        while len(workers := children(process.pid)) < 2:
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        assert end(process.pid, *workers)


def test_workers_end_with_a_killed_server(tmp_path: Path) -> None:
    """At once, in the middle of what they compute."""
    mark = tmp_path / "mark"
    with server(*fake_server(outlive=str(mark))) as (process, address), client(address) as http:
        body = {"sensor": SENSOR, "scene": {}, "frames": FRAMES}
        assert http.post("/v1/posteriors", json=body).status_code == 202
        while not mark.with_suffix(".begun").exists():
            time.sleep(0.05)
        workers = children(process.pid)
        process.kill()
        process.wait()
        assert end(*workers)
    assert not mark.exists()


def test_large_body_is_refused_over_a_socket() -> None:
    with server(*fake_server(1000)) as (_, address), client(address) as http:
        response = http.post("/v1/estimates", content=b" " * 1001, headers=JSON)
        assert response.status_code == 413
        assert response.headers["content-type"] == "application/problem+json"


def test_health_answers_while_a_large_batch_is_worked_on() -> None:
    columns: dict[str, Any] = {"w1": [0.02] * 200_000, "w2": [1.7] * 200_000}
    content = json.dumps({"sensor": SENSOR, "scene": SCENE, "frames": columns}).encode()
    with server(*hybridtof("serve", "--port", "0")) as (_, address), client(address) as http:
        with ThreadPoolExecutor(1) as threads:
            batch = threads.submit(http.post, "/v1/estimates", content=content, headers=JSON)
            answered = 0
            while not batch.done():
                assert http.get("/health/live").status_code == 200
                answered += 1
            assert batch.result().status_code == 200
        assert answered > 1


def test_ctrl_c_ends_an_inference(tmp_path: Path) -> None:
    (tmp_path / "scene.json").write_text(json.dumps({"sensor": SENSOR, "scene": {}}))
    (tmp_path / "frames.json").write_text(json.dumps(FRAMES))
    command = hybridtof("infer", str(tmp_path / "frames.json"), "--scene",
                        str(tmp_path / "scene.json"), "--target-ess", "1000000")  # fmt: skip
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        # tests that run in the background hand down a signal that is ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        while not (workers := children(process.pid)) and process.poll() is None:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        assert end(process.pid, *workers)
        out, err = process.communicate()
    assert process.returncode == 128 + signal.SIGINT, err
    assert out == ""
    assert err.endswith("hybridtof: interrupted\n")
    assert "Traceback" not in err


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_reader_that_goes_away(tmp_path: Path, unbuffered: str) -> None:
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps({"sensor": SENSOR, "scene": SCENE}))
    command = hybridtof("simulate", "--scene", str(scene), "--from-m", "0.1", "--to-m", "1",
                        "--frames", "100000")  # fmt: skip
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(PYTHONUNBUFFERED=unbuffered),
    )
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.read(10) == '{"frames":'
    process.stdout.close()
    assert end(process.pid)
    assert process.wait() == 128 + signal.SIGPIPE
    assert process.stderr.read() == ""
    process.stderr.close()


def test_track_answers_a_line_before_the_next_is_there(tmp_path: Path) -> None:
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps({"sensor": SENSOR, "scene": SCENE}))
    with subprocess.Popen(
        hybridtof("track", "-", "--scene", str(scene)),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment(),
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for sequence in (1, 2):
            frame = {"time_s": 0.1 * sequence, "w1": 0.02, "w2": 1.7}
            process.stdin.write(json.dumps(frame) + "\n")
            process.stdin.flush()
            assert json.loads(process.stdout.readline())["sequence"] == sequence
        process.stdin.close()
        assert process.wait() == 0
