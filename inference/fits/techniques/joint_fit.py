"""One fit of everything unknown over all frames, and the iterative techniques as settings of it."""

from inference.estimates import TechniqueResult
from inference.fits.answer.counts import joint_obstacle
from inference.fits.likelihood.unknowns import unknowns_of
from inference.known import Known
from inference.technique import Task, Technique
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["ITERATIVE_BACKGROUND_CANCELLING", "ITERATIVE_DIFFERENTIAL", "JOINT_FIT"]


def _solve_as(name: str, task: Task) -> TechniqueResult:
    # imported where a fit is asked for: plans of single frames go without
    from inference.fits.answer.likelihood_answer import likelihood_answer

    return likelihood_answer(name, task)


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
    same_as="joint_fit",
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
    same_as="joint_fit",
    obstacle=_cancelling_obstacle,
)
