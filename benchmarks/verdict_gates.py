"""How often every gate of the verdict alarms on healthy runs, and what it lets pass.

    python -m benchmarks.verdict_gates [--runs 10000] [--sequential 1000] [--real 100] [--seed 1]

1. Surrogate runs (`tests.posterior.sampling.surrogate`) of normal, Student and bimodal laws in
   turn, four ensembles of 8 walkers and 100 autocorrelation times, judged once by all gates, the
   density's included. A rate is shown with its binomial 95 % interval (Clopper and Pearson).
2. Linear models whose truth comes from their prior: the gate of priors that end too early.
3. Surrogate runs judged after every chunk until they pass, as a job is: alarms that never end, and
   whether the means of runs that were stopped by their own verdict are as good as they say.
4. The same with defects: how many of them ever pass, at any of the looks.
5. Real ensembles of emcee on cheap targets, judged likewise, with what the surrogate is made from.
"""

import argparse
import collections
import dataclasses
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inference.posterior.criticism.cross_check import false_branch, moments_disagree
from inference.posterior.criticism.prior_conflict import parameter_conflicts
from inference.posterior.sampling.diagnostics import autocorrelation_time, effective_sample_size
from inference.posterior.sampling.importance import draw_weighted
from inference.posterior.sampling.proposal import Mixture
from inference.posterior.sampling.verdict import Chains, judge
from tests.posterior.sampling.surrogate import (
    DISTANCE,
    LAWS,
    UPPER,
    banana,
    cheap,
    ensembles_of,
    linear_run,
    optima_of,
    surrogate,
    target,
)

Array = NDArray[np.float64]
Spoil = Callable[[Chains, np.random.Generator], None]

TARGET_ESS = 400
TAU = 2.0
LOOKS = 20
CHUNK = 40  # steps, 20 autocorrelation times
POINTS = 15_000
WALKERS = 8  # in the many runs: fewer than real ones have make every gate's task harder
# a gate and the words that only its reasons hold
GATES = {
    "distinct streams": "share a stream",
    "finite start": "density is zero",
    "acceptance: stuck": "never moved",
    "acceptance: share": "accepted only",
    "acceptance: standstill": "stood still",
    "length": "autocorrelation time",
    "R-hat": "R-hat",
    "means of ensembles": "means of",
    "precision of means": "Monte Carlo error",
    "transitions": "entered mode",
    "false branch": "false branch",
    "mode weights": "of the draws and",
    "quadrature": "quadrature",
    "importance sampling": "from importance",
    "prior": "widen its prior",
}

HALF = ("mode weights", "quadrature", "importance sampling")  # asked in every second run


def _gate(reason: str) -> str:
    return next(gate for gate, words in GATES.items() if words in reason)


def _band(count: int, runs: int) -> str:
    low = stats.beta.ppf(0.025, count, runs - count + 1) if count else 0.0
    high = stats.beta.ppf(0.975, count + 1, runs - count)
    return f"{count:>6}{count / runs:>11.1e}   [{low:.1e}, {high:.1e}]"


def _density_gates(
    law: str, chains: Chains, rng: np.random.Generator, both: bool = True
) -> list[str]:
    density, optima = target(law), optima_of(law)
    weighted = draw_weighted(cheap(density), optima, rng, 2000)
    found = [false_branch(density, chains, optima)]
    if both or rng.random() < 0.5:
        found.append(moments_disagree(density, chains, optima, weighted, 0))
    if both or len(found) == 1:
        untrusted = dataclasses.replace(weighted, k_hat=1.0)  # quadrature by itself
        found.append(moments_disagree(density, chains, optima, untrusted, POINTS))
    return [reason for reason in found if reason is not None]


def single_looks(runs: int, seed: int) -> None:
    alarms: collections.Counter[str] = collections.Counter()
    failed = 0
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        law = LAWS[run % len(LAWS)]
        chains = surrogate(rng, int(100 * TAU), TAU, law, walkers=WALKERS)
        gates = _density_gates(law, chains, rng, both=False)
        reasons = [*judge(chains, TARGET_ESS).reasons, *gates]
        alarms.update({_gate(reason) for reason in reasons})
        failed += bool(reasons)
        if (run + 1) % 1000 == 0 or run + 1 == runs:
            print(f"  {run + 1} runs, alarms so far: {dict(alarms)}", flush=True)
    print(f"\nhealthy surrogate runs, one look each: {runs}")
    print(f"{'gate':<26}{'alarms':>6}{'rate':>11}   95 % interval")
    for gate in GATES:
        if gate != "prior":
            half = runs // 2 if gate in HALF else runs
            print(f"{gate:<26}{_band(alarms[gate], half)}")
    print(f"{'any':<26}{_band(failed, runs)}", flush=True)


def priors(runs: int, seed: int) -> None:
    alarms = 0
    for run in range(runs):
        rng = np.random.default_rng([seed, 1, run])
        z, linearised = linear_run(rng, 10 ** rng.uniform(-4, 0.5), rng.random(), 100)
        alarms += bool(parameter_conflicts(("x",), z, linearised))
    print(f"\ntruths from a uniform prior, data from sharp to useless: {runs} linear models")
    print(f"{'prior':<26}{_band(alarms, runs)}")
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


