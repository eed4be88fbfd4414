"""What a law of the ranges does to the other unknowns: the bias of their score, by quadrature.

    python -m benchmarks.dark_frames [--sets 100]

A plate (0.4 m, diffuse) and either a wall 1 m behind the farthest range, of unknown strength and
with the plate's own shadow, or unknown crosstalk, seen by a pulse in 40 frames. Under the density
sqrt(k^2 + I) of log r, I its Fisher information, the score of the likelihood with all ranges
integrated out is averaged over data sets at the truth. A law that takes nothing from how ranges are
spread leaves a mean of zero; the table has what it leaves, in standard deviations of all unknowns
together (Mahalanobis), and "k = inf" is a log-uniform law. The bias is of first order, so that
beyond one or two standard deviations only its size counts. The last column is the law that stands:
k = 5, and less in the dark, which has the mass of one state (`inference.frame.dark_mass`).
"""

import argparse
import dataclasses
import math

import numba
import numpy as np
from numpy.typing import NDArray

from inference.frame.dark_mass import DARK_MASS
from inference.frame.range_prior import LEAST_INFORMATION

Array = NDArray[np.float64]

C0, C1, C2, STRENGTH = 0.0769, -0.123, 0.0957, 0.0177
SIGNAL_AT_1M = 7.72e-3
R0 = 14.99
FRAMES = 40
FLOORS = np.array([1.0, 5.0, 10.0, 40.0, math.inf])
_LOWEST = 0.02
_STANDS = math.sqrt(LEAST_INFORMATION)


@dataclasses.dataclass(frozen=True)
class Case:
    """One experiment: light, signal-to-noise ratio at 1 m, stroke [m], whether evenly in log r."""

    light: str
    snr: float
    low: float
    high: float
    even_in_log: bool


CASES = (
    Case("wall", 100.0, 0.2, 4.0, False),
    Case("wall", 100.0, 0.2, 4.0, True),
    Case("wall", 30.0, 0.2, 4.0, False),
    Case("wall", 30.0, 0.2, 2.0, True),
    Case("wall", 1000.0, 0.2, 2.0, False),
    Case("crosstalk", 30.0, 0.15, 1.0, False),
    Case("crosstalk", 100.0, 0.2, 2.0, False),
    Case("crosstalk", 100.0, 0.2, 2.0, True),
    Case("crosstalk", 30.0, 0.2, 4.0, False),
)


@numba.njit(cache=True)
def _readings(r: float, theta: Array, wall: float) -> tuple[float, float, float, float]:
    """Return w1, w2 and their slopes along log r; theta is c0, c1, c2, strength."""
    a, b, c, strength = theta
    q, slope = r * r + b * r + a, 2 * r + b
    own, shadow = a * c / (r * r * q), (r * r + b * r) / q
    own_slope = own * (-2 - r * slope / q)
    hidden_slope = strength * r * (slope / q - shadow * slope / q)
    hidden = strength * shadow
    first = own * r / R0 + hidden * wall / R0
    first_slope = (own_slope + own) * r / R0 + hidden_slope * wall / R0
    return first, own + hidden, first_slope, own_slope + hidden_slope


@numba.njit(cache=True)
def _dark(theta: Array, wall: float, sd: float) -> float:
    """Return the factor on the law that stands, in the dark."""
    low, step = math.log(_LOWEST), math.log(wall / _LOWEST) / 400
    mass = 0.0
    for j in range(400):
        _, _, d1, d2 = _readings(math.exp(low + (j + 0.5) * step), theta, wall)
        mass += step * _STANDS / math.sqrt(1.0 + (d1 * d1 + d2 * d2) / (sd * _STANDS) ** 2)
    return min(DARK_MASS / mass, 1.0)


