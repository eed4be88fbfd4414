"""The adaptive inner integral against a slow reference, and its cost against a fixed grid.

    python -m benchmarks.inner_integral [--cases 5000] [--seed 1] [--worst 5] [--precise 1000]

Cases are random frames, ordinary and extreme (`tests.density.reference.random_case`), and frames
with shot or relative noise at a signal-to-noise ratio of 1e4 to 1e12, many far off the curve or at
an end of the prior (`precise_case`); the reference takes about 0.1 s each. "unfinished" counts
integrals that ran out of panels. Cost is a ratio: frames of a call of 32 parameter vectors and 40
frames, by the compiled adaptive kernel and by numpy on a fixed grid of Gauss-Legendre nodes.
"""

import argparse
import functools
import math
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.frame.arguments import prior_of
from inference.posterior.sampling.start import find_optima
from simulator.sensor import PulsedSensor
from tests.density.reference import Case, random_case, reference
from tests.density.test_frame_integral import PLATE, PULSED, make, sine_wave
from tests.posterior.scenes import example

Array = NDArray[np.float64]

LIMIT = 1e-3  # nat
VECTORS = 32
NODES = 192  # of the baseline: as many as the adaptive rule looks at before it refines anything


def adaptive(case: Case) -> float:
    density = collapsed_density(case.sensor, case.scene, case.frames)
    return float(density.log_likelihood(np.zeros((1, 0)))[0])


def unfinished(case: Case) -> int:
    density = collapsed_density(case.sensor, case.scene, case.frames)
    return density.draw_with_likelihoods(np.zeros((1, 0)), np.random.default_rng(0)).unfinished


def precise_case(rng: np.random.Generator) -> Case:
    """A frame whose readings are known to many digits, with shot noise, relative noise or both."""
    sensor = PULSED if rng.random() < 0.5 else sine_wave(10 ** rng.uniform(6.3, 7.8))
    snr, r = 10 ** rng.uniform(4, 12), math.exp(rng.uniform(math.log(0.05), math.log(5)))
    noise = {}
    which = rng.random()
    if which < 0.8:
        noise["shot"] = 10 ** rng.uniform(-4, 1)
    if which > 0.6:
        noise["relative"] = 10 ** rng.uniform(-9, -2)
    # the reference finds the top of a narrower peak no better than its width
    inside = snr / math.sqrt(1 + noise.get("shot", 0.0) * snr) < 1e9
    spread = math.sqrt(1 + noise.get("shot", 0.0) * snr) * 10 ** rng.uniform(-1, 3)
    off = (float(rng.normal() * spread), float(rng.normal() * spread))
    beside = 1 + 10 ** rng.uniform(-12, -1)
    spans = [(r * beside, 14.0), (0.02, r / beside), (r, 14.0), (0.02, r)]
    spans += [(0.02, 7.0)] * 2 if inside else []
    span = spans[int(rng.integers(len(spans)))]
    background = (10 ** rng.uniform(-3, 1), 14.0, 0.06, 0.02) if rng.random() < 0.3 else None
    crosstalk = (0.01, 0.02) if rng.random() < 0.3 else None
    return make(sensor, r, snr, PLATE, span, background, crosstalk, off, noise)


def accuracy(
    draw: Callable[[np.random.Generator], Case], count: int, seed: int, worst: int
) -> None:
    rng = np.random.default_rng(seed)
    errors, cases, lost = [], [], 0
    for _ in range(count):
        case = draw(rng)
        expected = reference(case)
        # a log density of 1e11 nats is itself known to some dozen roundings, and readings to theirs
        digits = np.max(np.abs(case.reading) / np.array(case.sensor.noise.read))
        known = np.finfo(float).eps * (
            50 * abs(expected) + 8 * digits * (1 + math.sqrt(2 * abs(expected)))
        )
        errors.append(max(abs(adaptive(case) - expected) - known, 0.0))
        lost += unfinished(case)
        cases.append(case)
    found = np.nan_to_num(np.array(errors), nan=math.inf)
    print(
        f"{count} cases of {draw.__name__}, seed {seed}: median {np.median(found):.1e} nat, 99th "
        f"percentile {np.quantile(found, 0.99):.1e}, worst {found.max():.1e}, "
        f"{int((found > LIMIT).sum())} above {LIMIT:g}; {lost} unfinished",
        flush=True,
    )
    for k in np.argsort(-found)[:worst]:
        print(f"  case {k}: {found[k]:.1e} nat; {cases[k]}")


