"""The stage in which populations are carried from the prior to the posterior.

Those that arrived are what importance sampling in rounds begins with, and is held to
(`stages/setting_out.py`). Small populations that stop on their way, and stand wider than the
posterior, mostly suffice for that, at a tenth to a third of the cost. Where they do not larger
populations follow, from the prior anew.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from inference.posterior.job import Job
from inference.posterior.sampling.effort import effort_of, halfway
from inference.posterior.sampling.ensemble import WALKERS
from inference.posterior.sampling.population import Population, first_population, temper
from inference.posterior.stages.chunk import draws_of_rounds, evaluations, parts_of_a_step
from inference.posterior.stages.ensembles import POPULATIONS
from inference.posterior.stages.setting_out import (
    EvaluateTask,
    SetOutTask,
    all_the_way,
    walking_from,
)
from inference.posterior.stages.stage import Tempering, Walking
from inference.posterior.streams import Stream

__all__ = ["TemperTask", "merge", "tasks"]


@dataclasses.dataclass(frozen=True, eq=False)
class TemperTask:
    """Some temperatures of a population.

    Attributes
    ----------
    population : Population or None
        None before it is drawn from the prior.
    index : int
        Of the population.
    calls : int
        Density evaluations after which to stop.
    reach : float
        Power of the likelihood at which to stop.
    """

    job: Job
    population: Population | None
    index: int
    calls: int
    reach: float

    def run(self) -> Population:
        """Carry the population on."""
        density, population = self.job.density(), self.population
        effort = effort_of(density) if self.reach == 1.0 else halfway(density)
        before = 0 if population is None else population.calls
        if population is None:
            population = first_population(density, self._stream(0), effort)
        while not population.ended and population.power < self.reach:
            if population.calls - before >= self.calls:
                break
            stream = self._stream(1 + population.steps)
            population = temper(density, population, stream, effort)
        return population

    def _stream(self, temperature: int) -> np.random.Generator:
        index = self.index if self.reach == 1.0 else POPULATIONS + self.index
        return self.job.stream(Stream.POPULATIONS, index, temperature)


def tasks(job: Job, stage: Tempering) -> tuple[TemperTask | SetOutTask | EvaluateTask, ...]:
    """Return the populations that are still on their way; behind them what comes of them."""
    parts = parts_of_a_step(job)
    if stage.arrived and parts > 1:
        return tuple(EvaluateTask(job, stage, k, parts) for k in range(parts))
    if stage.arrived:
        return (SetOutTask(job, stage, draws_of_rounds(job)),)
    return tuple(
        TemperTask(job, population, k, evaluations(job), stage.reach)
        for k, population in enumerate(stage.populations)
        if not stage.has_come(population)
    )


def merge(
    job: Job, stage: Tempering, carried: Sequence[Population]
) -> tuple[Tempering | Walking, int]:
    """Take in populations; set up ensembles where all died on the way.

    Parameters
    ----------
    carried : sequence of Population
        In the order of `tasks`.

    Returns
    -------
    (Tempering or Walking, int)
        The next stage, and the density evaluations on the way to it.
    """
    calls, found, rest = 0, [], iter(carried)
    for old in stage.populations:
        if old is not None and stage.has_come(old):
            found.append(old)
            continue
        new = next(rest)
        calls += new.calls - (0 if old is None else old.calls)
        found.append(new)
    stage = dataclasses.replace(stage, populations=tuple(found))
    if any(len(population.z) or not population.ended for population in found):
        return stage, calls
    if stage.early:
        return all_the_way(stage), calls
    walking = walking_from(job, stage, [], None)
    return walking, calls + WALKERS * len(walking.ensembles)
