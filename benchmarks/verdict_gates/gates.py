"""The gates, and how a run is judged by them at one look or at many."""

import dataclasses

import numpy as np
from scipy import stats

from inference.posterior.criticism.cross_check import false_branch, moments_disagree
from inference.posterior.sampling.importance import draw_weighted
from inference.posterior.sampling.verdict import Chains, judge
from tests.posterior.sampling.surrogate import cheap, optima_of, target

__all__ = [
    "CHUNK",
    "GATES",
    "HALF",
    "LOOKS",
    "POINTS",
    "TARGET_ESS",
    "TAU",
    "WALKERS",
    "band",
    "density_gates",
    "first_pass",
    "gate_of",
    "until",
]

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


def gate_of(reason: str) -> str:
    """Return the gate that a reason comes from."""
    return next(gate for gate, words in GATES.items() if words in reason)


def band(count: int, runs: int) -> str:
    """Return a count, its share, and the interval of 95 % of that."""
    low = stats.beta.ppf(0.025, count, runs - count + 1) if count else 0.0
    high = stats.beta.ppf(0.975, count + 1, runs - count)
    return f"{count:>6}{count / runs:>11.1e}   [{low:.1e}, {high:.1e}]"


def density_gates(
    law: str, chains: Chains, rng: np.random.Generator, both: bool = True
) -> list[str]:
    """Return what the gates that ask the density say; not ``both``: one of two in turn."""
    density, optima = target(law), optima_of(law)
    weighted = draw_weighted(cheap(density), optima, rng, 2000)
    found = [false_branch(density, chains, optima)]
    if both or rng.random() < 0.5:
        found.append(moments_disagree(density, chains, optima, weighted, 0))
    if both or len(found) == 1:
        untrusted = dataclasses.replace(weighted, k_hat=1.0)  # quadrature by itself
        found.append(moments_disagree(density, chains, optima, untrusted, POINTS))
    return [reason for reason in found if reason is not None]


def until(chains: Chains, steps: int) -> Chains:
    """Return a run as it stood after so many steps, its first fifth dropped."""
    skip = steps // 5
    return dataclasses.replace(
        chains,
        z=chains.z[:, :, skip:steps],
        log_density=chains.log_density[:, :, skip:steps],
        mode=chains.mode[:, :, skip:steps],
    )


def first_pass(
    chains: Chains, chunk: int = CHUNK, looks: int = LOOKS
) -> tuple[int, list[tuple[str, ...]]]:
    """Return the look at which a run passes, its verdicts until then; 0 where it never does."""
    seen: list[tuple[str, ...]] = []
    for look in range(1, looks + 1):
        verdict = judge(until(chains, look * chunk), TARGET_ESS)
        if verdict.converged:
            return look, seen
        seen.append(verdict.reasons)
    return 0, seen
