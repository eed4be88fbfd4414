"""Posteriors of objects that differ from the model by far more than stands by default, or of noise.

    python -m benchmarks.larger_errors [--sets 10] [--first 0] [--snr 30000] [--light crosstalk]
    python -m benchmarks.larger_errors --understated 4 [--snr 300]

Paths of `benchmarks.coverage`, 20 frames, before light that is not known; a scene that says
nothing. The object's flux errs five times as much as the default allows; with `--understated` no
more than it allows, and the noise is so many times what is stated. Every answer is made twice from
the same draws: with room for what readings ask for where they refute the model, and without (the
baseline).
"""

import argparse
import dataclasses
import time
from unittest import mock

import numpy as np

from benchmarks.coverage.paths import LIGHT, PATHS, SNR, PathSet, draw_path
from inference.posterior import fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.job import Job
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.checkpoint import Checkpoint
from simulator.errors import RefusedError
from simulator.scene import parse_scene

TOLD = "nothing, larger errors"
BRIGHT = 3e4  # where errors of the flux show
FAR = 5.0
AT_REST = "at rest, a few moves"  # four places tell too little to refute a model


def sampled(data: PathSet, seed: int, max_seconds: float) -> tuple[Job, Checkpoint]:
    """Sample a set.

    Raises
    ------
    RefusedError
        Where no honest answer exists.
    """
    start = time.process_time()
    settings = SamplerSettings(method="auto", seed=seed, max_seconds=max_seconds)
    job = fold.prepare(data.sensor, parse_scene(data.scene), data.frames, settings)
    checkpoint = fold.start(job)
    while tasks := fold.tasks(job, checkpoint, time.process_time() - start):
        checkpoint = fold.merge(job, checkpoint, [fold.run(task) for task in tasks])
    return job, checkpoint


def answers(job: Job, checkpoint: Checkpoint) -> tuple[Posterior, Posterior]:
    """Return what is answered, and what would be without room for larger errors."""
    found = fold.summarise(job, checkpoint, 0.0, 0.0)
    with mock.patch("inference.posterior.criticism.room.asked_for", return_value=(1.0, 1.0)):
        return found, fold.summarise(job, checkpoint, 0.0, 0.0)


def understated(data: PathSet, times: float) -> PathSet:
    """Return a set whose sensor states a noise so many times too small."""
    noise = data.sensor.noise
    less = noise.model_copy(update={"read": tuple(each / times for each in noise.read)})
    return dataclasses.replace(data, sensor=data.sensor.model_copy(update={"noise": less}))


@dataclasses.dataclass
class Tally:
    """What some answers held."""

    inside: list[float] = dataclasses.field(default_factory=list)
    width: list[float] = dataclasses.field(default_factory=list)
    identified: int = 0
    far: int = 0

    def take(self, found: Posterior, truth_m: np.ndarray) -> None:
        """Count an answer."""
        ranges = found.range_m
        held = (ranges.q05 <= truth_m) & (truth_m <= ranges.q95)
        self.inside.append(float(held.mean()))
        self.width.append(float(np.median((ranges.q95 - ranges.q05) / truth_m)))
        status = {row.parameter: row.status for row in found.identifiability}
        off = np.abs(ranges.mean - truth_m) / ranges.sd
        self.identified += status["range_m"] == "identified"
        self.far += bool(off.max() > FAR)

    def line(self, name: str) -> str:
        """Return a row of the table."""
        inside = f"{np.mean(self.inside):.0%}" if self.inside else ""
        width = f"{np.median(self.width):.1%}" if self.width else ""
        return (
            f"| {name} | {len(self.inside)} | {inside} | {width} | {self.identified} | {self.far} |"
        )


def main() -> None:
    """Print a table of answers that say misfit, with and without room, and of the others."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sets", type=int, default=10, help="of each class of paths")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--snr", type=float)
    parser.add_argument("--understated", type=float, default=1.0)
    parser.add_argument("--light", choices=LIGHT, default="crosstalk")
    parser.add_argument("--max-seconds", type=float, default=20.0)
    arguments = parser.parse_args()
    of_noise = arguments.understated != 1.0
    told, snr = ("nothing", SNR) if of_noise else (TOLD, BRIGHT)
    snr = arguments.snr or snr
    room, without, others, late = Tally(), Tally(), Tally(), 0
    for number in range(arguments.first, arguments.first + arguments.sets):
        for path in PATHS:
            if path == AT_REST:
                continue
            data = draw_path(path, arguments.light, told, number, snr)
            data = understated(data, arguments.understated)
            try:
                found, baseline = answers(*sampled(data, number, arguments.max_seconds))
            except RefusedError:
                late += 1
                continue
            if not (found.drawn and found.verdict.converged):
                late += 1
            elif found.fit.misfit:
                room.take(found, data.range_m)
                without.take(baseline, data.range_m)
            else:
                others.take(found, data.range_m)
    print("| says | sets | ranges held | width | scale identified | a range beyond 5 sd |")
    print("|---|---|---|---|---|---|")
    print(room.line("misfit"))
    print(without.line("misfit, without room"))
    print(others.line("no misfit"))
    print(f"\n{late} without an answer in time, or refused")


if __name__ == "__main__":
    main()
