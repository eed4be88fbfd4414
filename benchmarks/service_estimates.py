"""Cost of a batch over HTTP, part by part.

    python -m benchmarks.service_estimates --frames 1000000

Of each part also the longest time for which it let no other thread have the interpreter, as the
processor time between two turns of a thread that only looks at the clock. Baseline of the encoder:
one dictionary a frame through the standard library's encoder, in the same run (on a tenth of the
frames, scaled).
"""

import argparse
import json
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from inference.estimate import estimate
from inference.estimates import Status
from service.answers.encoding import encode_estimates
from service.checked_system import checked_frames
from service.requests import EstimateRequest
from service.strict_json import check_bulk, decode
from simulator.errors import InvalidInputError
from simulator.validated import parse

T = TypeVar("T")


class _Watch(threading.Thread):
    """Notes the longest time between two turns."""

    def __init__(self) -> None:
        super().__init__()
        self.longest_s, self.end = 0.0, threading.Event()

    def run(self) -> None:
        last = time.process_time()
        while not self.end.wait(0.0005):
            now = time.process_time()
            self.longest_s, last = max(self.longest_s, now - last), now


def timed(what: str, function: Callable[..., T], *arguments: Any) -> T:
    watch = _Watch()
    watch.start()
    start = time.perf_counter()
    result = function(*arguments)
    seconds = time.perf_counter() - start
    time.sleep(0.01)  # so that it has a last turn
    watch.end.set()
    watch.join()
    print(f"{what:<34}{seconds:9.3f} s, others wait {watch.longest_s:6.3f} s")
    return result


def refused(raw: bytes) -> None:
    try:
        check_bulk(decode(raw))
    except InvalidInputError:
        return
    raise AssertionError("it was taken")


def body(n: int) -> bytes:
    rng = np.random.default_rng(1)
    w2 = rng.uniform(0.5, 2.0, n)
    columns = {"w1": (w2 * rng.uniform(0, 1.01, n)).tolist(), "w2": w2.tolist()}
    sensor = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-3, 1e-3]}}
    request = {"sensor": sensor, "scene": {}, "frames": columns, "techniques": ["conventional"]}
    return json.dumps(request).encode()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1_000_000)
    n = parser.parse_args().frames
    small = parse(EstimateRequest, decode(body(10)))
    estimate(*checked_frames(small.sensor, small.scene, small.frames), small.techniques)

    raw = body(n)
    print(f"{n} frames, body of {len(raw) / 2**20:.1f} MiB")
    data = timed("decode", decode, raw)
    timed("check of long columns", check_bulk, data)
    request = timed("validate", parse, EstimateRequest, data)
    checked = timed("frames", checked_frames, request.sensor, request.scene, request.frames)
    estimates = timed("estimate (conventional)", estimate, *checked, request.techniques)
    text = timed("encode", encode_estimates, estimates)
    print(f"answer of {len(text) / 2**20:.1f} MiB")
    text = timed("encode, column by column", encode_estimates, estimates, "columns")
    print(f"answer of {len(text) / 2**20:.1f} MiB")
    wrong = raw.replace(b'"w2": [', b'"w2": [NaN, ')
    timed("refuse a body with NaN", refused, wrong)
    timed("refuse a body with a member twice", refused, raw[:-1] + b', "scene": {}}')

    tenth = checked[2].select(slice(n // 10))
    (result,) = estimate(checked[0], checked[1], tenth, request.techniques).results

    def one_dictionary_a_frame() -> str:
        frames = []
        for i in range(len(result)):
            roots = result.roots_m[i, : result.root_count[i]].tolist()
            unique = result.status[i] == Status.UNIQUE
            frames.append(
                {
                    "status": Status(int(result.status[i])).name.lower(),
                    "range_m": roots[0] if unique else None,
                    "sd_m": float(result.roots_sd_m[i, 0]) if unique else None,
                    "roots_m": roots,
                    "roots_sd_m": result.roots_sd_m[i, : result.root_count[i]].tolist(),
                    "near_fold": bool(result.near_fold[i]),
                    "reason": result.reasons[result.reason[i]],
                }
            )
        return json.dumps(frames)

    timed("one dictionary a frame, n / 10", one_dictionary_a_frame)


if __name__ == "__main__":
    main()
