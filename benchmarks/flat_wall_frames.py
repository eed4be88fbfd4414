"""What fits over many frames and posteriors hold before a flat wall.

    python -m benchmarks.flat_wall_frames [--sets 6] [--first 0] [--ways joint_fit infer]
        [--discrepancy JSON]

The disks, walls and emitters of `benchmarks.flat_wall`, 30 frames evenly spread in log r. What is
told, in turn: the object and its shadow as the numbers that fit best and the wall's strength to a
factor exp(0.5); nothing of the object, of the shadow that it is up to metres wide; nothing of
either; of the shadow that, and crosstalk that is known to three tenths of the signal. The wall's
distance is known.

A line for each way and what is told: sets, answered, those that say misfit (or have not converged),
frames of the others with one range, the share that 90 % intervals hold, frames beyond 5 standard
deviations, the median standard deviation over the range, and processor seconds a set.
"""

import argparse
import json
import time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import flat_wall
from benchmarks.coverage.classes import SHADOW
from benchmarks.sampling import sample
from inference.estimate import estimate
from inference.estimates import Status
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

__all__ = ["TOLD", "WAYS", "answered", "set_of"]

Array = NDArray[np.float64]

FRAMES = 30
TOLD = ("numbers", "nothing", "default", "crosstalk")
WAYS = ("joint_fit", "infer")


class Set(NamedTuple):
    """What is stated and read, and the truth."""

    sensor: Sensor
    scene: dict[str, Any]
    frames: Frames
    truth: Array


def set_of(number: int, told: str) -> Set:
    """Return frames of a disk before a flat wall, and what is told of them."""
    rng = np.random.default_rng([number, 3])
    course = flat_wall.course_of(number, rng)
    shadow, _, _, numbers = flat_wall.fitted_of(course)
    low, high = course.grid[[0, -1]].tolist()
    way = np.exp(rng.uniform(np.log(low), np.log(high), FRAMES))
    course = course._replace(way=way)
    paths, light = flat_wall.moments_of(way, course.radius, course.power)
    readings, truth = flat_wall.read_of(course.kind, paths, course.albedo * light)
    bare, distance, _ = flat_wall.bare_of(course)
    size = float(np.median(np.hypot(*readings.T)))
    pulsed = course.kind["kind"] == "pulsed"
    strength = float(bare[1] if pulsed else np.hypot(*bare))
    median = strength * float(np.exp(0.5 * rng.standard_normal()))
    wall: dict[str, Any] = {
        "strength": {"prior": "lognormal", "median": median, "sigma": 0.5},
        "distance_m": distance,
        "shadow": dict(SHADOW),
    }
    scene: dict[str, Any] = {"background": wall}
    if told == "numbers":
        scene |= {"object": numbers, "background": {**wall, "shadow": shadow}}
    if told == "default":
        del wall["shadow"]
    readings = readings + bare - flat_wall.hidden_of(course, way)[0]
    if told == "crosstalk":
        readings = readings + 0.1 * size * rng.standard_normal(2)
        scene["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": 0.3 * size}] * 2
    readings = readings + course.noise * rng.standard_normal(readings.shape)
    sensor = parse_sensor({**course.kind, "noise": {"read": [course.noise, course.noise]}})
    return Set(sensor, scene, Frames(readings), truth)


class Answered(NamedTuple):
    """How far ranges are off in standard deviations, whether 90 % hold them, and relative sds."""

    off: Array
    held: NDArray[np.bool_]
    sd: Array
    flagged: bool


def answered(given: Set, way: str, seed: int) -> Answered | None:
    """Ask a fit or a posterior; None where it refuses."""
    try:
        if way == "infer":
            return _inferred(given, seed)
        found = estimate(given.sensor, parse_scene(given.scene), given.frames, [way]).results
    except RefusedError:
        return None
    if not found:
        return None
    said, fit = found[0], found[0].fit
    if fit is None:
        return None
    one = (said.status == Status.UNIQUE) & np.isfinite(said.sd_m) & ~said.near_fold
    off, sd = np.abs(said.range_m - given.truth)[one], said.sd_m[one]
    held = np.asarray(off < flat_wall.HELD * sd)
    return Answered(off / sd, held, sd / given.truth[one], bool(fit["misfit"]))


def _inferred(given: Set, seed: int) -> Answered:
    settings = SamplerSettings(ensembles=2, seed=seed, target_ess=200, method="auto")
    scene = parse_scene(given.scene)
    said = sample(given.sensor, scene, given.frames, settings, every_gate=False).posterior
    low, middle, high = said.range_m.q05, said.range_m.q50, said.range_m.q95
    sd = (high - low) / (2 * flat_wall.HELD)
    held = np.asarray((low <= given.truth) & (given.truth <= high))
    flagged = bool(said.fit.misfit) or not said.verdict.converged
    return Answered(np.abs(middle - given.truth) / sd, held, sd / given.truth, flagged)


def line(way: str, told: str, numbers: range, discrepancy: object) -> str:
    """Return a line of the table."""
    found: list[Answered] = []
    start = time.process_time()
    for number in numbers:
        given = set_of(number, told)
        if discrepancy is not None:
            given.scene["discrepancy"] = discrepancy
        said = answered(given, way, number)
        if said is not None:
            found.append(said)
    spent = (time.process_time() - start) / len(numbers)
    sure = [said for said in found if not said.flagged]
    head = f"| {way} | {told} | {len(numbers)} | {len(found)} | {len(found) - len(sure)} |"
    if not sure:
        return f"{head} | | | | {spent:.1f} s |"
    off, held, sd = (np.concatenate([said[i] for said in sure]) for i in range(3))
    share, width = f"{100 * held.mean():.0f} %", f"{100 * np.median(sd):.2f} %"
    return f"{head} {off.size} | {share} | {int((off > 5).sum())} | {width} | {spent:.1f} s |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=6)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--ways", nargs="*", default=list(WAYS), choices=WAYS)
    parser.add_argument("--told", nargs="*", default=list(TOLD), choices=TOLD)
    parser.add_argument("--discrepancy", type=json.loads, help="what the scene states of it")
    given = parser.parse_args()
    print("| way | told | sets | answered | flagged | ranges | held | beyond 5 sd | sd | time |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    numbers = range(given.first, given.first + given.sets)
    for way in given.ways:
        for told in given.told:
            print(line(way, told, numbers, given.discrepancy), flush=True)


if __name__ == "__main__":
    main()
