"""What the prior of the ranges does to the intervals of a posterior.

    python -m benchmarks.range_prior [--runs 24] [--walls 4] [--laws loguniform reference]

First table: the notebook's scene (a plate and crosstalk, both unknown; 30 frames), simulated with
new noise each time: once with ranges drawn from its prior, loguniform in 0.1-3 m, once with ranges
that fill a part of it evenly, 0.15-1.2 m. Told is that prior, a stroke, or the reference prior.
Second table: a plate before a wall, of which only the order of magnitude of strength and distance
is known; 40 frames at constant speed over 0.2-2 m, signal-to-noise 1000. Share of 90 % intervals
that hold the true range, over all frames; frames of one run go together, so the standard error is
over runs. "Says weak" counts runs that call the ranges' scale weak or not identified.
"""

import argparse
from pathlib import Path

import numpy as np

from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from service.commands.files import read_document
from service.system_description import SystemDescription
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
NEAR, FAR = {"low": 0.1, "high": 3.0}, {"low": 0.02, "high": 15.0}
SENSOR = {"kind": "pulsed", "pulse_width_s": 1e-7}
PLATE = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}}
WALL = {"strength": 0.0177, "distance_m": 3.0, "shadow": "object"}
OPEN_WALL = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.5},
    "shadow": "object",
}
LAWS = ("loguniform", "stroke", "reference")
Span = tuple[float, float, int, bool]  # from, to [m], frames, whether evenly in log r


def _row(name: str, shares: list[float], widths: list[float], weak: int, converged: int) -> str:
    runs = len(shares)
    error = np.std(shares, ddof=1) / np.sqrt(runs)
    return (
        f"| {name} | {np.mean(shares):.0%} | {error:.0%} | {np.median(widths):.1%} | {weak} of "
        f"{runs} | {converged} of {runs} |"
    )


def _study(
    name: str, made: SystemDescription, told: SystemDescription, runs: int, drawn: bool, span: Span
) -> None:
    shares, widths, weak, converged = [], [], 0, 0
    for run in range(runs):
        rng = np.random.default_rng([1, run])
        truth = np.geomspace(*span[:2], span[2]) if span[3] else np.linspace(*span[:2], span[2])
        if drawn:
            truth = np.exp(rng.uniform(np.log(0.1), np.log(3.0), span[2]))
        trajectory = SampledTrajectory(range_m=truth.tolist())
        frames = simulate(made.sensor, made.scene, trajectory, rng).frames
        settings = SamplerSettings(seed=run, method="auto")
        found = infer(told.sensor, told.scene, frames, settings)
        low, high = found.range_m.q05, found.range_m.q95
        shares.append(float(np.mean((low <= truth) & (truth <= high))))
        widths.append(float(np.median((high - low) / truth)))
        status = {row.parameter: row.status for row in found.identifiability}["range_m"]
        weak += status != "identified"
        converged += found.verdict.converged
    print(_row(name, shares, widths, weak, converged), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--walls", type=int, default=4, help="runs before a wall")
    parser.add_argument("--laws", nargs="+", default=LAWS, choices=LAWS)
    given = parser.parse_args()
    made = read_document(SystemDescription, NOTEBOOKS / "simulated.json")
    told = read_document(SystemDescription, NOTEBOOKS / "scene.json")
    head = (
        "| prior | ranges | 90 % intervals that hold the truth | standard error | relative width "
    )
    print(head + "| says weak | converged |", "|---|---|---|---|---|---|---|", sep="\n")
    for law in given.laws if given.runs else ():
        scene = {**told.scene.model_dump(exclude_none=True), "range_m": {"prior": law, **NEAR}}
        other = told.model_copy(update={"scene": parse_scene(scene)})
        for drawn in (True, False):
            where = "drawn" if drawn else "evenly in 0.15-1.2 m"
            _study(f"{law} | {where}", made, other, given.runs, drawn, (0.15, 1.2, 30, True))
    sensor = parse_sensor({**SENSOR, "noise": {"read": [9.3e-6, 9.3e-6]}})
    before = SystemDescription(sensor=sensor, scene=parse_scene({**PLATE, "background": WALL}))
    for law in given.laws:
        scene = {"background": OPEN_WALL, "range_m": {"prior": law, **FAR}}
        other = before.model_copy(update={"scene": parse_scene(scene)})
        name = f"{law}, wall | 0.2-2 m at constant speed"
        _study(name, before, other, given.walls, False, (0.2, 2.0, 40, False))


if __name__ == "__main__":
    main()
