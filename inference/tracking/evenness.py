"""What hypotheses owe to the width of their predictions, where motion is smoother than stated.

A reading that does not move much is more likely where it hardly could, on the flatter branch of the
curve. Of motion as rough as stated that is evidence, anew in every frame. Of smoother motion all
branches predict every frame far better than they claim, and the same ratio of slopes would be
counted a hundred times: the flatter branch would be sure, and wrong as often as not.

So would an empty scene whose crosstalk is still to be learnt. Light that stays as it is may be
crosstalk, or crosstalk and an object at rest. By the motion that is stated the latter is less
likely with every frame, though none of them tells the two apart. `inference.tracking.resting` has
what is answered of it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.candidates import TrackCandidates
from inference.tracking.frame_density import Prior, TrackedFrame, log_density
from inference.tracking.hypotheses import (
    ROUGHNESS,
    Hypotheses,
    heaviest,
    learns_crosstalk,
    log_of,
    unknown_crosstalk,
)
from inference.tracking.readings_table import ReadingsTable
from inference.tracking.roots import UNIT, add_root
from simulator.compiled import compiled

__all__ = [
    "ROUGH",
    "counted_widths",
    "even_out",
    "hides",
    "let_rest",
    "level_at_rest",
    "log_at_rest",
    "log_total",
    "take_width",
]

Array = NDArray[np.float64]

ROUGH = 0.15
"""Surprise of late from which on motion counts as rough as stated; no frame counts above 1.

Of such motion the mean is 0.52, and over the last four frames below this in about one of a hundred.
"""

_LEARNT = 0.5  # share of the widths that counts of motion as rough as its law, crosstalk learnt
_HIDDEN = 10.0  # variance of a reading by crosstalk, in that of the noise: light may be of either
# nats by which a frame of an object at rest may fit worse than the best and tell nothing: by noise
# alone two readings do once in 400
_SAME_READINGS = 6.0
_LOG_RESTING = math.log(0.25)  # least weight of an object that may rest, against the empty scene's


@compiled
def counted_widths(of: Hypotheses) -> float:
    """Return the share of the widths that counts, from the running surprise of late.

    While crosstalk is learnt and not known to the noise of a frame, by the heaviest hypothesis, the
    law of the motion is wide (`inference.tracking.turning`), and motion mostly far smoother: as far
    as it is, widths say nothing of the curve.
    """
    roughness = of.numbers[ROUGHNESS]
    counted = float(min(1.0, roughness / ROUGH))
    if not learns_crosstalk(of):
        return counted
    unknown = unknown_crosstalk(of, heaviest(of))
    return float((counted + unknown * _LEARNT * roughness) / (1.0 + unknown))


@compiled
def log_total(of: TrackCandidates, first: int, last: int) -> float:
    """Return the log of the sum of all masses from one place to another."""
    best, total = -math.inf, 0.0
    for j in range(first, last):
        best = max(best, of.log_mass[j])
    if best == -math.inf:
        return best
    for j in range(first, last):
        total += math.exp(of.log_mass[j] - best)
    return best + math.log(total)


@compiled
def hides(of: Hypotheses, row: int) -> bool:
    """Tell whether learnt crosstalk is so little known that its light may be the object's."""
    return unknown_crosstalk(of, row) > _HIDDEN


@borrowed
@compiled
def log_at_rest(
    of: TrackCandidates,
    first: int,
    last: int,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
) -> float:
    """Return the log mass that the candidates of one hypothesis had, were there no motion.

    Parameters
    ----------
    of, first, last : TrackCandidates, int, int
        The list, and the hypothesis's part of it.
    frame, prior, table
        As for `log_density`.
    """
    top = -math.inf
    for j in range(first, last):
        top = max(top, log_density(of.mode[j], frame, prior, table))
    flat = -0.5 * math.log(prior.position.precision) + 0.5 * math.log(2.0 * math.pi)
    # what the crosstalk and nuisance parameters add is part of the prediction's width too
    root = add_root(UNIT, prior.added.root)
    return top + flat + math.log(root.r11 * root.r22)