def _until(chains: Chains, steps: int) -> Chains:
    skip = steps // 5
    return dataclasses.replace(
        chains,
        z=chains.z[:, :, skip:steps],
        log_density=chains.log_density[:, :, skip:steps],
        mode=chains.mode[:, :, skip:steps],
    )


def _first_pass(
    chains: Chains, chunk: int = CHUNK, looks: int = LOOKS
) -> tuple[int, list[tuple[str, ...]]]:
    """The look at which a run passes, its verdicts until then; 0 where it never does."""
    seen: list[tuple[str, ...]] = []
    for look in range(1, looks + 1):
        verdict = judge(_until(chains, look * chunk), TARGET_ESS)
        if verdict.converged:
            return look, seen
        seen.append(verdict.reasons)
    return 0, seen


def _mean(law: str) -> Array:
    return np.array([DISTANCE * UPPER if law == "bimodal" else 0.0, 0.0, 0.0])


def sequential(runs: int, seed: int) -> None:
    late: collections.Counter[str] = collections.Counter()
    never, looks, missed = 0, [], []
    for run in range(runs):
        rng = np.random.default_rng([seed, 3, run])
        law = LAWS[run % len(LAWS)]
        chains = surrogate(rng, LOOKS * CHUNK, TAU, law, walkers=WALKERS)
        look, seen = _first_pass(chains)
        if not look:
            never += 1
            continue
        looks.append(look)
        for reasons in seen[4:]:  # 80 autocorrelation times and more: long enough
            late.update({_gate(reason) for reason in reasons})
        kept = _until(chains, look * CHUNK)
        for j, mean in enumerate(_mean(law)):
            x = kept.z[..., j]
            error = x.std() / np.sqrt(effective_sample_size(x))
            missed.append((x.mean() - mean) / error)
    errors = np.array(missed)
    print(f"\nhealthy surrogate runs, judged every {CHUNK / TAU:.0f} autocorrelation times: {runs}")
    print(f"{'never passed in 20 looks':<26}{_band(never, runs)}")
    print(f"passed at look {np.mean(looks):.2f} in the mean, {max(looks)} at the latest")
    print(f"alarms at later looks, by gate: {dict(late)}")
    print(
        "means at the look that passed, in their stated errors: "
        f"sd {errors.std():.3f}, beyond 2: {np.mean(abs(errors) > 2):.3f} (normal 0.046), "
        f"beyond 3: {np.mean(abs(errors) > 3):.4f} (0.0027)",
        flush=True,
    )


def _defects() -> dict[str, Spoil]:
    def stuck(c: Chains, _: np.random.Generator) -> None:
        c.z[1, 7] = c.z[1, 7, :1]

    def shared(c: Chains, _: np.random.Generator) -> None:
        c.z[2, :, 40:] = c.z[0, :, 40:]

    def shift(size: float) -> Spoil:
        def apply(c: Chains, _: np.random.Generator) -> None:
            c.z[3, ..., 1] += size

        return apply

    def split(c: Chains, _: np.random.Generator) -> None:
        c.mode[:, :2] = 1
        c.z[:, :2, :, 0] += DISTANCE

    def uneven(c: Chains, _: np.random.Generator) -> None:
        for k, walkers in enumerate((1, 2, 2, 3)):
            c.mode[k, :walkers] = 1
            c.z[k, :walkers, :, 0] += DISTANCE

    def wander(c: Chains, rng: np.random.Generator) -> None:
        c.z[:] = np.cumsum(rng.standard_normal(c.z.shape), axis=2)

    def relax(c: Chains, _: np.random.Generator) -> None:
        c.z[..., 2] += 6 * np.exp(-np.arange(c.z.shape[2]) / (50 * TAU))

    return {
        "one walker stuck": stuck,
        "two ensembles share a stream": shared,
        "one ensemble off by 0.1 sd": shift(0.1),
        "one ensemble off by 0.2 sd": shift(0.2),
        "one ensemble off by 0.3 sd": shift(0.3),
        "one ensemble off by 0.5 sd": shift(0.5),
        "one ensemble in another mode": shift(DISTANCE),
        "same split of modes in all": split,
        "another split in each": uneven,
        "walkers that wander": wander,
        "all come slowly from 6 sd": relax,
    }


