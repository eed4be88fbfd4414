"""The joint fit: time on the thesis's example, and whether it finds its way without a guess.

    python -m benchmarks.joint_fit [--sets 200] [--kinds pulsed sine_wave]

First table: c0 = 0.1, c1 = 10, c2 = 0.1, both crosstalks equal to gain * 1 m^-2, noise 1e-9 of
that, 40 and 6 points evenly in 0.2-2 m. The baseline is the thesis's nested iteration in the same
run (5.2.2): SLSQP over c0 and c1, for each of them ranges from the differential polynomial frame by
frame and linear least squares for c2 and crosstalk. It gets what it needs and the joint fit does
not: exact derivatives free of noise (so its ranges are better than any from the readings), and a
start within a factor of two of the truth. CPU times of whole estimates, compilation not counted.

Second table: random data sets (`tests.fits.random_sets`). Right is the same optimum (deviance
within 0.1, or a better one) as that of a start at the truth, or a refusal where the ranges are open
by the truth as well. Inside: share of unique ranges within 1.96 standard deviations of the truth.
"""

import argparse
import time

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from inference.estimate import estimate
from inference.fits.likelihood.maximum import maximum_from
from inference.fits.likelihood.problem import fit_problem
from simulator.frames import Frames
from simulator.object_model import object_flux_slope
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.fits.random_sets import CLASSES, outcome_of, random_set

Array = NDArray[np.float64]

C0, C1, C2 = 0.1, 10.0, 0.1
NOISE = 1e-9
SCENE = parse_scene({"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 10.0}] * 2})


def _example(frames: int, seed: int) -> tuple[PulsedSensor, Frames, Array]:
    """Sensor, readings and true ranges of the thesis's example."""
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [NOISE, NOISE]}}
    )
    assert isinstance(sensor, PulsedSensor)
    ranges = np.linspace(0.2, 2.0, frames)
    truth = parse_scene({"object": {"c0": C0, "c1": C1, "c2": C2}, "crosstalk": [1.0, 1.0]})
    path = SampledTrajectory(range_m=ranges.tolist())
    return sensor, simulate(sensor, truth, path, seed).frames, ranges


def _slopes(ranges: Array, r0: float) -> Array:
    """Exact dW1/dt and dW2/dt of an object that moves by 1 m/s."""
    late, whole = [], []
    for r in ranges:
        slope = object_flux_slope(r, C0 * C2, C0, C1)
        flux = C0 * C2 / r / r / (r * r + C1 * r + C0)
        whole.append(slope)
        late.append((slope * r + flux) / r0)
    return np.column_stack([late, whole])


def _nested(
    readings: Array, slopes: Array, r0: float, start: tuple[float, float]
) -> tuple[float, Array, int]:
    """Return chi-square, ranges and inner inversions of the thesis's nested iteration."""
    q = r0 * slopes[:, 0] / slopes[:, 1]
    count = 0

    def inner(c0: float, c1: float) -> tuple[float, Array]:
        nonlocal count
        ranges = np.empty(q.size)
        for i, value in enumerate(q):
            roots = np.roots([3.0, 2 * c1 - 4 * value, c0 - 3 * c1 * value, -2 * c0 * value])
            real = roots[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)].real
            ranges[i] = real.min() if real.size else np.nan
            count += 1
        flux = c0 / (ranges**2 * (ranges**2 + c1 * ranges + c0))
        matrix = np.zeros((2 * q.size, 3))
        matrix[0::2, 0] = matrix[1::2, 1] = 1.0
        matrix[0::2, 2], matrix[1::2, 2] = flux * ranges / r0, flux
        target = readings.ravel()
        if not np.isfinite(matrix).all():
            return 1e30, ranges
        solution = np.linalg.lstsq(matrix / target[:, None], np.ones(target.size), rcond=None)[0]
        return float((((matrix @ solution - target) / NOISE) ** 2).sum()), ranges

    # in logarithms and of the logarithm of chi-square: plain ones stop after a step
    def outer(v: Array) -> float:
        return float(np.log(inner(*np.exp(v))[0]))

    begin = np.log(np.array(start))
    found = optimize.minimize(
        outer,
        begin,
        method="SLSQP",
        bounds=[(float(x) - 5.0, float(x) + 5.0) for x in begin],
        options={"maxiter": 200, "ftol": 1e-9},
    )
    value, ranges = inner(*np.exp(found.x))
    return value, ranges, count


def _thesis(seeds: int) -> None:
    print(
        f"{'points':>6}{'joint fit':>11}{'worst':>9}{'nested':>10}{'ratio':>7}"
        f"{'ranges off by':>16}{'nested':>9}{'chi-square':>12}{'nested':>9}   same optimum"
    )
    for frames in (40, 6):
        ours, theirs, same = [], [], 0
        miss, their_miss, chi, their_chi = [], [], [], []
        for seed in range(seeds):
            sensor, shown, ranges = _example(frames, seed)
            problem = fit_problem(sensor, SCENE, shown)
            truth = problem.coordinates(np.array([[C0, C1, C2, 1.0, 1.0]]))[0]
            reference = maximum_from(problem, truth)
            if seed == 0:
                estimate(sensor, SCENE, shown, ["joint_fit"])
            begin = time.process_time()
            (result,) = estimate(sensor, SCENE, shown, ["joint_fit"]).results
            ours.append(time.process_time() - begin)
            assert result.fit is not None
            same += result.fit["deviance"] - reference.deviance < 0.1
            miss.append(np.median(np.abs(result.range_m / ranges - 1)))
            chi.append(result.fit["chi_square"])
            begin = time.process_time()
            value, found, _ = _nested(
                shown.readings, _slopes(ranges, sensor.r0), sensor.r0, (2 * C0, C1 / 2)
            )
            theirs.append(time.process_time() - begin)
            their_miss.append(np.median(np.abs(found / ranges - 1)))
            their_chi.append(value)
        one, other = np.median(ours), np.median(theirs)
        print(
            f"{frames:>6}{one * 1e3:>8.1f} ms{max(ours) * 1e3:>6.1f} ms{other * 1e3:>7.0f} ms"
            f"{other / one:>7.0f}{np.median(miss):>16.1e}{np.median(their_miss):>9.1e}"
            f"{np.median(chi):>12.3g}{np.median(their_chi):>9.3g}{'':>8}{same}/{seeds}"
        )


def _random(kind: str, sets: int) -> None:
    for name in CLASSES:
        found = [outcome_of(random_set(name, kind, seed)) for seed in range(sets)]
        misses = np.concatenate([np.array(one.misses) for one in found if not one.refused])
        seconds = [one.seconds for one in found if not one.refused]
        right = sum(one.right for one in found)
        wrongly = sum(one.refused and not one.right for one in found)
        print(
            f"{kind:<10} {name:<17}{right:>5}/{sets}{100 * right / sets:>7.1f} %"
            f"{sum(one.refused for one in found):>9}{wrongly:>9}"
            f"{100 * float(np.mean(np.abs(misses) < 1.96)):>9.1f} %"
            f"{1e3 * float(np.median(seconds)):>9.0f} ms",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--kinds", nargs="*", default=["pulsed", "sine_wave"])
    arguments = parser.parse_args()
    _thesis(min(arguments.sets, 20))
    print(f"\n{'':<28}{'right':>9}{'':>9}{'refused':>9}{'wrongly':>9}{'inside':>11}{'time':>12}")
    for kind in arguments.kinds:
        _random(kind, arguments.sets)


if __name__ == "__main__":
    main()
