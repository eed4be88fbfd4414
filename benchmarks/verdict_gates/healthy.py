"""Runs in which nothing is wrong: how often a gate alarms all the same."""

import collections

import numpy as np
from numpy.typing import NDArray

from benchmarks.verdict_gates.gates import (
    CHUNK,
    GATES,
    HALF,
    LOOKS,
    TARGET_ESS,
    TAU,
    WALKERS,
    band,
    density_gates,
    first_pass,
    gate_of,
    until,
)
from inference.posterior.criticism.prior_conflict import parameter_conflicts
from inference.posterior.sampling.diagnostics import effective_sample_size
from inference.posterior.sampling.verdict import judge
from tests.posterior.sampling.surrogate import DISTANCE, LAWS, UPPER, linear_run, surrogate

__all__ = ["priors", "sequential", "single_looks"]

Array = NDArray[np.float64]


def single_looks(runs: int, seed: int) -> None:
    alarms: collections.Counter[str] = collections.Counter()
    failed = 0
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        law = LAWS[run % len(LAWS)]
        chains = surrogate(rng, int(100 * TAU), TAU, law, walkers=WALKERS)
        gates = density_gates(law, chains, rng, both=False)
        reasons = [*judge(chains, TARGET_ESS).reasons, *gates]
        alarms.update({gate_of(reason) for reason in reasons})
        failed += bool(reasons)
        if (run + 1) % 1000 == 0 or run + 1 == runs:
            print(f"  {run + 1} runs, alarms so far: {dict(alarms)}", flush=True)
    print(f"\nhealthy surrogate runs, one look each: {runs}")
    print(f"{'gate':<26}{'alarms':>6}{'rate':>11}   95 % interval")
    for gate in GATES:
        if gate != "prior":
            half = runs // 2 if gate in HALF else runs
            print(f"{gate:<26}{band(alarms[gate], half)}")
    print(f"{'any':<26}{band(failed, runs)}", flush=True)


def priors(runs: int, seed: int) -> None:
    alarms = 0
    for run in range(runs):
        rng = np.random.default_rng([seed, 1, run])
        z, linearised = linear_run(rng, 10 ** rng.uniform(-4, 0.5), rng.random(), 100)
        alarms += bool(parameter_conflicts(("x",), z, linearised))
    print(f"\ntruths from a uniform prior, data from sharp to useless: {runs} linear models")
    print(f"{'prior':<26}{band(alarms, runs)}")
    print("truth beyond the end of the prior, by so many standard errors: named in")
    for beyond in (2, 4, 5, 6, 8, 10):
        named = 0
        for run in range(200):
            rng = np.random.default_rng([seed, 2, beyond, run])
            sharpness = 10 ** rng.uniform(-4, -1)
            z, linearised = linear_run(rng, sharpness, 1 + beyond * sharpness, 100)
            named += bool(parameter_conflicts(("x",), z, linearised))
        print(f"{beyond:>4}: {named / 200:.0%}", end="")
    print(flush=True)


def _mean(law: str) -> Array:
    return np.array([DISTANCE * UPPER if law == "bimodal" else 0.0, 0.0, 0.0])


def sequential(runs: int, seed: int) -> None:
    late: collections.Counter[str] = collections.Counter()
    never, looks, missed = 0, [], []
    for run in range(runs):
        rng = np.random.default_rng([seed, 3, run])
        law = LAWS[run % len(LAWS)]
        chains = surrogate(rng, LOOKS * CHUNK, TAU, law, walkers=WALKERS)
        look, seen = first_pass(chains)
        if not look:
            never += 1
            continue
        looks.append(look)
        for reasons in seen[4:]:  # 80 autocorrelation times and more: long enough
            late.update({gate_of(reason) for reason in reasons})
        kept = until(chains, look * CHUNK)
        for j, mean in enumerate(_mean(law)):
            x = kept.z[..., j]
            error = x.std() / np.sqrt(effective_sample_size(x))
            missed.append((x.mean() - mean) / error)
    errors = np.array(missed)
    print(f"\nhealthy surrogate runs, judged every {CHUNK / TAU:.0f} autocorrelation times: {runs}")
    print(f"{'never passed in 20 looks':<26}{band(never, runs)}")
    print(f"passed at look {np.mean(looks):.2f} in the mean, {max(looks)} at the latest")
    print(f"alarms at later looks, by gate: {dict(late)}")
    print(
        "means at the look that passed, in their stated errors: "
        f"sd {errors.std():.3f}, beyond 2: {np.mean(abs(errors) > 2):.3f} (normal 0.046), "
        f"beyond 3: {np.mean(abs(errors) > 3):.4f} (0.0027)",
        flush=True,
    )
