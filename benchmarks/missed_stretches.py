"""How long intervals miss where everything is as a stream believes.

    python -m benchmarks.missed_stretches [--draws 100] [--seeds 1] [--cold] [--erring]

What is wrong with the law of a scene is wrong in all frames alike, so that 90 % intervals which
hold exactly as often as they say miss in stretches. For every calibration that a stream of
`benchmarks.self_calibration` takes, scenes are drawn from the law that it took over. Of each the
path of that benchmark is simulated, from then on until the next calibration or for two ways to and
fro, and tracked under that law: nothing drifts and nothing changes, and the truth is a draw of what
is believed. With `--erring` the object of the course errs from its model, and so do those that are
drawn, by what the tracker supposes to be left once a scene was calibrated.

The longest such stretch of the course itself, then a line a calibration: the share of draws in
which the longest stretch without an interval that holds is longer than a second, and at least as
long as that of the course; the 90 % quantile of its length; the share of intervals that hold; and
the 90 % quantile of how far the frames of the longest stretch are off at most. Then the chance that
a course has a stretch longer than a second, and one as long as its own, the laws of its
calibrations being independent.
"""

import argparse
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.self_calibration import (
    HZ,
    SETTINGS,
    STATED,
    course,
    figures,
    followed,
    longest_s,
    sensor_of,
    where_longest,
)
from inference.estimates import Status
from inference.self_calibration.plan import Plan, plan_of
from inference.tracking.track import step
from simulator.frames import Frames
from simulator.model_error import ModelError
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.simulate import erring_readings

Array = NDArray[np.float64]

_Z = 1.6448536269514722  # of a 90 % interval
_LONG_S = 1.0
_MOST_S = 34.6  # two ways to and fro
_SETTLING = 90  # frames that a new tracker sees before it is asked


class Missed(NamedTuple):
    """How intervals missed under one law."""

    longest: Array  # longest stretch of each draw [s]
    held: float  # share of intervals that held
    off: float  # 90 % quantile of the largest error in the longest stretch [sd]


def drawn(
    plan: Plan, law: Scene, ranges: Array, draws: int, seed: int, erring: bool = False
) -> Missed:
    """Draw scenes from a law, and track the path of each under that law.

    Parameters
    ----------
    plan : Plan
        The stream.
    law : Scene
        What it knows.
    ranges : ndarray, shape (n,)
        The path, `HZ` frames a second [m].
    draws, seed : int
        How many, and of what.
    erring : bool
        Whether objects err from their model.
    """
    rng = np.random.default_rng(seed)
    parameters = parameters_of(plan.sensor, law)
    model = plan.tracker(law)
    noise = np.asarray(plan.sensor.noise.read)
    times = np.arange(ranges.size) / HZ
    wrong = law.model_error.beside_numbers() if erring else ModelError(0.0, 0.0, integrated=False)
    longest, held, off = [], [], []
    for z in parameters.sample(rng, draws):
        mean = erring_readings(plan.sensor, parameters.terms(z[None]), ranges, wrong, rng)
        readings = mean + noise * rng.standard_normal(mean.shape)
        track = step(model, model.first, Frames(readings=readings, time_s=times))[1]
        asked = track.status == Status.UNIQUE
        asked[:_SETTLING] = False
        with np.errstate(invalid="ignore"):
            error = np.abs(track.range_m - ranges) / track.sd_m
            missed = asked & (error > _Z) & ~track.misfit
        longest.append(longest_s(missed))
        held.append(1.0 - missed[asked].mean() if asked.any() else np.nan)
        off.append(where_longest(missed, error)[1])
    return Missed(np.array(longest), float(np.nanmean(held)), float(np.quantile(off, 0.9)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--cold", action="store_true")
    parser.add_argument("--erring", action="store_true", help="objects that err from their model")
    args = parser.parse_args()
    for seed in range(args.seeds):
        of = course(600.0, seed, args.cold, args.erring)
        said = followed(of, seed)
        own = figures(of, said)
        print(f"{seed}: {own['missed s']:.2f} s, by {own['missed sd']:.2f} sd", flush=True)
        plan = plan_of(sensor_of(), parse_scene(STATED), SETTINGS, seed)
        report(plan, said.laws, args.draws, own["missed s"], args.erring)


def report(
    plan: Plan, laws: list[tuple[float, Scene]], draws: int, own_s: float, erring: bool
) -> None:
    """Print the lines of one course, whose own longest stretch is ``own_s``."""
    none = np.ones(2)
    ends = [since for since, _ in laws[1:]] + [600.0]
    for number, ((since, law), end) in enumerate(zip(laws, ends, strict=True)):
        t = since + np.arange(round(min(end - since, _MOST_S) * HZ)) / HZ
        path = np.exp(np.log(0.67) + np.log(1.5 / 0.67) * np.sin(2 * np.pi * t / 17.3))
        found = drawn(plan, law, path, draws, number, erring)
        second, own = np.mean(found.longest > _LONG_S), np.mean(found.longest >= own_s)
        none *= 1.0 - np.array([second, own])
        print(
            f"  from {since:.1f} s: longer than {_LONG_S:g} s in {second:.0%}, as long as the "
            f"course's in {own:.0%}, 90 % below {np.quantile(found.longest, 0.9):.2f} s, "
            f"held {found.held:.1%}, off by up to {found.off:.2f} sd",
            flush=True,
        )
    second, own = 1.0 - none
    print(f"a course has such a stretch with probability {second:.2f}, one as long {own:.2f}")


if __name__ == "__main__":
    main()
