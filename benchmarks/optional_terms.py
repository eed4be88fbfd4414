"""How often an optional term is kept, by its strength, and whether the answer without it is right.

    python -m benchmarks.optional_terms [--sets 20] [--frames 20] [--terms crosstalk]

A plate of unknown parameters, ranges evenly in log from 0.1 to 2 m, signal-to-noise ratio 1000 at
1 m, and one optional term: crosstalk of both readings in units of the read noise (prior: 2600 read
noises wide), or a background at a known distance, its strength in the same units (prior: log-normal
about 130 with a sigma of 2). Shares of data sets in which each criterion demands the term, in which
it is kept, and in which leaving it out would change the answer; and the share of ranges in the 90 %
intervals of the answers that leave it out, of those that keep it, and of the answers of evidence
and predictive density alone. At strength 0 what is left out is rightly so.
"""

import argparse
import time

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import collapsed_density
from inference.posterior.selection.comparison import EVIDENCE_MARGIN, PREDICTIVE_MARGIN
from inference.posterior.selection.models import Candidate, assess, candidate_terms, reduced
from inference.posterior.selection.selection import decide
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

READ = 7.72e-6
OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
SHADOW = {"c0": 0.056, "c1": 0.02}
KINDS = {
    "pulsed": {"pulse_width_s": 1e-7},
    "sine_wave": {"frequency_hz": 5e6},
}
TERMS = {
    "crosstalk": {"values": [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2, "optional": True},
    "background": {
        "strength": {"prior": "lognormal", "median": 1e-3, "sigma": 2.0},
        "distance_m": 3.0,
        "shadow": SHADOW,
        "optional": True,
    },
}
STRENGTHS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)


def truth(term: str, strength: float) -> dict[str, object]:
    if strength == 0:
        return {}
    if term == "crosstalk":
        return {"crosstalk": [strength * READ, strength * READ]}
    return {"background": {"strength": strength * READ, "distance_m": 3.0, "shadow": SHADOW}}


def held(candidate: Candidate, ranges: NDArray[np.float64]) -> float:
    """Share of the true ranges in the 90 % intervals of a candidate."""
    found = candidate.reported
    if found is None:
        return 0.0
    _, _, low, high = found.of(())
    return float(np.mean((low <= ranges) & (ranges <= high)))


def share(values: list[float]) -> str:
    return f"{np.mean(values):.0%}" if values else "-"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--terms", nargs="*", default=list(TERMS), choices=list(TERMS))
    parser.add_argument("--sensors", nargs="*", default=list(KINDS), choices=list(KINDS))
    parser.add_argument("--strengths", nargs="*", type=float, default=STRENGTHS)
    options = parser.parse_args()
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=options.frames, spacing="log")
    print(
        "| sensor | term | strength | by evidence | by prediction | kept | held, left out | held, "
        "kept | held by evidence and prediction alone | seconds a set |"
    )
    print("|---" * 10 + "|")
    for kind in options.sensors:
        noise = {"read": [READ, READ]}
        sensor = parse_sensor({"kind": kind, **KINDS[kind], "noise": noise})
        for term in options.terms:
            scene = parse_scene({term: TERMS[term]})
            for strength in options.strengths:
                counts, began = np.zeros(3), time.process_time()
                without_it: list[float] = []
                with_it: list[float] = []
                criteria_alone: list[float] = []
                for seed in range(options.sets):
                    rng = np.random.default_rng([seed, int(10 * strength)])
                    made = parse_scene({"object": OBJECT, **truth(term, strength)})
                    simulated = simulate(sensor, made, path, rng)
                    small, large = (
                        assess(
                            terms,
                            collapsed_density(sensor, reduced(scene, terms), simulated.frames),
                            rng,
                        )
                        for terms in candidate_terms(scene)
                    )
                    gain = large.log_predictive.sum() - small.log_predictive.sum()
                    demanded = (
                        large.log_evidence - small.log_evidence > EVIDENCE_MARGIN,
                        gain > PREDICTIVE_MARGIN,
                    )
                    (decision,) = decide(scene, (small, large))
                    chosen = large if decision.kept else small
                    (with_it if decision.kept else without_it).append(
                        held(chosen, simulated.range_m)
                    )
                    alone = large if any(demanded) else small
                    criteria_alone.append(held(alone, simulated.range_m))
                    counts += [*demanded, decision.kept]
                shares = " | ".join(f"{count:.0f} of {options.sets}" for count in counts)
                right = " | ".join(map(share, (without_it, with_it, criteria_alone)))
                seconds = (time.process_time() - began) / options.sets
                print(
                    f"| {kind} | {term} | {strength:g} | {shares} | {right} | {seconds:.1f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
