"""Joint fits over frames of a sine wave whose ranges lie in several turns of phase.

    python -m benchmarks.fit_turns [--sets 40] [--seed 0] [--classes ..] [--default-errors]

Random scenes at 20 MHz, c/2f = 7.5 m, that state ranges from 0.3 to 14 m: an object of random size,
10 to 30 frames, a signal-to-noise ratio of 30 to 100,000 in the middle of a path that crosses c/2f
or lies wholly beyond it. The model is exact, or with ``--default-errors`` taken to err as by
default. Columns: sets that are refused and that say misfit; of those answered, frames, how many of
them have one range with a standard deviation, how many of these are within two, and in how many
sets one is beyond five; frames with several ranges, and how many of these have none within five;
processor time of a set.
"""

import argparse
import math
import time

import numpy as np

from inference.estimate import estimate
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import Simulation, simulate
from simulator.trajectories import SampledTrajectory

CLASSES = ("object", "crosstalk", "object+crosstalk", "wall", "object+wall", "everything")
HEAD = (
    f"{'':28}{'sets':>5}{'refused':>8}{'misfit':>7}{'frames':>8}{'unique':>8}{'in 2 sd':>9}"
    f"{'> 5 sd':>7}{'several':>8}{'none':>6}{'s':>7}"
)


def random_scene(
    name: str, seed: int, beyond: bool, exact: bool
) -> tuple[Sensor, Scene, Simulation]:
    """Draw a data set; half of those of object and crosstalk have four empty frames."""
    rng = np.random.default_rng([seed, CLASSES.index(name), int(beyond)])
    everything = name == "everything"
    c0 = math.exp(rng.normal(math.log(0.5), 1.2))
    c1 = 2 * math.sqrt(c0) * math.expm1(rng.normal(0.0, 0.25))
    c2 = math.exp(rng.normal(math.log(0.1), 0.5))
    count = int(rng.integers(10, 31))
    near = rng.uniform(7.7, 9.0) if beyond else math.exp(rng.uniform(math.log(0.5), math.log(5)))
    far = rng.uniform(max(near + 1.5, 8.5), 13.9)
    r = np.exp(rng.uniform(math.log(near), math.log(far), count))
    middle = near * far
    signal = c0 * c2 / middle / (middle + c1 * math.sqrt(middle) + c0)
    read = signal / 10 ** rng.uniform(math.log10(30.0), 5.0)
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [read, read]}}
    )
    truth: dict[str, object] = {"object": {"c0": c0, "c1": c1, "c2": c2}}
    told: dict[str, object] = {"range_m": {"prior": "uniform", "low": 0.3, "high": 14.0}}
    if exact:
        told["discrepancy"] = 0
    if not everything and "object" not in name:
        told["object"] = truth["object"]
    if everything or "crosstalk" in name:
        truth["crosstalk"] = (rng.normal(0.0, 1.0, 2) * signal).tolist()
        told["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": 3 * signal}] * 2
    if everything or "wall" in name:
        strength = {"prior": "lognormal", "median": signal, "sigma": 1.0}
        shadow = {
            "c0": c0 * math.exp(rng.normal(math.log(0.75), 0.3)),
            "c1": math.sqrt(c0) * abs(rng.normal(0.0, 0.2)),
        }
        wall = {"distance_m": float(rng.uniform(14.1, 17.0)), "shadow": shadow}
        truth["background"] = wall | {"strength": signal * math.exp(rng.normal(0.0, 0.7))}
        told["background"] = wall | {"strength": strength}
    empty = 4 if (everything or name == "object+crosstalk") and rng.random() < 0.5 else 0
    path = SampledTrajectory(
        range_m=r.tolist() + [far] * empty, object_present=[True] * count + [False] * empty
    )
    simulation = simulate(sensor, parse_scene(truth | {"discrepancy": 0}), path, seed)
    return sensor, parse_scene(told), simulation


def line_of(name: str, beyond: bool, exact: bool, seeds: range) -> str:
    """Fit the sets of a class, and count what became of them."""
    refused = misfit = frames = several = none = bad = 0
    off: list[float] = []
    seconds = 0.0
    for seed in seeds:
        sensor, scene, simulation = random_scene(name, seed, beyond, exact)
        begin = time.process_time()
        found = estimate(sensor, scene, simulation.frames, ["joint_fit"])
        seconds += time.process_time() - begin
        if not found.results:
            refused += 1
            continue
        (result,) = found.results
        assert result.fit is not None
        if result.fit["misfit"]:
            misfit += 1
            continue
        frames += int(simulation.frames.present.sum())
        sd = np.where(np.isnan(result.roots_sd_m), np.inf, result.roots_sd_m)
        away = np.abs(result.roots_m - simulation.range_m[:, None]) / sd
        nearest = np.where(np.isnan(away), np.inf, away).min(axis=1)
        unique = np.isfinite(result.range_m) & np.isfinite(result.sd_m)
        of_set = nearest[unique].tolist()
        off += of_set
        bad += max(of_set, default=0.0) > 5
        several += int(np.count_nonzero(result.root_count > 1))
        none += int(np.count_nonzero(nearest[result.root_count > 1] > 5))
    held = float(np.mean(np.array(off) < 2)) if off else math.nan
    label = f"{name}, {'beyond' if beyond else 'crossing'}"
    return (
        f"{label:28}{len(seeds):5}{refused:8}{misfit:7}{frames:8}{len(off):8}{held:9.3f}{bad:7}"
        f"{several:8}{none:6}{seconds / len(seeds):7.2f}"
    )


def main() -> None:
    """Print a line a class and path."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--classes", nargs="+", choices=CLASSES, default=CLASSES)
    parser.add_argument("--default-errors", action="store_true")
    asked = parser.parse_args()
    print(HEAD)
    for name in asked.classes:
        for beyond in (False, True):
            seeds = range(asked.seed, asked.seed + asked.sets)
            print(line_of(name, beyond, not asked.default_errors, seeds), flush=True)


if __name__ == "__main__":
    main()
