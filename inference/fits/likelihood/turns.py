"""The ranges that fits over many frames look at, and parts of them with one range of each phase."""

from inference.known import known_of
from inference.realtime.turns import often_beyond
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["MOST_TURNS", "ranges_of", "turns_of", "windows_of"]

Ends = tuple[float, float]

MOST_TURNS = 4.0
"""Turns of phase that the ranges of a fit hold at most.

Of a frame eight ranges are kept (`inference.fits.likelihood.frame_modes.MOST`), and before a wall
there may be two a turn.
"""

_NEXT = 0.5  # of a window, by which the next one begins farther
_SLACK = 1e-9  # of a turn: what ends where phases begin anew holds no second one


def _stated(sensor: Sensor, scene: Scene, support: Ends) -> Ends | None:
    """Return the ranges of a scene that go on beyond the first turn, None of those that do not."""
    known = known_of(scene, sensor)
    if not often_beyond(sensor, scene, known) or known.stated_end_m is None:
        return None
    return support[0], min(support[1], known.stated_end_m)


def turns_of(sensor: Sensor, scene: Scene, support: Ends) -> float:
    """Return how many turns of phase the stated ranges hold; 1 where the first one is meant.

    Parameters
    ----------
    support : (float, float)
        Of the prior of the ranges [m].
    """
    stated = _stated(sensor, scene, support)
    return 1.0 if stated is None else (stated[1] - stated[0]) / sensor.max_range_m


def ranges_of(sensor: Sensor, scene: Scene, support: Ends) -> Ends:
    """Return the ranges that a fit looks at [m].

    Parameters
    ----------
    support : (float, float)
        Of the prior of the ranges [m].

    Returns
    -------
    (float, float)
        Up to r0 or c/2f; up to their end where the stated ones go on beyond, unless they hold more
        than `MOST_TURNS`, which no joint fit serves: a posterior then begins in the first turn.
    """
    near, far = support[0], min(support[1], sensor.max_range_m)
    stated = _stated(sensor, scene, support)
    if stated is not None and turns_of(sensor, scene, support) <= MOST_TURNS:
        near, far = stated
    return max(near, far * 1e-6), far


def windows_of(support: Ends, turn_m: float) -> list[Ends]:
    """Return parts of ranges: windows of one turn of phase, of two, and so on, half overlapping.

    In one of a turn every frame has one range. Which turn each frame is of is a choice, and a start
    whose frames are of wrong ones climbs to where these are explained: a search of all ranges at
    once missed one in ten objects that were wholly beyond the first turn.

    Parameters
    ----------
    support : (float, float)
        The ranges [m].
    turn_m : float
        A turn of phase [m].

    Returns
    -------
    list of (float, float)
        Ends of the windows [m]; none where the ranges are within one turn.
    """
    low, high = support
    found: list[Ends] = []
    width, slack = turn_m, _SLACK * turn_m
    while high - low > width + slack:
        first, last = low, low + width
        while last < high - slack:
            found.append((first, last))
            first += _NEXT * width
            last = first + width
        found.append((high - width, high))
        width *= 2.0
    return found
