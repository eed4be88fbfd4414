"""What hypotheses owe to the width of their predictions, where motion is smoother than stated.

A reading that does not move much is more likely where it hardly could, on the flatter branch of the
curve. Of motion as rough as stated that is evidence, anew in every frame. Of smoother motion all
branches predict every frame far better than they claim, and the same ratio of slopes would be
counted a hundred times: the flatter branch would be sure, and wrong as often as not.
"""

import math

from inference.tracking.borrowed import borrowed
from inference.tracking.candidates import TrackCandidates
from inference.tracking.frame_density import Prior, TrackedFrame, log_density
from inference.tracking.readings_table import ReadingsTable
from inference.tracking.roots import UNIT, add_root
from simulator.compiled import compiled

__all__ = ["ROUGH", "counted_widths", "even_out", "log_total", "take_width"]

ROUGH = 0.15
"""Surprise of late from which on motion counts as rough as stated; no frame counts above 1.

Of such motion the mean is 0.52, and over the last four frames below this in about one of a hundred.
"""


@compiled
def counted_widths(roughness: float) -> float:
    """Return the share of the widths that counts, from the running surprise of late."""
    return min(1.0, roughness / ROUGH)


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


@borrowed
@compiled
def take_width(
    of: TrackCandidates,
    first: int,
    last: int,
    counted: float,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
) -> None:
    """Take from the candidates of one hypothesis what does not count of their width.

    That is the density integrated over u against its top, both relative to the prediction's: the
    ratio of standard deviations after and before the frame, where all is normal.

    Parameters
    ----------
    of, first, last : TrackCandidates, int, int
        The list, and the hypothesis's part of it.
    counted : float
        Share that counts.
    frame, prior, table
        As for `log_density`.
    """
    top = -math.inf
    for j in range(first, last):
        top = max(top, log_density(of.mode[j], frame, prior, table))
    if top == -math.inf:
        return
    flat = -0.5 * math.log(prior.position.precision) + 0.5 * math.log(2.0 * math.pi)
    # what the crosstalk and nuisance parameters add is part of the prediction's width too
    root = add_root(UNIT, prior.added.root)
    width = log_total(of, first, last) - top - flat - math.log(root.r11 * root.r22)
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
