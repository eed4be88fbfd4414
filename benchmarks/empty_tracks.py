"""The tracker: how often an empty scene whose crosstalk is off gets a range, or a faint object.

    python -m benchmarks.empty_tracks [--tracks 4]

`range_m` is left out, so that an object may be as far, and as faint, as a track likes. Tracks of
600 frames at 30 Hz of a plate; light and offsets in units of the noise of a frame; a law of the
crosstalk is normal, and its offset in its standard deviations.
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
TIMES = np.arange(FRAMES) / 30.0


def answered(sensor: Sensor, scene: dict[str, Any], light: Array, seed: int) -> tuple[float, float]:
    """Share of frames with one range, and the mean probability of an object."""
    rng = np.random.default_rng([seed, 3])
    readings = CROSSTALK + light + NOISE * rng.standard_normal((FRAMES, 2))
    found = track(sensor, parse_scene(scene), frames_of(readings, 1 / 30))
    return float((found.status == Status.UNIQUE).mean()), float(found.present.mean())


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


def line(name: str, results: list[tuple[float, float]]) -> None:
    one, present = np.array(results).T
    text = f"one range {one.mean():6.1%}, at most {one.max():6.1%}; present {present.mean():.2f}"
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


if __name__ == "__main__":
    main()
