"""How far the ranges of a phase are searched: as many turns of it as the scene's ranges hold."""

import math

from inference.known import Known
from inference.technique import Task
from simulator.scene import Reference, Scene, Stroke
from simulator.sensor import Sensor, SineWaveSensor

__all__ = [
    "MOST_HALF_TURNS",
    "contact_m",
    "half_turns",
    "often_beyond",
    "several_turns",
    "turns_to",
]

MOST_HALF_TURNS = 1000.0
"""Half turns of phase of which a frame may have a root each."""

_SLACK = 1e-9  # of a turn: what ends where phases begin anew holds no second one
_CONTACT = 1e-6  # of a turn, in place of a range of zero
_ONE_IN_100 = 2.326  # standard deviations that one of a hundred is beyond


def several_turns(sensor: Sensor, known: Known, turn_m: float) -> bool:
    """Tell whether the ranges that a scene states hold several of the same phase.

    Parameters
    ----------
    sensor : Sensor
        Of a pulse none has another's readings.
    known : Known
        Of the scene. Where it leaves ``range_m`` out, the first turn is meant.
    turn_m : float
        After which readings begin anew [m].
    """
    end = known.stated_end_m
    return isinstance(sensor, SineWaveSensor) and end is not None and end > turn_m * (1 + _SLACK)


def often_beyond(sensor: Sensor, scene: Scene, known: Known) -> bool:
    """Tell whether fits over many frames have to look beyond the first turn of phase.

    Of the few frames that a law without an end has beyond it they say misfit.

    Parameters
    ----------
    known : Known
        Of the scene.

    Returns
    -------
    bool
        False of a law without an end that is beyond once in a hundred or less.
    """
    turn_m, law = sensor.max_range_m, scene.range_m
    if not several_turns(sensor, known, turn_m):
        return False
    if law is None or isinstance(law, Reference | Stroke) or known.support[1] < math.inf:
        return True
    return float(law.distribution().from_normal(_ONE_IN_100)) > turn_m


def turns_to(task: Task, turn_m: float) -> float:
    """Return up to where the roots of a phase are searched [m].

    Parameters
    ----------
    task : Task
        Its own end goes before all.
    turn_m : float
        After which readings begin anew [m].

    Returns
    -------
    float
        One turn, or the end of the scene's ranges where that is beyond. A turn more where that
        end is a sharp one: noise may have moved a root out, and it is put back there.
    """
    if task.high_m is not None:
        return task.high_m
    if not several_turns(task.sensor, task.known, turn_m):
        return turn_m
    end = task.known.stated_end_m
    assert end is not None  # noqa: S101  # there are several turns
    return end + turn_m if task.known.support[1] < math.inf else end


def contact_m(task: Task, turn_m: float) -> float | None:
    """Return where an object is whose phase noise has put below zero, beside its aliases [m].

    Parameters
    ----------
    task : Task
        Whose ranges hold several turns.
    turn_m : float
        After which readings begin anew [m].

    Returns
    -------
    float or None
        The nearest range that the scene allows; None where that has no phase near zero.
    """
    if not task.physical or task.high_m is not None:
        return None
    if not several_turns(task.sensor, task.known, turn_m):
        return None
    nearest = task.known.support[0]
    return max(nearest, _CONTACT * turn_m) if nearest < turn_m / 2 else None


def half_turns(sensor: Sensor, known: Known) -> float:
    """Return the half turns of phase that the stated ranges hold; 0 of a pulse or of none."""
    if not isinstance(sensor, SineWaveSensor) or known.stated_end_m is None:
        return 0.0
    return sensor.wave_number * known.stated_end_m / math.pi
