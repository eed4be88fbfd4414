"""How far the ranges of a phase are searched: as many turns of it as the scene's ranges hold."""

import math

from inference.known import Known
from inference.technique import Task
from simulator.sensor import Sensor, SineWaveSensor

__all__ = ["MOST_HALF_TURNS", "contact_m", "half_turns", "several_turns", "turns_to"]

MOST_HALF_TURNS = 1000.0
"""Half turns of phase of which a frame may have a root each."""

_SLACK = 1e-9  # of a turn: what ends where phases begin anew holds no second one
_CONTACT = 1e-6  # of a turn, in place of a range of zero


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
