"""The tracker: how often an empty scene whose crosstalk is off gets a range, or a faint object.

    python -m benchmarks.empty_tracks [--tracks 4]

`range_m` is left out, so that an object may be as far, and as faint, as a track likes. Tracks of
600 frames at 30 Hz of a plate; light and offsets in units of the noise of a frame; a law of the
crosstalk is normal, and its offset in its standard deviations. An object before a wall rests, and
its light is the change of the empty scene's. A frame is called free where `present` is below 5 %
and nothing says `outlier` or `misfit`.
"""

import argparse
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.track import track
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import Sensor
from simulator.simulate import mean_readings
from tests.posterior.scenes import KINDS, OBJECT
from tests.tracking.scenes import frames_of, sensor_of

Array = NDArray[np.float64]
NOISE, FRAMES = 1e-5, 600
CROSSTALK = np.array([0.3, 0.6])
LAW_SD = 0.35  # of the noise of a frame
WALL, DISTANCE_M = 50.0, 8.0  # light of the wall in units of the noise, and how far it stands
TIMES = np.arange(FRAMES) / 30.0


Answered = tuple[float, float, float]


def answered(sensor: Sensor, scene: dict[str, Any], light: Array, seed: int) -> Answered:
    """Share of frames with one range, mean probability of an object, share that is called free."""
    rng = np.random.default_rng([seed, 3])
    readings = CROSSTALK + light + NOISE * rng.standard_normal((FRAMES, 2))
    found = track(sensor, parse_scene(scene), frames_of(readings, 1 / 30))
    free = (found.present < 0.05) & (found.outlier < 0.5) & ~found.misfit
    return (
        float((found.status == Status.UNIQUE).mean()),
        float(found.present.mean()),
        float(free.mean()),
    )


def calibrated(sensor: Sensor) -> dict[str, Any]:
    """Return a scene whose crosstalk has a joint law."""
    priors = [{"prior": "normal", "mean": m, "sd": LAW_SD * NOISE} for m in CROSSTALK.tolist()]
    mode = {"mean": [0.0, 0.0], "covariance": [[1.0, 0.0], [0.0, 1.0]]}
    names = [f"crosstalk.{column}" for column in sensor.columns]
    return {
        "object": OBJECT,
        "crosstalk": priors,
        "joint": {"unknowns": names, "modes": [mode]},
    }


def line(name: str, results: list[Answered]) -> None:
    one, present, free = np.array(results).T
    text = f"one range {one.mean():6.1%}, at most {one.max():6.1%}; present {present.mean():.2f}"
    text += f"; free {free.mean():6.1%}"
    print(f"{name:48s} {text}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracks", type=int, default=4)
    seeds = range(parser.parse_args().tracks)
    for kind in sorted(KINDS):
        sensor = sensor_of(NOISE, kind)
        numbers = {"object": OBJECT, "crosstalk": CROSSTALK.tolist()}
        for name, scene, unit, offsets in (
            ("numbers off by noises", numbers, 1.0, (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)),
            ("law off by sd", calibrated(sensor), LAW_SD, (0.0, 1.0, 1.7, 2.5, 3.5)),
        ):
            for off in offsets:
                results = []
                for seed in seeds:
                    angle = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
                    light = off * unit * NOISE * np.array([np.cos(angle), np.sin(angle)])
                    results.append(answered(sensor, scene, light, seed))
                line(f"{kind}, empty, {name}: {off:g}", results)
        plate = parameters_of(sensor, parse_scene({"object": OBJECT})).terms(np.zeros((1, 0)))
        ranges = np.geomspace(0.5, 40.0, 4000)
        noises = np.hypot(*mean_readings(sensor, plate, ranges).T) / NOISE
        for wanted in (0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0):
            middle = ranges[np.abs(noises - wanted).argmin()]
            results = []
            for seed in seeds:
                way = middle * np.exp(0.1 * np.sin(1.5 * TIMES + seed))
                light = mean_readings(sensor, plate, way)
                results.append(answered(sensor, numbers, light, seed))
            line(f"{kind}, light of {wanted:g} noises, {middle:.1f} m", results)
        before_wall(kind, sensor, numbers, seeds)


def before_wall(kind: str, sensor: Sensor, numbers: dict[str, Any], seeds: range) -> None:
    """An object that rests where it changes the readings of a known wall by so many noises."""
    wall = {"strength": WALL * NOISE, "distance_m": DISTANCE_M, "shadow": {"c0": 0.075, "c1": 0.0}}
    scene = {**numbers, "background": wall}
    terms = parameters_of(sensor, parse_scene(scene)).terms(np.zeros((1, 0)))
    ranges = np.geomspace(0.3, DISTANCE_M, 4000)[:-1]
    bare = mean_readings(sensor, terms, np.array([np.inf]))[0]
    seen = mean_readings(sensor, terms, ranges)
    noises = np.hypot(*(seen - bare).T) / NOISE
    for wanted in (0.0, 0.3, 0.5, 0.8, 1.0, 1.5, 2.0, 3.0):
        nearest = np.flatnonzero(noises >= wanted)[-1]
        light = (bare if wanted == 0.0 else seen[nearest]) - CROSSTALK
        results = [answered(sensor, scene, np.asarray(light), seed) for seed in seeds]
        where = "empty" if wanted == 0.0 else f"at {ranges[nearest]:.1f} m"
        line(f"{kind}, wall, change of {wanted:g} noises, {where}", results)


if __name__ == "__main__":
    main()
