"""How long lines of a stream wait for one another where there is no machine code yet.

    python -m benchmarks.waiting_lines [--lines 700] [--inline]

One process on an empty kernel cache tracks frames one by one and learns crosstalk, as a service
does: machine code is made beside it. Baseline: compiling in line with the frames (``--inline``).
Waits are by the clock, and grow with what else the machine does: run both in turn. The digest is
that of all ranges, which are the same to the last bit.
"""

import argparse
import contextlib
import hashlib
import json
import os
import tempfile
import time

import numpy as np

from benchmarks.streams import OBJECT, SENSOR, lines_of
from simulator.compiled import while_compiling


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lines", type=int, default=700)
    parser.add_argument("--inline", action="store_true", help="as one process by itself does")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        _tracked(args.lines, contextlib.nullcontext() if args.inline else while_compiling())


def _tracked(count: int, way: contextlib.AbstractContextManager[None]) -> None:
    from inference.tracking.track import step
    from inference.tracking.tracker import tracker
    from simulator.frames import frames_from_columns
    from simulator.scene import parse_scene
    from simulator.sensor import parse_sensor

    sensor = parse_sensor(SENSOR)
    unknown = {"prior": "normal", "mean": 0.0, "sd": 0.01}
    scene = parse_scene({"object": OBJECT, "crosstalk": [unknown, unknown]})
    frames = frames_from_columns(sensor, _columns(count))
    waits, ranges = np.zeros(count), np.zeros(count)
    with way:
        model = tracker(sensor, scene)
        state = model.first
        for k in range(count):
            began = time.perf_counter()
            state, track = step(model, state, frames.select(slice(k, k + 1)))
            waits[k], ranges[k] = time.perf_counter() - began, track.best_m[0]
    print(f"longest wait {waits.max():.2f} s, at line {int(waits.argmax()) + 1}")
    print(f"median of the first 100 lines {np.median(waits[:100]):.3f} s, of the last "
          f"{np.median(waits[-100:]):.5f} s")  # fmt: skip
    print(f"processor time {time.process_time():.1f} s")
    print(f"digest of the ranges {hashlib.sha256(ranges.tobytes()).hexdigest()[:16]}")


def _columns(count: int) -> dict[str, list[float]]:
    rows = [json.loads(line) for line in lines_of(count)]
    return {name: [row[name] for row in rows] for name in ("time_s", "w1", "w2")}


if __name__ == "__main__":
    main()
