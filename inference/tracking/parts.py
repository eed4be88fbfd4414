"""One mode along the range that is not near a Gaussian, divided into parts that are.

Beside crosstalk that is open by much more than the noise a first frame tells no range: whatever
light there is, the crosstalk makes up for it, and range and crosstalk lie on a curve as long as the
ranges go. A hypothesis is a straight piece of it. What the second and third frame tell beside is
told in full by a piece that is short. Of one that is long, they are taken for what they would tell
if the curve were straight: crosstalk was known to a percent within six frames, and wrong by
hundreds of noises, with nothing wrong in the readings. So there the parts are fine.

docs/model.md, learnt-first, has what they have to be.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.candidates import TrackCandidate, TrackCandidates, add_candidate
from inference.tracking.frame_density import Prior, TrackedFrame, log_density
from inference.tracking.mode_refinement import PeakedMode
from inference.tracking.mode_search import edge
from inference.tracking.readings_table import ReadingsTable
from inference.tracking.roots import Root
from simulator.compiled import compiled

__all__ = ["MOST_PARTS", "Nodes", "divide", "is_open", "nodes_for"]

Array = NDArray[np.float64]

_WINDOWS = 9
_SPACING = 0.5  # of windows, in standard deviations, and their width
_FIRST = -2.0  # of them, in standard deviations
_NEGLIGIBLE_WINDOW = 1e-3  # share of a mode below which a window's part is left out
_INTERVALS = 32  # of Simpson's rule on either side of a mode
MOST_PARTS = 48  # fine ones
_FINE = 0.07  # spacing of fine windows, log range
_FINE_INTERVALS = 128
_FINE_REACH = 3.0  # standard deviations as far as they go
_FINE_WINDOWS = 6  # on either side of the nearest one that are looked at
_FINE_NEGLIGIBLE = 1e-5  # a fine part has less of a mode
_OPEN = 10.0  # standard deviations of the noise from which on crosstalk is open


class Nodes(NamedTuple):
    """Distances from a mode, and the masses there; overwritten."""

    aways: Array
    masses: Array
    # the windows at one of them, and of what is in each the mass, first and second moment
    windows: Array
    shares: Array
    shifts: Array
    squares: Array


class Windows(NamedTuple):
    """Windows in a row, in standard deviations from the mean of a mode."""

    first: float  # the middle of the first
    spacing: float  # between them, and their width
    number: int
    reach: int  # windows that are this many further than the nearest one hold nothing


@compiled
def nodes_for() -> Nodes:
    """Return room for both sides of a mode."""
    size = 2 * _FINE_INTERVALS + 2
    parts = MOST_PARTS
    return Nodes(
        np.empty(size),
        np.empty(size),
        np.empty(parts),
        np.empty(parts),
        np.empty(parts),
        np.empty(parts),
    )


@compiled
def is_open(root: Root) -> bool:
    """Tell whether crosstalk of this covariance is open by much more than the noise."""
    return max(root.r11, math.hypot(root.r21, root.r22)) > _OPEN


@compiled
def _simpson(
    nodes: Nodes,
    intervals: int,
    top: float,
    mode: PeakedMode,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
) -> tuple[float, float, float]:
    """Fill distances from a mode and their masses; their sum, mean and standard deviation."""
    aways, masses = nodes.aways, nodes.masses
    u, scale = mode.u, mode.scale
    begin = edge(u, top, mode.low, scale, frame, prior, table)
    end = edge(u, top, mode.high, scale, frame, prior, table)
    total, mean, square = 0.0, 0.0, 0.0
    for side in range(2):
        width = ((begin if side == 0 else end) - u) / intervals
        for k in range(intervals + 1):
            weight = 1.0 if k in (0, intervals) else (4.0 if k % 2 == 1 else 2.0)
            away = k * width
            density = log_density(u + away, frame, prior, table)
            part = weight * abs(width) / 3.0 * math.exp(min(density - top, 50.0))
            row = side * (intervals + 1) + k
            aways[row], masses[row] = away, part
            total += part
            mean += part * away
            square += part * away * away
    if not total > 0.0:
        return 0.0, 0.0, 0.0
    mean /= total
    return total, mean, math.sqrt(max(square / total - mean * mean, 0.0))


@compiled
def _fine_windows(begin: float, end: float, sd: float) -> Windows:
    """Return fine windows between two ends, in standard deviations from the mean."""
    first, last = max(begin, -_FINE_REACH), min(end, _FINE_REACH)
    spacing = max(_FINE / sd, (last - first) / (MOST_PARTS - 1))
    return Windows(
        first, spacing, min(math.ceil((last - first) / spacing) + 1, MOST_PARTS), _FINE_WINDOWS
    )


@compiled
def _share_out(nodes: Nodes, size: int, mean: float, sd: float, windows: Windows) -> None:
    """Fill mass, first and second moment [standard deviations] of the part in every window.

    The windows at a place are taken against the nearest one: far out all are below what numbers
    hold.
    """
    weights, shares, shifts, squares = nodes.windows, nodes.shares, nodes.shifts, nodes.squares
    for window in range(windows.number):
        shares[window], shifts[window], squares[window] = 0.0, 0.0, 0.0
    for row in range(size):
        x = (nodes.aways[row] - mean) / sd
        at = (x - windows.first) / windows.spacing
        nearest = min(max(round(at), 0), windows.number - 1)
        away, total = at - nearest, 0.0
        first = max(nearest - windows.reach, 0)
        last = min(nearest + windows.reach, windows.number - 1)
        for window in range(first, last + 1):
            off = at - window
            weights[window] = math.exp(0.5 * (away * away - off * off))
            total += weights[window]
        for window in range(first, last + 1):
            part = nodes.masses[row] * (weights[window] / total)
            shares[window] += part
            shifts[window] += part * x
            squares[window] += part * x * x


@compiled
def divide(
    to: TrackCandidates,
    count: int,
    parent: int,
    mode: PeakedMode,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
    nodes: Nodes,
) -> int:
    """Append one mode that is not near a Gaussian, as at folds and ends of the support.

    Simpson's rule gives its moments. It is then divided by smooth windows, half a standard
    deviation apart, into parts that are near enough to Gaussians.

    Parameters are those of `inference.tracking.mode_integration.integrate`.
    """
    u = mode.u
    top = log_density(u, frame, prior, table)
    finely = prior.position.alone and is_open(prior.added.own)
    intervals = _FINE_INTERVALS if finely else _INTERVALS
    total, mean, sd = _simpson(nodes, intervals, top, mode, frame, prior, table)
    if not total > 0.0:
        return count
    if not sd > 0.0:
        log_mass = top + math.log(total)
        return add_candidate(to, count, TrackCandidate(log_mass, u + mean, sd, u + mean, parent))
    windows, least = Windows(_FIRST, _SPACING, _WINDOWS, _WINDOWS), _NEGLIGIBLE_WINDOW
    size = 2 * intervals + 2
    if finely and _SPACING * sd > _FINE:
        begin, end = nodes.aways[intervals], nodes.aways[size - 1]
        windows, least = _fine_windows((begin - mean) / sd, (end - mean) / sd, sd), _FINE_NEGLIGIBLE
    _share_out(nodes, size, mean, sd, windows)
    for window in range(windows.number):
        share, shift, square = nodes.shares[window], nodes.shifts[window], nodes.squares[window]
        if share > least * total:
            shift /= share
            own = sd * math.sqrt(max(square / share - shift * shift, 0.0))
            at = u + mean + sd * shift
            one = TrackCandidate(top + math.log(share), at, own, at, parent)
            count = add_candidate(to, count, one)
    return count
