"""Streams over HTTP under load, and under kill -9.

    python -m benchmarks.streams             200 open streams, batches of 1,000: frames/s, memory
    python -m benchmarks.streams --deaf      clients that send and never read: memory, others' time
    python -m benchmarks.streams --kills 50  the service is killed during 4 streams

The service is one process of its own; the clients are another. After kills no line may be lost,
none applied twice, and the answers must be those of an undisturbed run, byte for byte but for
``latency_s``.
"""

import argparse
import asyncio
import contextlib
import json
import os
import random
import socket
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from benchmarks.fleet import SERVE, Service
from benchmarks.manners import memory_mb

NDJSON = {"Content-Type": "application/x-ndjson"}
SENSOR = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [8e-5, 8e-5]}}
OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}


def system(discrepancy: Any = 0) -> dict[str, Any]:
    """Return a stream's request."""
    return {"sensor": SENSOR, "scene": {"object": OBJECT, "discrepancy": discrepancy}}


def lines_of(count: int, seed: int = 1) -> list[bytes]:
    """Return frames of an object that comes and goes at 30 Hz, a line each."""
    c0, c1, c2 = OBJECT.values()
    rng = np.random.default_rng(seed)
    time_s = np.arange(count) / 30.0
    r = 0.7 + 0.3 * np.sin(0.5 * time_s + seed)
    w2 = c0 * c2 / (r**2 * (r**2 + c1 * r + c0))
    read = SENSOR["noise"]["read"]  # type: ignore[index]
    w1 = w2 * r / 14.99 + rng.normal(0.0, read[0], count)
    w2 = w2 + rng.normal(0.0, read[1], count)
    columns = zip(time_s.tolist(), w1.tolist(), w2.tolist(), strict=True)
    return [
        json.dumps({"sequence": n, "time_s": t, "w1": a, "w2": b}).encode()
        for n, (t, a, b) in enumerate(columns, start=1)
    ]