def defects(runs: int, seed: int) -> None:
    print(f"\nruns with a defect, judged at up to {LOOKS} looks: {runs} each")
    print(f"{'defect':<32}{'passed at any look':>20}   first reason at the last look")
    for name, spoil in _defects().items():
        passed = 0
        first: collections.Counter[str] = collections.Counter()
        for run in range(runs):
            rng = np.random.default_rng([seed, 4, run])
            chains = surrogate(rng, LOOKS * CHUNK, TAU, walkers=WALKERS)
            spoil(chains, rng)
            look, seen = _first_pass(chains)
            passed += look > 0
            if not look:
                first[_gate(seen[-1][0])] += 1
        print(f"{name:<32}{passed / runs:>20.1%}   {dict(first)}", flush=True)
    passed, runs = 0, runs
    for run in range(runs):
        rng = np.random.default_rng([seed, 5, run])
        chains = surrogate(rng, 10 * int(TAU), TAU)
        passed += judge(chains, TARGET_ESS).converged
    print(f"{'10 autocorrelation times':<32}{passed / runs:>20.1%}")
    for factor in (0.95, 0.9, 0.86):
        passed = 0
        for run in range(runs):
            rng = np.random.default_rng([seed, 6, run])
            chains = surrogate(rng, int(100 * TAU), TAU, walkers=WALKERS)
            narrow = dataclasses.replace(chains, z=factor * chains.z)
            passed += not _density_gates("normal", narrow, rng)
        print(f"{f'all sds too small by {1 - factor:.0%}':<32}{passed / runs:>20.1%}")
    branch = entered = 0
    for run in range(runs):
        rng = np.random.default_rng([seed, 7, run])
        chains = surrogate(rng, int(100 * TAU), TAU, walkers=WALKERS)
        optima = optima_of("bimodal")

        def better(z: Array, optima: Mixture = optima) -> Array:
            far = z - optima.centres[1]
            return np.asarray(
                np.logaddexp(-0.5 * (z**2).sum(axis=1), 14 - 0.5 * (far**2).sum(axis=1))
            )

        branch += false_branch(better, chains, optima) is None
        entered += not _density_gates("bimodal", chains, rng)
    print(f"{'a branch 14 nats below another':<32}{branch / runs:>20.1%}")
    print(f"{'a mode that nobody entered':<32}{entered / runs:>20.1%}", flush=True)


def real(runs: int, seed: int) -> None:
    print(f"\nreal ensembles, judged every 100 steps: {runs} runs each")
    print(
        f"{'target':<20}{'never passed':>13}{'density':>9}{'look':>6}{'tau':>6}{'inflation':>10}"
        f"{'acceptance':>11}{'standstill':>11}  alarms after 80 tau"
    )
    targets = {
        "normal": (target("normal"), optima_of("normal")),
        "student": (target("student"), optima_of("student")),
        "bimodal": (target("bimodal"), optima_of("bimodal")),
        "banana": (banana, optima_of("normal")),
        "normal, 8 unknowns": (target("normal-8"), optima_of("normal", 8)),
    }
    for name, (density, optima) in targets.items():
        never = spoken = 0
        late: collections.Counter[str] = collections.Counter()
        looks, taus, inflation, acceptance, still = [], [], [], [], 0.0
        for run in range(runs):
            steps = 1500
            chains = ensembles_of(density, optima, seed * 1_000_003 + run, steps)
            kept = chains.z.shape[2]
            whole = dataclasses.replace(chains, mode=chains.mode)
            tau = max(autocorrelation_time(chains.z[..., j].reshape(-1, kept).T) for j in range(2))
            look, seen = _first_pass(whole, 100, kept // 100)
            never += look == 0
            looks.append(look or kept // 100)
            for k, reasons in enumerate(seen):
                if 80 * (k + 1) > 80 * tau:
                    late.update({_gate(reason) for reason in reasons})
            taus.append(tau)
            first = chains.z[..., 1]
            inflation.append(32 * first.mean(axis=1).var(axis=1).mean() / first.var())
            acceptance.append(chains.acceptance.mean())
            moved = np.any(np.diff(chains.z, axis=2) != 0, axis=-1)
            index = np.arange(kept - 1)
            last = np.maximum.accumulate(np.where(moved, index, -1), axis=2)
            still = max(still, (index - last).max() / tau)
            judged = _until(chains, looks[-1] * 100)
            rng = np.random.default_rng([seed, 8, run])
            weighted = draw_weighted(cheap(density), optima, rng, 2000)
            spoken += any(
                reason is not None
                for reason in (
                    false_branch(density, judged, optima),
                    moments_disagree(density, judged, optima, weighted, POINTS),
                )
            )
        print(
            f"{name:<20}{never:>13}{spoken:>9}{np.mean(looks):>6.1f}{np.mean(taus):>6.1f}"
            f"{np.mean(inflation):>10.2f}{np.mean(acceptance):>11.2f}{still:>8.1f} tau"
            f"  {dict(late)}",
            flush=True,
        )


PARTS: dict[str, tuple[Callable[[int, int], None], str]] = {
    "priors": (priors, "runs"),
    "real": (real, "real"),
    "sequential": (sequential, "sequential"),
    "defects": (defects, "defects"),
    "single": (single_looks, "runs"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10_000)
    parser.add_argument("--sequential", type=int, default=1000)
    parser.add_argument("--defects", type=int, default=100)
    parser.add_argument("--real", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=list(PARTS), help="one part of the five")
    wanted = parser.parse_args()
    begin = time.process_time()
    for name, (part, count) in PARTS.items():
        if wanted.only in (None, name):
            part(getattr(wanted, count), wanted.seed)
    print(f"\n{time.process_time() - begin:.0f} s of processor time")


if __name__ == "__main__":
    main()
