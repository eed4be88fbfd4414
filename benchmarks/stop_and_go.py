"""Tracks whose crosstalk is learnt, on paths that the rate's law does not foresee.

    python -m benchmarks.stop_and_go [--tracks 40] [--paths stops jumps] [--rate-sd 1.0]

The object's numbers are known and exact, crosstalk is within a law of a hundred read noises or
more, half of it in the mean, no frame is empty, and no other setting is stated. 600 frames of 20 s;
both ends of a path are drawn between 0.35 and 1.4 m. A track is lost in silence where five frames
or more of one range, without `misfit`, are more than five standard deviations off.
"""

import argparse
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import track
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["PATHS", "SENSORS", "Lost", "tracked"]

Array = NDArray[np.float64]

OBJECT = {"c0": 0.06, "c1": 0.05, "c2": 0.09}
UNKNOWN_BY = 0.01
SENSORS = {
    "pulsed": parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 2e-8, "noise": {"read": [3e-5, 6e-5]}}
    ),
    "sine_wave": parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [5e-5, 5e-5]}}
    ),
}
_TIMES = np.arange(600) / 30.0
_NEAREST, _FARTHEST = 0.3, 1.6


def _stops(moving_s: float) -> Callable[[Array, Array, np.random.Generator], Array]:
    """Return a path that rests for two seconds at either end, or less by what it moves."""

    def path(low: Array, high: Array, _: np.random.Generator) -> Array:
        phase = _TIMES % 4.0
        gone = np.clip(phase / moving_s, 0.0, 1.0) - np.clip((phase - 2.0) / moving_s, 0.0, 1.0)
        return np.asarray(low + (high - low) * (1.0 - np.cos(np.pi * gone)) / 2.0)

    return path


def _jumps(low: Array, high: Array, _: np.random.Generator) -> Array:
    return np.where(_TIMES % 4.0 < 2.0, low, high)


def _swings(low: Array, high: Array, rng: np.random.Generator) -> Array:
    turns = _TIMES / rng.uniform(2.0, 8.0)
    return np.asarray(0.5 * (low + high) + 0.5 * (high - low) * np.sin(2.0 * np.pi * turns))


def _slow(low: Array, high: Array, _: np.random.Generator) -> Array:
    return np.asarray(0.5 * (low + high) + 0.5 * (high - low) * np.sin(2.0 * np.pi * _TIMES / 40))


def _rests(_: Array, __: Array, rng: np.random.Generator) -> Array:
    return np.full(_TIMES.size, np.log(rng.uniform(0.4, 1.2)))


def _starts_late(low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Rest for five seconds, move within two, and rest again."""
    begin, end = (low, high) if rng.random() < 0.5 else (high, low)
    return begin + (end - begin) * np.clip((_TIMES - 5.0) / 2.0, 0.0, 1.0)


def _as_stated(_: Array, __: Array, rng: np.random.Generator) -> Array:
    """Follow the law of the rate by its default, turned back at both ends of the span."""
    u, rate, path = np.log(0.7), rng.normal(), []
    for _time in _TIMES:
        path.append(u)
        rate += -rate / 30.0 + np.sqrt(2.0 / 30.0) * rng.normal()
        u += rate / 30.0
        for end, side in ((np.log(_NEAREST), 1.0), (np.log(_FARTHEST), -1.0)):
            if side * (u - end) < 0.0:
                u, rate = 2.0 * end - u, -rate
    return np.array(path)


PATHS: dict[str, Callable[[Array, Array, np.random.Generator], Array]] = {
    "stops": _stops(0.3),
    "slow stops": _stops(1.0),
    "jumps": _jumps,
    "swings": _swings,
    "slow": _slow,
    "rests": _rests,
    "starts late": _starts_late,
    "as stated": _as_stated,
}


class Lost(NamedTuple):
    """What a track came to."""

    silent: int  # frames of one range, without misfit, beyond five standard deviations
    farthest: float  # standard deviations, of frames without misfit
    held: float  # share of the 90 % intervals that hold the range; nan where no frame has one
    answered: float  # share of frames with one range
    width: float  # standard deviation of the range, relative, in the middle


def tracked(sensor: Sensor, path: str, seed: int, rate_sd: float = 1.0) -> Lost:
    """Track an object on a path, and compare with where it was."""
    rng = np.random.default_rng([seed, 7])
    low, high = np.log(np.sort(rng.uniform(0.35, 1.4, 2)))
    ranges = np.exp(PATHS[path](low, high, rng))
    crosstalk = (0.5 * UNKNOWN_BY * rng.standard_normal(2)).tolist()
    truth = parse_scene({"object": OBJECT, "crosstalk": crosstalk, "discrepancy": 0})
    way = SampledTrajectory(range_m=ranges.tolist(), time_s=_TIMES.tolist())
    prior = {"prior": "normal", "mean": 0.0, "sd": UNKNOWN_BY}
    scene = parse_scene({"object": OBJECT, "crosstalk": [prior, prior]})
    frames = simulate(sensor, truth, way, seed).frames
    found = track(sensor, scene, frames, TrackingSettings(rate_sd=rate_sd))
    off = np.abs(found.range_m - ranges) / found.sd_m
    told = np.isfinite(off)
    sure = off[told & ~found.misfit]
    if not told.any():
        return Lost(0, 0.0, np.nan, 0.0, np.nan)
    return Lost(
        int((sure > 5.0).sum()),
        float(sure.max(initial=0.0)),
        float((off[told] < 1.6449).mean()),
        float(told.mean()),
        float(np.median((found.sd_m / found.range_m)[told])),
    )


def main() -> None:
    """Print a line for every sensor and path."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracks", type=int, default=40)
    parser.add_argument("--rate-sd", type=float, default=1.0)
    parser.add_argument("--paths", nargs="+", default=list(PATHS), choices=list(PATHS))
    given = parser.parse_args()
    print("sensor     path         lost in silence  farthest  held of 90 %  answered  width")
    for kind, sensor in SENSORS.items():
        for path in given.paths:
            rows = [tracked(sensor, path, seed, given.rate_sd) for seed in range(given.tracks)]
            silent, farthest, held, answered, width = np.array(rows).T
            print(
                f"{kind:<10} {path:<11} {(silent >= 5).sum():>8} of {len(rows):<5}"
                f" {farthest.max():>8.1f}  {np.nanmean(held):>12.0%}  {answered.mean():>8.0%}"
                f"  {np.nanmedian(width):.2%}",
                flush=True,
            )


if __name__ == "__main__":
    main()
