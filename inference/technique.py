"""The template of a technique, of single frames and of many alike."""

import dataclasses
from collections.abc import Callable
from typing import Literal

from inference.estimates import TechniqueResult
from inference.known import Known
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Kind", "Task", "Technique"]

Kind = Literal["pulsed", "sine_wave"]


@dataclasses.dataclass(frozen=True, eq=False)
class Task:
    """What a technique is given.

    Attributes
    ----------
    sensor, scene, frames
        The request.
    known : Known
        The scene's known numbers.
    physical : bool
        Whether roots are filtered: the technique's own interval, the scene's ``range_m``, a
        non-negative object, a background between nothing and its known strength.
    high_m : float, optional
        Upper end of the interval searched, in place of the technique's own [m].
    exact : bool
        Whether the model is taken as exact, whatever the scene says of its error: what asks for
        the noise's part alone has its own way to the model's.
    around : tuple of (Task, Task)
        The same a standard deviation off to either side, a pair for each independent direction of
        the scene's joint law: what a filter of roots must leave open.
    """

    sensor: Sensor
    scene: Scene
    frames: Frames
    known: Known
    physical: bool = True
    high_m: float | None = None
    exact: bool = False
    around: tuple[tuple["Task", "Task"], ...] = ()


def _told_apart(sensor: Sensor) -> float:
    """Return where the readings of a delay end or begin anew, r0 or c/2f [m]."""
    return sensor.max_range_m


@dataclasses.dataclass(frozen=True)
class Technique:
    """One technique: what it needs, what it is immune to, what it costs, how it is solved.

    Attributes
    ----------
    name : str
        Its name in docs/techniques.md.
    kinds : tuple of str
        Sensors that it serves.
    observables : str
        What it uses of a frame.
    needs : tuple of str
        Scene paths that must be known numbers.
    immune_to : tuple of "crosstalk", "background", "discrepancy"
        What may be present without being known (Table 4.1), of a discrepancy that of the flux;
        tests/contract holds it to it.
    uses_background : bool
        Whether the scene must have a background.
    differential : bool
        Whether it uses derivatives in time.
    cost : float
        Time a frame relative to ``conventional`` of a pulse, measured by benchmarks/realtime.py.
    equations : str
        Where it comes from.
    roots : str
        How many roots it has, and when.
    solve : callable
        Task -> TechniqueResult; a technique of many frames raises RefusedError where the frames
        turn out not to determine what is unknown.
    farthest_m : callable
        Sensor -> the range beyond which it has no answer, whatever the scene [m].
    obstacle : callable, optional
        (sensor, scene, known, frames or None) -> a further reason why it cannot serve, or None. Of
        frames it asks how many there are, which columns they have, and which of them are ruled out.
    same_as : str, optional
        The technique whose answer it gives by another name: a request for both solves once.
    """

    name: str
    kinds: tuple[Kind, ...]
    observables: str
    needs: tuple[str, ...]
    immune_to: tuple[str, ...]
    uses_background: bool
    differential: bool
    cost: float
    equations: str
    roots: str
    solve: Callable[[Task], TechniqueResult]
    farthest_m: Callable[[Sensor], float] = _told_apart
    obstacle: Callable[[Sensor, Scene, Known, Frames | None], str | None] | None = None
    same_as: str | None = None
