"""Time to a posterior where a background is unknown: curved posteriors of six to nine parameters.

    python -m benchmarks.hard_posteriors [--seeds 1] [--kinds sine_wave] [--scenes object]

N = 40 frames log-uniform in 0.1-2 m, signal-to-noise 1000 at 1 m, two processes of one thread each,
as the service has them. The baseline of the ratio is the scene without crosstalk or background in
the same run. Compilation is not counted. "target" is the wall time at which the effective sample
size asked for and an R-hat of 1.01 were reached over all ensembles; "whole" that of the whole
verdict, which also wants 50 autocorrelation times of every ensemble, and of the summary.
"""

import argparse
import multiprocessing
import os
import time
from concurrent.futures import Executor, ProcessPoolExecutor
from typing import Any

import numpy as np

from inference.posterior import fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.sampling.verdict import MAX_R_HAT
from inference.posterior.settings import SamplerSettings
from service.worker import THREAD_VARIABLES
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import Simulation, simulate
from simulator.trajectories import RadialTrajectory

SENSORS = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}
CROSSTALK = {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.1}] * 2}
STRENGTH = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}
DISTANCE = {"prior": "lognormal", "median": 3.0, "sigma": 0.5}
SCENES: dict[str, dict[str, Any]] = {
    "object": {},
    "background, R known": {"background": {"strength": STRENGTH, "distance_m": 3.0}},
    "crosstalk, background, R known": {
        **CROSSTALK,
        "background": {"strength": STRENGTH, "distance_m": 3.0},
    },
    "background, R unknown": {"background": {"strength": STRENGTH, "distance_m": DISTANCE}},
    "everything unknown": {
        **CROSSTALK,
        "background": {"strength": STRENGTH, "distance_m": DISTANCE},
    },
}
TRUTH: dict[str, Any] = {
    "object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957},
    "crosstalk": [5e-4, 0.01],
    "background": {"strength": 0.017, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.02}},
}
READ = 7.7e-6  # a thousandth of the object's w2 at 1 m


def _case(kind: str, name: str, frames: int, seed: int) -> tuple[Sensor, Scene, Simulation]:
    sensor = parse_sensor({**SENSORS[kind], "noise": {"read": [READ, READ]}})
    terms = SCENES[name]
    truth = {"object": TRUTH["object"], **{term: TRUTH[term] for term in terms}}
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=frames, spacing="log")
    simulation = simulate(sensor, parse_scene(truth), path, seed)
    return sensor, parse_scene(terms), simulation


def _warm(kind: str, name: str) -> None:
    sensor, scene, simulation = _case(kind, name, 12, 0)
    infer(sensor, scene, simulation.frames, SamplerSettings(seed=1, target_ess=10, max_seconds=5))


def _timed(
    job: fold.Job, executor: Executor, max_seconds: float
) -> tuple[Posterior, float | None, float]:
    """Run a fold; the posterior, seconds to the target or None, seconds in all."""
    begin, target = time.perf_counter(), None
    checkpoint = fold.start(job)
    while time.perf_counter() - begin < max_seconds:
        pieces = fold.tasks(job, checkpoint)
        if not pieces:
            break
        checkpoint = fold.merge(job, checkpoint, list(executor.map(fold.run, pieces)))
        reached = fold.progress(job, checkpoint)
        if (
            target is None
            and reached.ess is not None
            and reached.rhat is not None
            and reached.ess >= job.settings.target_ess
            and reached.rhat <= MAX_R_HAT
        ):
            target = time.perf_counter() - begin
    posterior = fold.summarise(job, checkpoint, time.perf_counter() - begin, 0.0)
    return posterior, target, time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", default=list(SENSORS), choices=list(SENSORS))
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--ensembles", type=int, default=4)
    parser.add_argument("--max-seconds", type=float, default=120.0)
    arguments = parser.parse_args()
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))  # processes that are spawned read it
    context = multiprocessing.get_context("spawn")
    print(
        f"{'sensor':<11}{'scene':<32}{'d':>3}{'target':>8}{'ratio':>7}{'whole':>8}{'ESS':>7}"
        f"{'R-hat':>8}{'inside':>8}  verdict"
    )
    with ProcessPoolExecutor(2, mp_context=context) as executor:
        for kind in arguments.kinds:
            base = None
            for name in arguments.scenes:
                list(executor.map(_warm, [kind] * 2, [name] * 2))
                _warm(kind, name)
                for seed in range(arguments.seeds):
                    sensor, scene, simulation = _case(kind, name, 40, seed)
                    settings = SamplerSettings(
                        seed=seed,
                        ensembles=arguments.ensembles,
                        max_seconds=arguments.max_seconds,
                    )
                    job = fold.prepare(sensor, scene, simulation.frames, settings)
                    posterior, target, whole = _timed(job, executor, arguments.max_seconds)
                    base = base or target
                    reached = "never" if target is None else f"{target:.1f}s"
                    ratio = f"{target / base:.1f}" if target and base else ""
                    ess = min(p.ess_bulk for p in posterior.parameters.values())
                    r_hat = max(p.rhat or 9.0 for p in posterior.parameters.values())
                    low, high = posterior.range_m.q05, posterior.range_m.q95
                    inside = np.mean((low <= simulation.range_m) & (simulation.range_m <= high))
                    verdict = (
                        "converged"
                        if posterior.verdict.converged
                        else "; ".join(posterior.verdict.reasons)
                    )
                    open_ones = [
                        row.parameter
                        for row in posterior.identifiability
                        if row.status == "not_identified"
                    ]
                    print(
                        f"{kind:<11}{name:<32}{len(posterior.parameters):>3}{reached:>8}"
                        f"{ratio:>7}{whole:>7.1f}s{ess:>7.0f}"
                        f"{r_hat:>8.4f}{inside:>8.0%}  {verdict}"
                        + (f"; not identified: {', '.join(open_ones)}" if open_ones else ""),
                        flush=True,
                    )


if __name__ == "__main__":
    main()
