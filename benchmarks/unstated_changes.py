"""How soon a stream that calibrates itself notices a change that nobody stated, and how small.

    python -m benchmarks.unstated_changes [--courses 40]

The object, sensor and path of `benchmarks.self_calibration`, crosstalk known to two fifths of
itself that walks by 1 % in the root of a second, and at a random phase of the path shifts at once.
Looks are taken at the last ten seconds once a second, as a stream takes them. Of each size: the
share of courses in which the change is noticed, how long after it (median, nine in ten, longest),
and the looks before it that noticed one; and of all, processor time a look.
"""

import argparse
import time

import numpy as np

from benchmarks.self_calibration import CROSSTALK, HZ, OBJECT, SETTINGS, sensor_of
from inference.self_calibration.change import has_changed
from inference.tracking.tracker import tracker
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

_SIZES = (0.4, 0.2, 0.1)
_N, _AT, _WINDOW, _WALK, _KNOWN = 30 * HZ, 11 * HZ, 10 * HZ, 0.01, 0.4


def delay_s(share: float, seed: int, spent: list[float]) -> float:
    """Return how long after a change it is noticed [s]; negative before it, nan never.

    What each look took is appended to ``spent`` [s of processor time].
    """
    rng = np.random.default_rng(seed)
    sensor, size, t = sensor_of(), np.array(CROSSTALK), np.arange(_N) / HZ
    turns = 2 * np.pi * (t / 17.3 + rng.random())
    range_m = np.exp(np.log(0.67) + np.log(1.5 / 0.67) * np.sin(turns))
    path = SampledTrajectory(range_m=range_m.tolist(), time_s=t.tolist())
    truth = simulate(sensor, parse_scene({"object": OBJECT}), path, seed)
    level = 1.0 + _WALK / np.sqrt(HZ) * np.cumsum(rng.standard_normal(_N))
    level[_AT:] += share
    frames = Frames(truth.frames.readings + level[:, None] * size, t)
    names = ["crosstalk.w1", "crosstalk.w2"]
    mode = {"mean": [0.0, 0.0], "covariance": [[1.0, 0.0], [0.0, 1.0]]}
    priors = [{"prior": "normal", "mean": m, "sd": _KNOWN * m} for m in CROSSTALK]
    scene = parse_scene(
        {
            "object": OBJECT,
            "crosstalk": priors,
            "range_m": {"prior": "loguniform", "low": 0.1, "high": 5.0},
            "joint": {"unknowns": names, "modes": [mode]},
        }
    )
    model, every = tracker(sensor, scene, SETTINGS), np.ones(_WINDOW, dtype=bool)
    walk = _WALK * np.sqrt(_WINDOW / HZ / 2) * size
    for end in range(_WINDOW, _N + 1, HZ):
        last = frames.select(slice(end - _WINDOW, end))
        begun = time.process_time()
        changed = has_changed(model, last, every, walk, 0.9 * size)
        spent.append(time.process_time() - begun)
        if changed:
            return (end - _AT) / HZ
    return float("nan")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--courses", type=int, default=40)
    courses = parser.parse_args().courses
    spent: list[float] = []
    for share in _SIZES:
        delays = np.array([delay_s(share, seed, spent) for seed in range(courses)])
        seen = delays[delays > 0]
        told = "" if not seen.size else (
            f", after {np.median(seen):.1f} s, {np.quantile(seen, 0.9):.1f} s, {seen.max():.1f} s"
        )  # fmt: skip
        early = int((delays <= 0).sum())
        print(
            f"{share:.0%} of the crosstalk: noticed {seen.size / courses:.0%}{told}; {early} early"
        )
    print(f"{1e3 * float(np.median(spent)):.1f} ms of processor time a look")


if __name__ == "__main__":
    main()
