"""How often the search for optima finds what a climb from the truth finds.

    python -m benchmarks.optima_found [--sets 100] [--seed 42]

Data sets of 20 frames whose truth is drawn from the prior. One is missed where the best optimum of
the search lies more than 0.1 of log density below that of climbs that began at the truth.
"""

import argparse

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.posterior.sampling.start import climb, find_optima, refine
from simulator.frames import Frames
from simulator.readings import object_readings
from simulator.scene import parse_scene
from tests.posterior.scenes import KINDS, UNKNOWN_CROSSTALK, sensor_of

__all__ = ["missed"]

Array = NDArray[np.float64]

_FRAMES = 20


def _random_data(
    kind: str, crosstalk: bool, rng: np.random.Generator
) -> tuple[CollapsedDensity, Array]:
    """Frames of a truth drawn from the prior, and that truth."""
    sensor = sensor_of(kind)
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK} if crosstalk else {})
    density = collapsed_density(sensor, scene, Frames(np.ones((1, 2))))
    z = density.parameters.sample(rng, 1)[0]
    terms = density.parameters.terms(z[None])
    c0, c1, c2 = terms.object[0]
    ranges = np.exp(rng.uniform(np.log(0.1), np.log(2.0), _FRAMES))
    r0, wave = density.instrument.r0, density.instrument.wave
    readings = np.array([object_readings(r, r0, wave, c0 * c2, c0, c1) for r in ranges])
    if terms.crosstalk is not None:
        readings += terms.crosstalk[0]
    readings += rng.standard_normal(readings.shape) * sensor.noise.read
    return collapsed_density(sensor, scene, Frames(readings)), z


def missed(kind: str, crosstalk: bool, sets: int, seed: int) -> int:
    """Return of how many data sets the search misses what a start at the truth finds."""
    rng = np.random.default_rng(seed)
    count = 0
    for _ in range(sets):
        density, truth = _random_data(kind, crosstalk, rng)
        best = find_optima(density, rng)[0].log_density
        at_truth = [refine(density, truth), refine(density, climb(density, truth)[0])]
        wanted = max(optimum.log_density for optimum in at_truth if optimum is not None)
        count += best < wanted - 0.1
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=100)
    parser.add_argument("--seed", type=int, default=42)
    wanted = parser.parse_args()
    for kind in KINDS:
        for crosstalk in (False, True):
            count = missed(kind, crosstalk, wanted.sets, wanted.seed)
            term = "unknown crosstalk" if crosstalk else "no crosstalk"
            print(f"{kind}, {term}: {count} of {wanted.sets} missed", flush=True)


if __name__ == "__main__":
    main()
