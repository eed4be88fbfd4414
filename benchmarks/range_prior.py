"""What the prior of the ranges does to the intervals of a posterior.

    python -m benchmarks.range_prior [--runs 24]

The notebook's scene (a plate and crosstalk, both unknown; 30 frames, ranges loguniform in 0.1-3 m
as far as the posterior knows), simulated with new noise each time: once with ranges drawn from that
prior, once with ranges that fill a part of it evenly, 0.15-1.2 m. Share of 90 % intervals that hold
the true range, over all frames; frames of one run go together, so the standard error is over runs.
"""

import argparse
from pathlib import Path

import numpy as np

from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from service.commands.files import read_document
from service.schemas import SystemDescription
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
FRAMES = 30


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=24)
    runs = parser.parse_args().runs
    made = read_document(SystemDescription, NOTEBOOKS / "simulated.json")
    told = read_document(SystemDescription, NOTEBOOKS / "scene.json")
    print("| ranges | 90 % intervals that hold the truth | standard error | converged |")
    print("|---|---|---|---|")
    for name in ("drawn from the prior", "evenly in 0.15-1.2 m"):
        shares, converged = [], 0
        for run in range(runs):
            rng = np.random.default_rng([1, run])
            truth = np.geomspace(0.15, 1.2, FRAMES)
            if name.startswith("drawn"):
                truth = np.exp(rng.uniform(np.log(0.1), np.log(3.0), FRAMES))
            trajectory = SampledTrajectory(range_m=truth.tolist())
            frames = simulate(made.sensor, made.scene, trajectory, rng).frames
            settings = SamplerSettings(seed=run, method="auto")
            found = infer(told.sensor, told.scene, frames, settings)
            inside = (found.range_m.q05 <= truth) & (truth <= found.range_m.q95)
            shares.append(inside.mean())
            converged += found.verdict.converged
        error = np.std(shares, ddof=1) / np.sqrt(runs)
        print(
            f"| {name} | {np.mean(shares):.0%} | {error:.0%} | {converged} of {runs} |", flush=True
        )


if __name__ == "__main__":
    main()
