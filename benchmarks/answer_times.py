"""Time to an answer, and to the whole verdict, of every kind of scene.

    python -m benchmarks.answer_times [--snrs 10 100] [--scenes object] [--seeds 2]

N = 40 frames log-uniform in 0.1-2 m. Times are processor seconds laid out over two processes, the
tasks of a chunk to whichever is free first: what an idle machine with two workers would take, told
on a busy one (which is slower by what its processes share). Compilation is not counted. "usable" is
the time of the first checkpoint whose answer, were it stopped there, has an effective sample size
of 100 and intervals at most 1.3 times the final ones, in the median over parameters and ranges;
"whole" that of the verdict and its summary, which is also given alone.
"""

import argparse
import dataclasses
import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from benchmarks import hard_posteriors
from inference.posterior import fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.settings import SamplerSettings
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import Simulation, simulate
from simulator.trajectories import RadialTrajectory

R = TypeVar("R")

SCENES = {
    "object": {},
    "object, crosstalk": hard_posteriors.CROSSTALK,
    **{name: terms for name, terms in hard_posteriors.SCENES.items() if name != "object"},
}
FRAMES = 40
_ESS = 100.0
_WIDER = 1.3


def _timed(function: Callable[..., R], *arguments: Any) -> tuple[R, float]:
    before = time.process_time()
    result = function(*arguments)
    return result, time.process_time() - before


def _makespan(seconds: list[float]) -> float:
    """Return when two processes have ended tasks that take so long."""
    free = [0.0, 0.0]
    for each in seconds:
        free[int(np.argmin(free))] += each
    return max(free)


def _case(kind: str, name: str, snr: float, seed: int) -> tuple[Sensor, Scene, Simulation]:
    read = 1000.0 * hard_posteriors.READ / snr
    sensor = parse_sensor({**hard_posteriors.SENSORS[kind], "noise": {"read": [read, read]}})
    truth = {term: hard_posteriors.TRUTH[term] for term in ("object", *SCENES[name])}
    path = RadialTrajectory(from_m=0.1, to_m=2.0, frames=FRAMES, spacing="log")
    return sensor, parse_scene(SCENES[name]), simulate(sensor, parse_scene(truth), path, seed)


def _ess(posterior: Posterior) -> float:
    return min((p.ess_bulk for p in posterior.parameters.values()), default=np.inf)


def _widths(posterior: Posterior) -> np.ndarray[Any, np.dtype[np.float64]]:
    rows = [(p.q05, p.q95) for p in posterior.parameters.values()]
    ranges = np.column_stack([posterior.range_m.q05, posterior.range_m.q95])
    return np.asarray(np.diff(np.concatenate([rows, ranges]), axis=1)[:, 0])


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What one posterior took."""

    posterior: Posterior
    usable_s: float | None
    whole_s: float
    summary_s: float


def measure(job: fold.Job, max_seconds: float, look: bool) -> Outcome:
    """Fold a job in this process, and lay its tasks out over two."""
    checkpoint, clock = _timed(fold.start, job)
    seen: list[tuple[float, Posterior]] = []
    while clock < max_seconds:
        # what is looked at before it is begun would be computed beside the clock
        begun = fold.progress(job, checkpoint).phase != "starting"
        if look and begun and (not seen or _ess(seen[-1][1]) < _ESS or not seen[-1][1].drawn):
            seen.append((clock, fold.summarise(job, checkpoint, 0.0, 0.0)))
        pieces = [_timed(fold.run, task) for task in fold.tasks(job, checkpoint)]
        if not pieces:
            break
        done = [piece for piece, _ in pieces]
        checkpoint, merged_s = _timed(fold.merge, job, checkpoint, done)
        clock += _makespan([seconds for _, seconds in pieces]) + merged_s
    posterior, summary_s = _timed(fold.summarise, job, checkpoint, 0.0, 0.0)
    seen.append((clock + summary_s, posterior))
    usable = [
        at
        for at, found in seen
        if found.drawn
        and _ess(found) >= _ESS
        and np.median(_widths(found) / _widths(posterior)) <= _WIDER
    ]
    return Outcome(posterior, usable[0] if usable else None, clock + summary_s, summary_s)


def main() -> None:
    """Print a line for every posterior."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--snrs", type=float, nargs="+", default=[10.0, 100.0, 1000.0, 1e4])
    kinds = list(hard_posteriors.SENSORS)
    parser.add_argument("--kinds", nargs="+", default=kinds, choices=kinds)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--max-seconds", type=float, default=60.0)
    parser.add_argument("--method", default="emcee", choices=["emcee", "auto"])
    parser.add_argument("--no-look", action="store_true", help="the whole verdict alone")
    given = parser.parse_args()
    print(
        f"{'sensor':<11}{'scene':<32}{'SNR':>6}{'d':>3}{'usable':>9}{'whole':>9}{'summary':>9}"
        f"{'calls':>8}{'ESS':>7}{'k-hat':>7}{'inside':>8}  verdict"
    )
    warmed = set()
    for kind in given.kinds:
        for name in given.scenes:
            for snr in given.snrs:
                for seed in range(given.seeds):
                    sensor, scene, simulation = _case(kind, name, snr, seed)
                    settings = SamplerSettings(method=given.method, seed=seed)
                    job = fold.prepare(sensor, scene, simulation.frames, settings)
                    if (kind, name) not in warmed:  # machine code is read or made
                        measure(job, 5.0, look=False)
                        warmed.add((kind, name))
                    found = measure(job, given.max_seconds, look=not given.no_look)
                    posterior = found.posterior
                    low, high = posterior.range_m.q05, posterior.range_m.q95
                    inside = np.mean((low <= simulation.range_m) & (simulation.range_m <= high))
                    usable = "never" if found.usable_s is None else f"{found.usable_s:.1f} s"
                    k_hat = posterior.runtime.k_hat
                    verdict = "; ".join(posterior.verdict.reasons) or "converged"
                    print(
                        f"{kind:<11}{name:<32}{snr:>6g}{len(posterior.parameters):>3}{usable:>9}"
                        f"{found.whole_s:>7.1f} s{found.summary_s:>7.2f} s"
                        f"{posterior.runtime.likelihood_calls:>8}{_ess(posterior):>7.0f}"
                        f"{np.nan if k_hat is None else k_hat:>7.2f}{inside:>8.0%}  {verdict[:90]}",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
