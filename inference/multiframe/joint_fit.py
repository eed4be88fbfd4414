"""One fit of everything unknown over all frames, and the iterative techniques as settings of it."""

import numpy as np

from inference.estimates import TechniqueResult
from inference.multiframe.counts import joint_obstacle
from inference.multiframe.determined import refuse_if_open
from inference.multiframe.information import residuals_and_information
from inference.multiframe.multistart import find_optima
from inference.multiframe.problem import fit_problem, unknowns_of
from inference.multiframe.ranges import DECIDED, Answer, frame_ranges
from inference.multiframe.report import describe, fit_report
from inference.multiframe.widening import widening
from inference.realtime.known import Known
from inference.realtime.net import SATURATED, rule_out
from inference.realtime.technique import Task, Technique
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["ITERATIVE_BACKGROUND_CANCELLING", "ITERATIVE_DIFFERENTIAL", "JOINT_FIT"]

_WALKS = 3  # that may meet a better optimum than the last


def _solve_as(name: str, task: Task) -> TechniqueResult:
    state = rule_out(task.sensor, task.frames)
    used = np.flatnonzero(state != SATURATED)
    problem = fit_problem(task.sensor, task.scene, task.frames.select(used))
    optima = list(find_optima(problem))
    if not optima:
        raise RefusedError(
            "no values of the unknowns give the readings a likelihood that can be computed; check "
            "gain, noise and range_m"
        )
    for walk in range(_WALKS + 1):
        top = optima[0]
        _, facts = residuals_and_information(problem, top.x, top.positions)
        if facts.rank < len(problem):
            wider = 1.0
            break
        wider, better = widening(problem, top, facts)
        if better is None or walk == _WALKS:
            break
        # the old one lies in the same valley, on the way to this
        optima[0] = better
        optima = [one for one in optima if one.deviance >= better.deviance]
    others = [(one.deviance - top.deviance, one) for one in optima[1:]]
    refuse_if_open(problem, top, facts, wider, others)
    undecided = [
        Answer(one.x, one.deviance - top.deviance, None if k else wider * facts.factor)
        for k, one in enumerate(optima)
        if one.deviance - top.deviance <= DECIDED
    ]
    return frame_ranges(
        name,
        problem,
        undecided,
        state,
        describe(problem, top.x, facts, wider),
        fit_report(problem, optima, facts, wider),
    )


def _differential_obstacle(
    sensor: Sensor, scene: Scene, known: Known, frames: Frames | None
) -> str | None:
    if not any(path.startswith("crosstalk.") for path in unknowns_of(sensor, scene)):
        return "is made for unknown crosstalk, and the scene's is known or absent: take joint_fit"
    return joint_obstacle(sensor, scene, known, frames)


def _cancelling_obstacle(
    sensor: Sensor, scene: Scene, known: Known, frames: Frames | None
) -> str | None:
    if not scene.shadow_is_object:
        return 'takes the object\'s parameters for its shadow ("shadow": "object"): take joint_fit'
    return joint_obstacle(sensor, scene, known, frames)


JOINT_FIT = Technique(
    name="joint_fit",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q, of all frames",
    needs=(),
    immune_to=("crosstalk", "background"),
    uses_background=False,
    differential=False,
    cost=1e5,
    equations="5.9-5.16: one least squares over all unknowns, ranges eliminated",
    roots="1 as a rule: all frames decide between the roots of one",
    solve=lambda task: _solve_as("joint_fit", task),
    obstacle=joint_obstacle,
)

ITERATIVE_DIFFERENTIAL = Technique(
    name="iterative_differential",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q, of all frames",
    needs=(),
    immune_to=("crosstalk",),
    uses_background=False,
    differential=False,
    cost=1.1e5,
    equations="5.9-5.13: joint_fit of c0, c1, c2 and crosstalk",
    roots="1 as a rule: all frames decide between the roots of one",
    solve=lambda task: _solve_as("iterative_differential", task),
    obstacle=_differential_obstacle,
)

ITERATIVE_BACKGROUND_CANCELLING = Technique(
    name="iterative_background_cancelling",
    kinds=("pulsed", "sine_wave"),
    observables="w1 and w2, or i and q, of all frames",
    needs=("background.distance_m",),
    immune_to=("background",),
    uses_background=True,
    differential=False,
    cost=1.1e5,
    equations="5.14-5.16: joint_fit of c0, c1, c2 and the background's strength, c' = c",
    roots="1 as a rule: all frames decide between the roots of one",
    solve=lambda task: _solve_as("iterative_background_cancelling", task),
    obstacle=_cancelling_obstacle,
)
