"""Where a frame and what is known before it agree: all modes along the range, and their mass."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.candidates import TrackCandidates
from inference.tracking.frame_density import Prior, TrackedFrame, log_density
from inference.tracking.mode_integration import integrate
from inference.tracking.mode_refinement import PeakedMode
from inference.tracking.mode_search import ModeBracket, mode_by_differences, mode_of_plain
from inference.tracking.parts import Nodes, nodes_for
from inference.tracking.places import Scan
from inference.tracking.readings_table import ReadingsTable, nuisance_count
from inference.tracking.roots import UNIT, add_root
from simulator.compiled import compiled

__all__ = ["Scanned", "find_candidates", "scanned_for"]

Array = NDArray[np.float64]

_REACH = 7.0  # standard deviations of a prediction that are searched


class Scanned(NamedTuple):
    """Places that were looked at, the log density there, and nodes; overwritten."""

    positions: Array
    densities: Array
    nodes: Nodes


@compiled
def scanned_for(scan: Scan) -> Scanned:
    """Return room for all places of a scan and both ends."""
    size = scan.positions.size + 3
    return Scanned(np.empty(size), np.empty(size), nodes_for())


@compiled
def _places_within(
    low: float, high: float, table: ReadingsTable, scan: Scan, positions: Array
) -> int:
    """Fill both ends and the places of a scan between them; their number."""
    k = scan.next_one[min(max(int((low - table.start) / table.step), 0), scan.next_one.size - 1)]
    positions[0] = low
    points = 1
    while k < scan.positions.size and scan.positions[k] < high:
        if scan.positions[k] > low:
            positions[points] = scan.positions[k]
            points += 1
        k += 1
    positions[points] = high
    return points + 1


@compiled
def _mode_within(
    bracket: ModeBracket, width: float, frame: TrackedFrame, prior: Prior, table: ReadingsTable
) -> tuple[float, float]:
    """Return a mode and its scale; ``width`` is that of the prior."""
    plain = table.noise.plain and not table.by_rate
    if plain and not (prior.position.born and nuisance_count(table) > 0):
        root = add_root(UNIT, prior.added.root)
        return mode_of_plain(bracket, frame, prior, root, table)
    scale = min(width, bracket.high - bracket.low)
    return mode_by_differences(bracket, scale, frame, prior, table)


@compiled
def find_candidates(
    to: TrackCandidates,
    count: int,
    parent: int,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
    scan: Scan,
    scanned: Scanned,
) -> int:
    """Append every mode of a frame under one prior to a list.

    Parameters
    ----------
    to : TrackCandidates
        The list; where it is full, its lightest member gives way.
    count : int
        Its length so far.
    parent : int
        As in `TrackCandidate`.
    frame, prior, table
        As for `log_density`.
    scan : Scan
        Where to look from.
    scanned : Scanned
        Overwritten.

    Returns
    -------
    int
        The new length.
    """
    position = prior.position
    low, high, width = table.start, table.end, table.end - table.start
    if not position.born:
        width = 1.0 / math.sqrt(position.precision)
        low = max(low, position.centre - _REACH * width)
        high = min(high, position.centre + _REACH * width)
        if not low < high:  # gone beyond the support
            return count
    at, logs = scanned.positions, scanned.densities
    points = _places_within(low, high, table, scan, at)
    if points <= 3 and not position.born:
        # with one knot within reach the curve is near straight over all of it
        start = min(max(position.centre, low), high)
        u, scale = _mode_within(ModeBracket(start, low, high), width, frame, prior, table)
        return integrate(
            to, count, parent, PeakedMode(u, scale, low, high), frame, prior, table, scanned.nodes
        )
    for j in range(points):
        logs[j] = log_density(at[j], frame, prior, table)
    valley = 0
    for j in range(points):
        before = logs[j - 1] if j > 0 else -math.inf
        after = logs[j + 1] if j + 1 < points else -math.inf
        if not before <= logs[j] > after:
            continue
        last = j
        while last + 1 < points and logs[last + 1] <= logs[last]:
            last += 1
        bracket = ModeBracket(at[j], at[max(j - 1, 0)], at[min(j + 1, points - 1)])
        u, scale = _mode_within(bracket, width, frame, prior, table)
        mode = PeakedMode(u, scale, at[valley], at[last])
        valley = last
        count = integrate(to, count, parent, mode, frame, prior, table, scanned.nodes)
    return count