def processor_s(pid: int) -> float:
    """Return the processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Client:
    """A connection that is kept open, with as little work as can be."""

    def __init__(self, address: str, path: str) -> None:
        self._host, self._path = address.removeprefix("http://"), path

    async def open(self) -> "Client":
        host, _, port = self._host.rpartition(":")
        self._reader, self._writer = await asyncio.open_connection(host, int(port), limit=2**20)
        return self

    async def batch(self, body: bytes) -> int:
        """Send lines, read their answers; how many there were."""
        head = (
            f"POST {self._path} HTTP/1.1\r\nHost: {self._host}\r\n"
            f"Content-Type: application/x-ndjson\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        self._writer.write(head.encode() + body)
        status = await self._reader.readline()
        assert b" 200 " in status, status
        await self._reader.readuntil(b"\r\n\r\n")
        answers = 0
        while size := int(await self._reader.readline(), 16):
            answers += (await self._reader.readexactly(size)).count(b"\n")
            await self._reader.readline()
        await self._reader.readline()
        return answers

    def close(self) -> None:
        self._writer.close()


@contextlib.contextmanager
def serving(database: str) -> Iterator[Service]:
    """A service in a process of its own, killed at the end."""
    service = Service(SERVE, {"HYBRIDTOF_DATABASE": database})
    try:
        yield service
    finally:
        service.kill()


def opened(address: str, body: Any, count: int) -> list[str]:
    """Make streams; their paths for frames."""
    with httpx.Client(base_url=address, timeout=60) as http:
        made = [http.post("/v1/streams", json=body) for _ in range(count)]
    assert all(response.status_code == 201 for response in made), made[0].text
    return [response.headers["Location"] + "/frames" for response in made]


def load(streams: int, batches: int, size: int, discrepancy: Any, database: str) -> dict[str, Any]:
    """Send batches on many streams at once; frames a second, and the time of a batch."""
    every = lines_of(size * (batches + 1))
    bodies = [b"\n".join(every[k * size : (k + 1) * size]) for k in range(batches + 1)]
    times: list[float] = []

    async def send(address: str, path: str) -> int:
        answered, client = 0, await Client(address, path).open()
        for body in bodies[1:]:
            begun = time.perf_counter()
            answered += await client.batch(body)
            times.append(time.perf_counter() - begun)
        client.close()
        return answered

    async def run(address: str, paths: Sequence[str], pid: int) -> tuple[int, float, float]:
        first = await Client(address, paths[0]).open()  # waits for the compiler
        await first.batch(bodies[0])
        first.close()
        begun, used = time.perf_counter(), processor_s(pid)
        # a connection without a request is closed after a while, so that each sends at once
        answered = sum(await asyncio.gather(*(send(address, path) for path in paths)))
        return answered, time.perf_counter() - begun, processor_s(pid) - used

    with serving(database) as service:
        paths = opened(service.address, system(discrepancy), streams)
        before = memory_mb(service.process.pid)
        pid = service.process.pid
        answered, seconds, used = asyncio.run(run(service.address, paths, pid))
        after = memory_mb(service.process.pid)
    return {
        "streams": streams,
        "frames": answered,
        "frames_per_s": round(answered / seconds),
        "processor_us_a_frame": round(used / answered * 1e6, 2),
        "batch_median_s": round(statistics.median(times), 3),
        "batch_worst_s": round(max(times), 3),
        "memory_mb": [round(before), round(after)],
    }


def deaf(streams: int, seconds: float, database: str) -> dict[str, Any]:
    """Clients that send without end and read nothing, beside one that reads."""
    data = b"\n".join(lines_of(200_000)) + b"\n"
    block = 2**14
    with serving(database) as service:
        *paths, own = opened(service.address, system(), streams + 1)
        host, _, port = service.address.removeprefix("http://").rpartition(":")
        before = memory_mb(service.process.pid)
        ending = threading.Event()
        sent = [0] * streams

        def send(index: int) -> None:
            with socket.create_connection((host, int(port))) as deaf_one:
                deaf_one.sendall(
                    f"POST {paths[index]} HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Type: "
                    "application/x-ndjson\r\nTransfer-Encoding: chunked\r\n\r\n".encode()
                )
                deaf_one.settimeout(1.0)
                with contextlib.suppress(OSError):
                    for start in range(0, len(data), block):
                        part = data[start : start + block]
                        deaf_one.sendall(f"{len(part):x}\r\n".encode() + part + b"\r\n")
                        sent[index] += len(part)
                        if ending.is_set():
                            return
                ending.wait()

        threads = [threading.Thread(target=send, args=(k,)) for k in range(streams)]
        for thread in threads:
            thread.start()
        most, waited = before, []
        lines = lines_of(10_000, seed=2)
        end = time.monotonic() + seconds
        with httpx.Client(base_url=service.address, timeout=60) as http:
            for line in lines:
                begun = time.perf_counter()
                assert http.post(own, content=line, headers=NDJSON).status_code == 200
                waited.append(time.perf_counter() - begun)
                most = max(most, memory_mb(service.process.pid))
                if time.monotonic() > end:
                    break
        ending.set()
        for thread in threads:
            thread.join()
        after = memory_mb(service.process.pid)
    return {
        "deaf": streams,
        "sent_mb": round(sum(sent) / 1e6),
        "memory_mb": {"before": round(before), "most": round(most), "after": round(after)},
        "other_client_s": {
            "median": round(statistics.median(waited), 4),
            "worst": round(max(waited), 3),
        },
    }


def plain(answer: bytes) -> dict[str, Any]:
    """Return an answer without the one member that no two runs share."""
    found: dict[str, Any] = json.loads(answer)
    found.pop("latency_s", None)
    return found


def survived(
    database: str,
    lines: Sequence[Sequence[bytes]],
    size: int,
    kills: int,
    rng: random.Random,
    command: Sequence[str] = SERVE,
    *,
    body: Any = None,
    pace_s: float = 0.0,
) -> tuple[list[list[dict[str, Any]]], int]:
    """Send streams while the service is killed; each one's answers, and how often it was.

    It is killed whenever some more lines were answered, at random how many. Every client sends
    again what it has no answer to. Each line must be answered once, and what comes again must be
    the same as before. ``body`` makes the streams; each waits ``pace_s`` between batches.
    """
    running = [Service(command, {"HYBRIDTOF_DATABASE": database})]
    paths = opened(running[0].address, body or system(), len(lines))
    answers: list[dict[int, dict[str, Any]]] = [{} for _ in lines]
    problems: list[str] = []
    left = threading.Semaphore(0)

    def send(index: int) -> None:
        at = 0
        while at < len(lines[index]):
            batch = lines[index][at : at + size]
            got = b""
            service = running[0]
            if not service.alive:
                time.sleep(0.02)
                continue
            with contextlib.suppress(httpx.HTTPError):
                address = service.address + paths[index]
                content = b"\n".join(batch)
                with httpx.stream(
                    "POST", address, content=content, headers=NDJSON, timeout=60
                ) as response:
                    if response.status_code not in (200, 503, 409):
                        said = response.read().decode(errors="replace")
                        problems.append(f"{address}: {response.status_code} {said}")
                    if response.status_code == 200:
                        for part in response.iter_raw():
                            got += part
            *whole, _ = got.split(b"\n")
            for line in whole:
                answer = plain(line)
                number = answer["sequence"]
                if number is None:
                    break
                if answers[index].setdefault(number, answer) != answer:
                    problems.append(f"stream {index}, line {number} was answered differently")
                at = max(at, number)
            time.sleep(pace_s if whole else 0.02)
        left.release()

    threads = [threading.Thread(target=send, args=(k,)) for k in range(len(lines))]
    for thread in threads:
        thread.start()
    killed, mean = 0, sum(map(len, lines)) // (kills + 1)
    try:
        for _ in range(kills):
            further = sum(map(len, answers)) + rng.randrange(1, mean)
            while sum(map(len, answers)) < further and any(t.is_alive() for t in threads):
                time.sleep(0.005)
            if not any(thread.is_alive() for thread in threads):
                break
            running[0].kill()
            running[0] = Service(command, {"HYBRIDTOF_DATABASE": database})
            killed += 1
        for thread in threads:
            thread.join()
        with httpx.Client(base_url=running[0].address, timeout=60) as http:
            for path, sent in zip(paths, lines, strict=True):
                found = http.get(path.removesuffix("/frames")).json()
                if (found["answered"], found["sequence"]) != (len(sent), len(sent)):
                    problems.append(f"{found['answered']} applied of {len(sent)}")
    finally:
        running[0].kill()
    if problems:
        raise RuntimeError("; ".join(problems[:5]))
    return [[found[number] for number in sorted(found)] for found in answers], killed


def kills(count: int, seed: int, folder: str) -> dict[str, Any]:
    """Kill the service during 4 streams, and compare with a run that nobody disturbs."""
    rng = random.Random(seed)
    lines = [lines_of(10_000, seed=k) for k in range(4)]
    expected, _ = survived(f"sqlite:///{folder}/quiet.sqlite", lines, 100, 0, rng)
    found, killed = survived(f"sqlite:///{folder}/killed.sqlite", lines, 100, count, rng)
    same = sum(one == other for one, other in zip(found, expected, strict=True))
    return {"streams": 4, "lines": 40_000, "kills": killed, "identical": same}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--streams", type=int, default=200)
    parser.add_argument("--batches", type=int, default=10)
    parser.add_argument("--size", type=int, default=1000)
    parser.add_argument("--default-errors", action="store_true", help="with errors of the model")
    parser.add_argument("--deaf", action="store_true")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        database = f"sqlite:///{folder}/streams.sqlite"
        if args.kills:
            result = kills(args.kills, args.seed, folder)
        elif args.deaf:
            result = deaf(args.streams, args.seconds, database)
        else:
            errors = "default" if args.default_errors else 0
            result = load(args.streams, args.batches, args.size, errors, database)
    print(json.dumps(result))
    sys.exit("identical" in result and result["identical"] != 4)


if __name__ == "__main__":
    main()
