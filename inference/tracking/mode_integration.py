"""The mass of one mode along the range, as one Gaussian or as several."""

import math

from inference.tracking.candidates import TrackCandidate, TrackCandidates, add_candidate
from inference.tracking.frame_density import Prior, TrackedFrame, log_density, spread_at
from inference.tracking.hypotheses import WITHOUT_CROSSTALK
from inference.tracking.mode_refinement import PeakedMode, bends, refined
from inference.tracking.parts import Nodes, divide
from inference.tracking.readings_table import ReadingsTable, mean_at
from inference.tracking.roots import Root
from simulator.compiled import compiled

__all__ = ["integrate"]

_GAUSSIAN = 0.3  # nats by which a mode may leave its parabola at sqrt(3) standard deviations
_FAINT = 0.3  # standard deviations of the noise: nuisance parameters that do less are not felt
_DROWNED = 1.0  # standard deviations of the noise: it hides nuisance parameters that do less
_TAIL = 6.0  # standard deviations from a mode at which the noise may hold it open
_OPEN = 0.5  # share of its parabola's fall that is less than a mode's with such a tail
_NARROW = 0.03  # standard deviation of log r of modes that have none: their light is not faint
_ROOT3 = math.sqrt(3.0)
_LOG_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)


@compiled
def _by_noise(
    u: float, most: float, frame: TrackedFrame, prior: Prior, table: ReadingsTable
) -> bool:
    """Tell whether nuisance parameters do less to a frame than its noise, as of a faint object.

    Its density is then as wide as the noise makes it, which comes anew with every frame.
    """
    X = prior.added.spread
    if prior.position.born or X.shape[0] > WITHOUT_CROSSTALK:
        return False
    _, _, d1, d2 = mean_at(u, table)
    felt = spread_at(Root(0.0, 0.0, 0.0), u, frame.gain, (d1, d2), X, table)
    return felt.r11 < most and math.hypot(felt.r21, felt.r22) < most


@compiled
def _fades(mode: PeakedMode, frame: TrackedFrame, prior: Prior, table: ReadingsTable) -> bool:
    """Tell whether a mode goes over into ranges at which the object drowns in the noise.

    There the density hardly falls, however narrow the mode is where the light is seen, and they may
    hold as much as the mode.
    """
    if prior.position.born or mode.scale < _NARROW:
        return False
    top = log_density(mode.u, frame, prior, table)
    for end in (mode.low, mode.high):
        away = min(_TAIL * mode.scale, abs(end - mode.u))
        tail = mode.u + math.copysign(away, end - mode.u)
        scales = away / mode.scale
        fall = top - log_density(tail, frame, prior, table)
        held = fall < 0.5 * _OPEN * scales * scales
        if held and _by_noise(tail, _DROWNED, frame, prior, table):
            return True
    return False


@compiled
def _spills(mode: PeakedMode, prior: Prior) -> bool:
    """Tell whether a mode of an object that may be anywhere is cut off before its parabola ends.

    Its light drowns in the noise, or is the crosstalk's as well: the density is flat as far as the
    ranges go, and the parabola would reach far beyond them.
    """
    reach = _ROOT3 * mode.scale
    return prior.position.born and (mode.u - reach < mode.low or mode.u + reach > mode.high)


@compiled
def integrate(
    to: TrackCandidates,
    count: int,
    parent: int,
    mode: PeakedMode,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
    nodes: Nodes,
) -> int:
    """Append one mode between its valleys, with its log mass, mean and standard deviation.

    Three Gauss-Hermite nodes where the mode is near a Gaussian, which is exact to the fifth power
    of the distance.

    Where u is wide because nuisance parameters or crosstalk are uncertain, only the mode is taken,
    but for an object that has just come, or one so faint that the noise hides what they do, there
    or at ranges that the mode goes over into.
    What they do to the readings is linear here, and the curve is not: integrated over a wide
    density, the difference would pass for knowledge of the range, a little in every frame.

    Parameters
    ----------
    to : TrackCandidates
        The list; where it is full, its lightest member gives way.
    count : int
        Its length so far.
    parent : int
        As in `TrackCandidate`.
    mode : PeakedMode
        The mode.
    frame, prior, table
        As for `log_density`.
    nodes : Nodes
        Overwritten.

    Returns
    -------
    int
        The new length.
    """
    u, scale = mode.u, mode.scale
    once = prior.position.born and not prior.position.again
    shared = prior.added.spread.shape[1] > WITHOUT_CROSSTALK
    if shared and not once and not _by_noise(u, _FAINT, frame, prior, table):
        if _spills(mode, prior) or _fades(mode, frame, prior, table):
            return divide(to, count, parent, mode, frame, prior, table, nodes)
        if not prior.position.born and bends(table):
            u, scale, top = refined(mode, frame, prior, table)
        else:
            top = log_density(u, frame, prior, table)
        log_mass = top + math.log(scale) + _LOG_ROOT_2PI
        return add_candidate(to, count, TrackCandidate(log_mass, u, 0.0, u, parent))
    if u - _ROOT3 * scale >= mode.low and u + _ROOT3 * scale <= mode.high:
        top = log_density(u, frame, prior, table)
        left = log_density(u - _ROOT3 * scale, frame, prior, table) - top + 1.5
        right = log_density(u + _ROOT3 * scale, frame, prior, table) - top + 1.5
        if abs(left) < _GAUSSIAN and abs(right) < _GAUSSIAN:
            left, right = math.exp(left), math.exp(right)
            mass = (4.0 + left + right) / 6.0
            shift = _ROOT3 * (right - left) / (6.0 * mass)
            sd = scale * math.sqrt(0.5 * (left + right) / mass - shift * shift)
            log_mass = top + math.log(mass * scale) + _LOG_ROOT_2PI
            one = TrackCandidate(log_mass, u + shift * scale, sd, u, parent)
            return add_candidate(to, count, one)
    return divide(to, count, parent, mode, frame, prior, table, nodes)