@borrowed
@compiled
def take_width(of: TrackCandidates, first: int, last: int, counted: float, at_rest: float) -> None:
    """Take from the candidates of one hypothesis what does not count of their width.

    That is the density integrated over u against its top, both relative to the prediction's: the
    ratio of standard deviations after and before the frame, where all is normal.

    Parameters
    ----------
    of, first, last : TrackCandidates, int, int
        The list, and the hypothesis's part of it.
    counted : float
        Share that counts.
    at_rest : float
        As of `log_at_rest`.
    """
    if at_rest == -math.inf:
        return
    width = log_total(of, first, last) - at_rest
    for j in range(first, last):
        of.log_mass[j] -= (1.0 - counted) * width


@borrowed
@compiled
def even_out(of: TrackCandidates, last: int, log_before: float) -> None:
    """Give the candidates the sum that they had together: only their shares change."""
    change = log_before - log_total(of, 0, last)
    if math.isfinite(change):
        for j in range(last):
            of.log_mass[j] += change


@compiled
def _log_total_of(of: TrackCandidates, last: int, parent: int) -> float:
    """Return the log of the sum of the masses of one hypothesis's candidates."""
    total = -math.inf
    for j in range(last):
        if of.parent[j] == parent:
            total = np.logaddexp(total, of.log_mass[j])
    return total


@borrowed
@compiled
def level_at_rest(
    candidates: TrackCandidates, last: int, of: Hypotheses, at_rest: Array, log_usual: float
) -> None:
    """Let frames that are the first one over again leave objects at rest their shares.

    Where an object at rest is bright its motion takes up more of the noise, and its readings fit
    better, by up to half a nat in every frame: the nearest would be sure, and none of them tells.
    All fit as they do in the mean, so that nothing changes against the empty scene.

    Parameters
    ----------
    candidates, last : TrackCandidates, int
        The list, and its length; masses are changed in place.
    of : Hypotheses
        As predicted.
    at_rest : ndarray, shape (hypotheses + 1,)
        As for `let_rest`; changed in place.
    log_usual : float
        Log of the probability that a frame is no outlier.
    """
    log_sum, log_before, log_own = -math.inf, -math.inf, -math.inf
    for h in range(at_rest.size):
        if at_rest[h] > -math.inf:
            log_sum = np.logaddexp(log_sum, at_rest[h])
            log_before = np.logaddexp(log_before, log_of(of.weight[h]) + log_usual)
            log_own = np.logaddexp(log_own, _log_total_of(candidates, last, h))
    if log_sum == -math.inf:
        return
    mean = log_before - log_sum
    for h in range(at_rest.size):
        if at_rest[h] > -math.inf:
            before = log_of(of.weight[h]) + log_usual
            worse = max(before - at_rest[h] - mean - _SAME_READINGS, 0.0)
            at_rest[h] = before - mean - worse
            own = _log_total_of(candidates, last, h)
            for j in range(last):
                if candidates.parent[j] == h:
                    candidates.log_mass[j] += before + log_own - log_before - worse - own


@borrowed
@compiled
def let_rest(
    of: TrackCandidates, last: int, at_rest: Array, highest: float, log_empty: float
) -> None:
    """Keep objects that may rest beside an empty scene that explains the frame no better.

    Parameters
    ----------
    of, last : TrackCandidates, int
        The list; masses of those that are kept grow.
    at_rest : ndarray, shape (hypotheses + 1,)
        For every hypothesis that the crosstalk hides its log mass, were there no motion and its
        density at best 1.
    highest : float
        Log of what that density is at best.
    log_empty : float
        Log mass of the empty scene.
    """
    log_rest = -math.inf
    for h in range(at_rest.size):
        log_rest = np.logaddexp(log_rest, at_rest[h])
    if log_rest == -math.inf:
        return
    change = min(log_empty + _LOG_RESTING - (highest + log_rest), 0.0)
    # the heaviest candidate of a hypothesis takes what all of it would have
    for h in range(at_rest.size):
        top = -1
        for j in range(last):
            if of.parent[j] == h and (top < 0 or of.log_mass[j] > of.log_mass[top]):
                top = j
        if top >= 0:
            of.log_mass[top] = max(of.log_mass[top], highest + at_rest[h] + change)
