"""How often an optional term is kept, by its strength.

    python -m benchmarks.optional_terms [--sets 40] [--frames 20]

A plate of unknown parameters, ranges loguniform in 0.1-2 m, signal-to-noise ratio 1000 at 1 m, and
one optional term: crosstalk of both readings in units of the read noise (prior: 2600 read noises
wide), or a background at a known distance, its strength in the same units (prior: log-normal about
130 with a sigma of 2). Shares of data sets in which each criterion demands the term, and in which
it is kept. At strength 0 what is kept is a false alarm; the stated rates are 0.3 % by the
predictive density and at most 5 % by the evidence.
"""

import argparse
import time

import numpy as np

from inference.density.collapsed import collapsed_density
from inference.posterior.selection.comparison import EVIDENCE_MARGIN, PREDICTIVE_MARGIN
from inference.posterior.selection.models import assess, candidate_terms, reduced
from inference.posterior.selection.selection import Selection, decide, selection_summary
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory

READ = 7.72e-6
OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
SHADOW = {"c0": 0.056, "c1": 0.02}
TERMS = {
    "crosstalk": {"values": [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2, "optional": True},
    "background": {
        "strength": {"prior": "lognormal", "median": 1e-3, "sigma": 2.0},
        "distance_m": 3.0,
        "shadow": SHADOW,
        "optional": True,
    },
}


def truth(term: str, strength: float) -> dict[str, object]:
    if strength == 0:
        return {}
    if term == "crosstalk":
        return {"crosstalk": [strength * READ, strength * READ]}
    return {"background": {"strength": strength * READ, "distance_m": 3.0, "shadow": SHADOW}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--frames", type=int, default=20)
    options = parser.parse_args()
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=options.frames, spacing="log")
    print("| term | strength | by evidence | by prediction | kept | seconds a set |")
    print("|---|---|---|---|---|---|")
    noise = {"read": [READ, READ]}
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise})
    for term, stated in TERMS.items():
        scene = parse_scene({term: stated})
        for strength in (0.0, 0.3, 1.0, 3.0, 10.0, 100.0):
            counts, began = np.zeros(3), time.process_time()
            for seed in range(options.sets):
                rng = np.random.default_rng([seed, int(10 * strength)])
                made = parse_scene({"object": OBJECT, **truth(term, strength)})
                frames = simulate(sensor, made, path, rng).frames
                candidates = tuple(
                    assess(terms, collapsed_density(sensor, reduced(scene, terms), frames), rng)
                    for terms in candidate_terms(scene)
                )
                decisions = decide(scene, candidates)
                found = selection_summary(scene, Selection(candidates, decisions))
                assert found is not None
                without, with_it = found.candidates
                counts += [
                    with_it.log_evidence - without.log_evidence > EVIDENCE_MARGIN,
                    with_it.log_predictive - without.log_predictive > PREDICTIVE_MARGIN,
                    decisions[0].kept,
                ]
            shares = " | ".join(f"{count:.0f} of {options.sets}" for count in counts)
            seconds = (time.process_time() - began) / options.sets
            print(f"| {term} | {strength:g} | {shares} | {seconds:.1f} |", flush=True)


if __name__ == "__main__":
    main()
