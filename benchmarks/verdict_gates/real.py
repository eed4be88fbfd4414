"""Real ensembles of emcee on cheap targets, and what the surrogate runs are made from."""

import collections
import dataclasses

import numpy as np

from benchmarks.verdict_gates.gates import POINTS, first_pass, gate_of, until
from inference.posterior.criticism.cross_check import false_branch, moments_disagree
from inference.posterior.sampling.diagnostics import autocorrelation_time
from inference.posterior.sampling.importance import draw_weighted
from tests.posterior.sampling.surrogate import banana, cheap, ensembles_of, optima_of, target

__all__ = ["real"]


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
            look, seen = first_pass(whole, 100, kept // 100)
            never += look == 0
            looks.append(look or kept // 100)
            for k, reasons in enumerate(seen):
                if 80 * (k + 1) > 80 * tau:
                    late.update({gate_of(reason) for reason in reasons})
            taus.append(tau)
            first = chains.z[..., 1]
            inflation.append(32 * first.mean(axis=1).var(axis=1).mean() / first.var())
            acceptance.append(chains.acceptance.mean())
            moved = np.any(np.diff(chains.z, axis=2) != 0, axis=-1)
            index = np.arange(kept - 1)
            last = np.maximum.accumulate(np.where(moved, index, -1), axis=2)
            still = max(still, (index - last).max() / tau)
            judged = until(chains, looks[-1] * 100)
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