@numba.njit(cache=True)
def _log_likelihoods(seen: Array, truth: Array, theta: Array, wall: float, sd: float) -> Array:
    """Sum log int N(y; m(r)) sqrt(k^2 + I) dlog r over frames, for every k, and what stands."""
    floors = FLOORS
    out = np.zeros(floors.size + 1)
    low, high = math.log(_LOWEST), math.log(wall)
    dark = _dark(theta, wall, sd) * _STANDS**2
    for i in range(truth.size):
        u = math.log(truth[i])
        found = _readings(truth[i], theta, wall)
        told = math.hypot(found[2], found[3]) / sd
        reach = 12.0 / told
        start, end = max(low, u - reach), min(high, u + reach)
        count = 2400 if told < 30.0 else 400
        step = (end - start) / count
        total, top = np.zeros(floors.size + 1), -math.inf
        for j in range(count):
            m1, m2, d1, d2 = _readings(math.exp(start + (j + 0.5) * step), theta, wall)
            value = -0.5 * ((seen[i, 0] - m1) ** 2 + (seen[i, 1] - m2) ** 2) / sd**2
            if value > top:
                total *= math.exp(top - value)
                top = value
            share = math.exp(value - top) * step
            information = (d1 * d1 + d2 * d2) / sd**2
            for k in range(floors.size):
                flat = math.isinf(floors[k])
                total[k] += share * (1.0 if flat else math.sqrt(floors[k] ** 2 + information))
            total[-1] += share * (dark + information) / math.sqrt(_STANDS**2 + information)
        out += top + np.log(total)
    return out


def bias(case: Case, sets: int) -> tuple[float, Array]:
    """Return the least sqrt(I) of a frame, and the bias under every law in standard deviations."""
    wall = case.high + 1.0 if case.light == "wall" else R0
    spaced = np.geomspace if case.even_in_log else np.linspace
    truth, sd = spaced(case.low, case.high, FRAMES), SIGNAL_AT_1M / case.snr
    shape = np.array([C0, C1, C2, STRENGTH if case.light == "wall" else 0.0])
    middle = _readings(math.sqrt(case.low * case.high), shape, wall)[1]
    mean = np.array([_readings(r, shape, wall) for r in truth])
    # steps along log c0, log(1 + c1 / (2 sqrt c0)), log c2, and log strength or the crosstalks
    start = np.array([math.log(C0), math.log1p(C1 / 2 / math.sqrt(C0)), math.log(C2)])
    extra = np.array([math.log(STRENGTH)]) if case.light == "wall" else np.zeros(2)
    scale = np.array([2.0, 0.4, 1.0, *([0.5] if case.light == "wall" else [0.3 * middle] * 2)])
    steps = np.array([1e-4] * 3 + ([1e-4] if case.light == "wall" else [0.01 * sd] * 2))

    def at(x: Array, seen: Array) -> Array:
        c0 = math.exp(x[0])
        theta = np.array([c0, 2 * math.sqrt(c0) * math.expm1(x[1]), math.exp(x[2]), 0.0])
        if case.light == "wall":
            theta[3] = math.exp(x[3])
        else:
            seen = seen - x[3:]
        return np.asarray(_log_likelihoods(seen, truth, theta, wall, sd))

    rng, x = np.random.default_rng(5), np.concatenate([start, extra])
    scores = np.empty((FLOORS.size + 1, sets, x.size))
    for number in range(sets):
        seen = mean[:, :2] + sd * rng.standard_normal((FRAMES, 2))
        for j, step in enumerate(np.diag(steps)):
            scores[:, number, j] = (at(x + step, seen) - at(x - step, seen)) / (2 * steps[j])
    found = []
    for score in scores:
        pull = score.mean(axis=0)
        information = np.cov(score.T) + np.diag(1 / scale**2)
        found.append(math.sqrt(pull @ np.linalg.solve(information, pull)))
    return float(np.hypot(mean[:, 2], mean[:, 3]).min() / sd), np.array(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=100)
    given = parser.parse_args()
    print("| before | SNR | ranges [m] | least sqrt(I) |", end="")
    print("".join(f" k = {k:g} |" for k in FLOORS), "stands |")
    print("|---" * (5 + FLOORS.size) + "|")
    for case in CASES:
        least, found = bias(case, given.sets)
        spread = "log-spaced" if case.even_in_log else "constant speed"
        print(f"| {case.light} | {case.snr:g} | {case.low:g}-{case.high:g}, {spread} ", end="")
        print(f"| {least:.2g} |" + "".join(f" {x:.1f} |" for x in found), flush=True)


if __name__ == "__main__":
    main()
