"""How often a fit by default says misfit: of surfaces as they are, and behind unstated crosstalk.

    python -m benchmarks.fit_misfits [--sets 20] [--seed 0]

False alarms: the classes of `benchmarks.coverage`, exact optics, told as there, SNR 1e2 to 1e6.
Power: objects of the model with a smooth error of the default's size, 10 to 40 frames, SNR 30 to
1e5, crosstalk of a hundredth to a whole of the signal in the middle of the stroke, and a scene that
says nothing. Flagged before is by chi-square alone.
"""

import argparse
import dataclasses
import itertools
import math

import numpy as np

from benchmarks.coverage import classes
from inference.estimate import estimate
from inference.estimates import TechniqueResult
from inference.fits.answer.report import FALSE_ALARM
from simulator.frames import Frames
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

FAR = 5.0
CHECKS = ("chi_square", "crosstalk", "priors")
SHARES = (0.01, 0.1, 1.0)


@dataclasses.dataclass
class Cell:
    """What was said of some sets."""

    answered: int = 0
    before: int = 0
    misfit: int = 0
    far: int = 0
    least: list[list[float]] = dataclasses.field(default_factory=list)

    def take(self, result: TechniqueResult | None, truth_m: np.ndarray) -> None:
        if result is None or result.fit is None:
            return
        self.answered += 1
        checks = result.fit["checks"]
        self.before += checks["chi_square"] < FALSE_ALARM
        self.misfit += result.fit["misfit"]
        self.least.append([checks[name] for name in CHECKS])
        off = np.abs(result.range_m - truth_m) / result.sd_m
        self.far += bool((off[~result.near_fold & np.isfinite(off)] > FAR).any())

    def line(self, name: str) -> str:
        least = np.min(self.least, axis=0) if self.least else np.full(len(CHECKS), np.nan)
        shares = "".join(f"{p:12.2g}" for p in least)
        return f"{name:34}{self.answered:9}{self.before:9}{self.misfit:8}{self.far:9}{shares}"


HEAD = f"{'':34}{'answered':>9}{'before':>9}{'misfit':>8}{'> 5 sd':>9}" + "".join(
    f"{f'p {name}':>12}" for name in CHECKS
)


def fitted(sensor: Sensor, scene: dict[str, object], frames: Frames) -> TechniqueResult | None:
    found = estimate(sensor, parse_scene(scene), frames, ["joint_fit"]).results
    return found[0] if found else None


def healthy(sets: int, seed: int) -> None:
    print(HEAD)
    for group in classes.CLASSES.values():
        cell = Cell()
        for number in range(seed, seed + sets):
            data = classes.draw(group, number, 10.0 ** (2.0 + 4.0 * ((0.618 * number) % 1.0)))
            result = fitted(data.sensor, classes.told(data, "default"), data.frames)
            cell.take(result, data.range_m)
        print(cell.line(group.name), flush=True)


def unstated(sets: int, seed: int) -> None:
    for least, most in itertools.pairwise((0.0, *SHARES)):
        cell = Cell()
        for number in range(sets):
            rng = np.random.default_rng([seed, number])
            kind = classes.KINDS[number % 2]
            c0 = 0.08 * math.exp(0.7 * rng.standard_normal())
            c1 = 2.0 * math.sqrt(c0) * math.expm1(0.4 * rng.standard_normal())
            c2 = 0.1 * math.exp(0.5 * rng.standard_normal())
            low = math.exp(rng.uniform(math.log(0.1), math.log(0.4)))
            high = low * math.exp(rng.uniform(math.log(2.0), math.log(6.0)))
            ranges = np.exp(rng.uniform(math.log(low), math.log(high), rng.integers(10, 41)))
            middle = float(object_flux(math.sqrt(low * high), c0 * c2, c0, c1))
            noise = middle / math.exp(rng.uniform(math.log(30.0), math.log(1e5)))
            size = middle * (math.exp(rng.uniform(math.log(least), math.log(most))) if least else 0)
            truth = {
                "object": {"c0": c0, "c1": c1, "c2": c2},
                "crosstalk": (size * rng.standard_normal(2)).tolist(),
                "discrepancy": {"flux": 0.072, "range_m": 8e-4},
            }
            sensor = parse_sensor({**kind, "noise": {"read": [noise, noise]}})
            path = SampledTrajectory(range_m=ranges.tolist())
            seen = simulate(sensor, parse_scene(truth), path, rng)
            cell.take(fitted(sensor, {}, seen.frames), seen.range_m)
        name = f"crosstalk {least:g} to {most:g}" if least else "no crosstalk"
        print(cell.line(name), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=20, help="of every line")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    healthy(given.sets, given.seed)
    unstated(2 * given.sets, given.seed)


if __name__ == "__main__":
    main()