def fixed_grid(density: CollapsedDensity, z: Array) -> Array:
    """Log likelihoods on a fixed grid in log r: what a plain numpy program would do."""
    terms = density.parameters.terms(z)
    prior = prior_of(terms.ranges[0])
    low, high = math.log(prior.low), math.log(prior.high)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    u = low + 0.5 * (high - low) * (1 + nodes)
    r = np.exp(u)
    c0, c1, c2 = (column[:, None] for column in terms.object.T)
    r0, wave, read, _, _, _ = density.instrument
    flux = density.sensor.known_gain * c0 * c2 / (r**2 * (r**2 + c1 * r + c0))
    if wave is None:
        means = np.stack([flux * r / r0, flux])
    else:
        phase = wave[0] * r + wave[1]
        means = np.stack([flux * np.cos(phase), flux * np.sin(phase)])
    if terms.crosstalk is not None:
        means = means + terms.crosstalk.T[:, :, None]
    square = np.zeros((len(z), density.frames.shape[0], NODES))
    for k in range(2):
        square += ((density.frames[:, k, None] - means[k][:, None, :]) / read[k]) ** 2
    lowest = square.min(axis=2)
    mass = np.exp(-0.5 * (square - lowest[:, :, None])) @ (0.5 * weights)
    constant = math.log(2 * math.pi * read[0] * read[1])
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(mass) - 0.5 * lowest - constant)


def seconds_per_call(call: Callable[[Array], Array], z: Array) -> float:
    call(z)
    best = math.inf
    for _ in range(20):
        begin = time.perf_counter()
        call(z)
        best = min(best, time.perf_counter() - begin)
    return best


def cost() -> None:
    print(
        f"\n| scene | sensor | adaptive [us/frame] | {NODES} fixed nodes | ratio | worst of fixed |"
    )
    print("|---|---|---|---|---|---|")
    for kind in ("pulsed", "sine_wave"):
        for crosstalk in (False, True):
            sensor, scene, frames = example(kind, crosstalk, frames=40)
            density = collapsed_density(sensor, scene, frames)
            rng = np.random.default_rng(0)
            top = find_optima(density, rng)[0]
            z = top.z + rng.standard_normal((VECTORS, top.z.size)) @ top.factor.T
            evaluations = VECTORS * len(frames)
            fast = seconds_per_call(density.frame_log_likelihoods, z)
            plain = seconds_per_call(functools.partial(fixed_grid, density), z)
            off = np.abs(fixed_grid(density, z) - density.frame_log_likelihoods(z)).max()
            print(
                f"| object{' and crosstalk' if crosstalk else ''} "
                f"| {'pulsed' if isinstance(sensor, PulsedSensor) else 'sine wave'} "
                f"| {1e6 * fast / evaluations:.2f} | {1e6 * plain / evaluations:.2f} "
                f"| {fast / plain:.2f} | {off:.1e} nat |",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--worst", type=int, default=0, help="print so many of the worst cases")
    parser.add_argument("--precise", type=int, default=1000, help="cases known to many digits")
    arguments = parser.parse_args()
    accuracy(random_case, arguments.cases, arguments.seed, arguments.worst)
    if arguments.precise:
        accuracy(precise_case, arguments.precise, arguments.seed, arguments.worst)
    cost()


if __name__ == "__main__":
    main()
