"""Objects too faint to be told from an empty scene, however many frames show their light.

An error of the empty scene's readings is the same in all frames: of crosstalk that was measured
once, of a calibrated scene. Taken as new in every frame it would be ever less likely, and light
that is no larger than it ever more surely an object's. So no number of frames makes such an object
likelier than none.

docs/model.md, too-faint, has the rule.
"""

import math

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    COUNT,
    Hypotheses,
    U,
    learns_crosstalk,
    variance_of,
)
from inference.tracking.lasting import STATED
from inference.tracking.places import Places
from inference.tracking.readings_table import FIRST, SECOND, ReadingsTable, mean_at, noise_root
from inference.tracking.roots import UNIT, Root, add_factor, solve
from simulator.compiled import compiled

__all__ = ["MOST_EMPTY", "doubt_the_faint"]

_ABOVE = 9.0  # squared standard deviations: crosstalk is as far off in one scene of 90
_CHANGES = 100.0  # squared noise: brighter objects show that they are there as they move
_REACH = 2.0  # standard deviations of log r within which an object's light is taken at its least
_SURPRISE = 100.0  # of the empty scene: light of 3 sd and noise of 7 beside it are less surprising
MOST_EMPTY = 2.0 / 3.0
"""Least share of the empty scene in its own weight and that of all such objects."""


@compiled
def _noise(gain: float, table: ReadingsTable, places: Places) -> Root:
    """Return the root of the covariance of the noise of an empty scene's readings."""
    if table.noise.plain:
        return UNIT
    m1 = gain * places.empty[FIRST, 0] + table.crosstalk1
    m2 = gain * places.empty[SECOND, 0] + table.crosstalk2
    return noise_root(m1, m2, 0.0, 0.0, table.noise)


@compiled
def _shared(noise: Root, gain: float, places: Places) -> Root:
    """Return the root of the covariance by which these readings err in all frames."""
    root = Root(STATED * noise.r11, STATED * noise.r21, STATED * noise.r22)
    for j in range(1, places.empty.shape[1]):
        root = add_factor(root, gain * places.empty[FIRST, j], gain * places.empty[SECOND, j])
    return root


@compiled
def _square(root: Root, first: float, second: float) -> float:
    """Return the squared length of a vector in units of a root."""
    pull1, pull2 = solve(root, first, second)
    return first * pull1 + second * pull2


@borrowed
@compiled
def doubt_the_faint(
    frame: TrackedFrame, of: Hypotheses, table: ReadingsTable, places: Places, surprise: float
) -> None:
    """Keep objects whose light may be an error of the empty scene less likely than that scene.

    Not where the range is known, and not where crosstalk is learnt: the empty scene then has an
    error of its own that lasts.

    Parameters
    ----------
    frame : TrackedFrame
        A frame that has been weighed.
    of : Hypotheses
        After the frame; the weights are changed in place.
    table, places : ReadingsTable, Places
        The scene.
    surprise : float
        Normalised innovation squared of the empty scene.
    """
    if surprise > _SURPRISE or frame.known_rate > 0.0 or table.by_rate or learns_crosstalk(of):
        return
    weight, count = of.weight, int(of.numbers[COUNT])
    gain, faint = frame.gain, 0.0
    noise = _noise(gain, table, places)
    shared = _shared(noise, gain, places)
    bare1, bare2 = places.empty[FIRST, 0], places.empty[SECOND, 0]
    for j in range(1, count + 1):
        u = min(of.x[j, U] + _REACH * math.sqrt(variance_of(of, j, U)), table.end)
        value1, value2, _, _ = mean_at(u, table)
        light1, light2 = gain * (value1 - bare1), gain * (value2 - bare2)
        within = _square(shared, light1, light2) < _ABOVE
        if within and _square(noise, light1, light2) < _CHANGES:
            faint += weight[j]
            weight[j] = -weight[j]  # marked
    both, share = weight[0] + faint, 1.0
    if weight[0] < MOST_EMPTY * both:
        weight[0] = MOST_EMPTY * both
        share = (1.0 - MOST_EMPTY) * both / faint
    for j in range(1, count + 1):
        if weight[j] < 0.0:
            weight[j] *= -share
