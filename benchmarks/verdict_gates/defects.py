"""Runs with a defect: how many pass, at any of the looks."""

import collections
import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.verdict_gates.gates import (
    CHUNK,
    LOOKS,
    TARGET_ESS,
    TAU,
    WALKERS,
    density_gates,
    first_pass,
    gate_of,
)
from inference.posterior.criticism.cross_check import false_branch
from inference.posterior.sampling.proposal import Mixture
from inference.posterior.sampling.verdict import Chains, judge
from tests.posterior.sampling.surrogate import DISTANCE, optima_of, surrogate

__all__ = ["defects"]

Array = NDArray[np.float64]
Spoil = Callable[[Chains, np.random.Generator], None]


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
            look, seen = first_pass(chains)
            passed += look > 0
            if not look:
                first[gate_of(seen[-1][0])] += 1
        print(f"{name:<32}{passed / runs:>20.1%}   {dict(first)}", flush=True)
    passed = 0
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
            passed += not density_gates("normal", narrow, rng)
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
        entered += not density_gates("bimodal", chains, rng)
    print(f"{'a branch 14 nats below another':<32}{branch / runs:>20.1%}")
    print(f"{'a mode that nobody entered':<32}{entered / runs:>20.1%}", flush=True)
