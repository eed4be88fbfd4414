"""How often the checks of a fit raise false alarms, and what they find of real errors.

    python -m benchmarks.fit_check [--sets 200] [--power 20] [--seed 0]

False alarms: data sets of the model itself, 20 frames, nothing of the object known; shares of
p-values below some levels against those levels, and an extrapolation to the level of `misfit` from
the smallest tenth. Power: readings of exact optics, 24 frames from 0.1 to 1 m, where the object
parameter model is wrong by a percent or two, by signal-to-noise ratio in the middle; share of data
sets flagged by all checks together and by each of them, against the chi-square of all frames alone.
"""

import argparse
import itertools

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inference.posterior.answer.fit import Fit
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.catalogue import plate_scene
from simulator.frames import Frames
from simulator.optics.assembly import OpticalScene, read
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import KINDS, UNKNOWN_CROSSTALK, data, sensor_of

CELLS = (("pulsed", True, 1000.0), ("sine_wave", False, 30.0), ("pulsed", False, 10.0))
LEVELS = (0.01, 0.05, 0.2)
MISFIT = 1e-3
PLATES = ("W04H04R00T00", "W04H04R01T00", "W16H01R00T00")


def healthy(kind: str, crosstalk: bool, snr: float, seed: int) -> Fit:
    sensor = sensor_of(kind, snr)
    truth = {"crosstalk": [0.002, 0.01]} if crosstalk else {}
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK} if crosstalk else {})
    settings = SamplerSettings(method="auto", seed=seed, target_ess=100)
    return infer(sensor, scene, data(sensor, truth, 20, seed).frames, settings).fit


def at_misfit(p: NDArray[np.float64]) -> float:
    """Rate below 1e-3, p taken for a power of a uniform variate in its smallest tenth (Hill)."""
    small = np.sort(p)[: max(len(p) // 10, 2)]
    edge = float(small[-1])
    slope = 1.0 / float(np.mean(np.log(edge / small[:-1])))
    return len(small) / len(p) * (MISFIT / edge) ** slope if edge > MISFIT else float("nan")


def false_alarms(sets: int, seed: int) -> None:
    print(f"{'false alarms':36}" + "".join(f"{f'p < {level}':>10}" for level in LEVELS), end="")
    print(f"{'p < 0.001':>12}{'extrapolated':>14}{'least p':>10}")
    for kind, crosstalk, snr in CELLS:
        p = np.array([healthy(kind, crosstalk, snr, seed + k).p_value for k in range(sets)])
        name = f"{kind}, {'crosstalk, ' if crosstalk else ''}SNR {snr:g}"
        shares = "".join(f"{np.mean(p < level):10.3f}" for level in LEVELS)
        print(f"{name:36}{shares}{np.mean(p < MISFIT):12.4f}", end="")
        print(f"{at_misfit(p):14.1e}{p.min():10.2g}", flush=True)
    bands = [stats.binom.isf(1e-3, sets, level) / sets for level in LEVELS]
    print(f"{'upper ends of 99.9 % bands':36}" + "".join(f"{band:10.3f}" for band in bands))


def exact(code: str, kind: str) -> NDArray[np.float64]:
    """Mean readings of a plate at 24 distances from 0.1 to 1 m."""
    silent = parse_sensor({**KINDS[kind], "noise": {"read": [1.0, 1.0]}})
    plate = plate_scene(code)
    return np.array(
        [
            read(OpticalScene(surfaces=(plate.plate(d),)), silent, tolerance=1e-6).mean
            for d in np.geomspace(0.1, 1.0, 24).tolist()
        ]
    )


def power(sets: int) -> None:
    print(f"\n{'exact optics, share flagged':36}{'misfit':>10}{'total':>10}{'worst':>10}", end="")
    print(f"{'neighbours':>12}{'wander':>10}{'total alone':>13}")
    for kind, code in itertools.product(KINDS, PLATES):
        mean = exact(code, kind)
        size = float(np.hypot(*mean[12]))
        for snr in (1e3, 1e4, 1e5):
            noise = size / snr
            sensor = parse_sensor({**KINDS[kind], "noise": {"read": [noise, noise]}})
            each = []
            for seed in range(sets):
                rng = np.random.default_rng(seed)
                frames = Frames(mean + noise * rng.standard_normal(mean.shape))
                settings = SamplerSettings(method="auto", seed=seed, target_ess=100, max_seconds=20)
                fit = infer(sensor, parse_scene({}), frames, settings).fit
                each.append([check.p_value for check in fit.checks])
            p = np.minimum(np.array(each), 1 - 1e-12)
            found = -np.expm1(p.shape[1] * np.log1p(-p)) < MISFIT
            shares = [found.any(axis=1).mean(), *found.mean(axis=0)]
            print(f"{f'{kind}, {code}, SNR {snr:g}':36}{shares[0]:10.2f}{shares[1]:10.2f}", end="")
            print(f"{shares[2]:10.2f}{shares[3]:12.2f}{shares[4]:10.2f}", end="")
            print(f"{np.mean(p[:, 0] < MISFIT):13.2f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="False alarms and power of the checks of a fit.")
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--power", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    if arguments.sets:
        false_alarms(arguments.sets, arguments.seed)
    if arguments.power:
        power(arguments.power)


if __name__ == "__main__":
    main()
