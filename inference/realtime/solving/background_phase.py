"""Background intensity of a sine wave: what the background leaves has the phase of the range.

x - B S(r) e^jkR is the object alone, so its phase less k r is a multiple of 2 pi, or an odd one of
pi where noise makes a faint object negative (docs/model.md, exact).
"""

import math
from typing import NamedTuple

import numpy as np

from inference.realtime.net import Net
from inference.realtime.solving.background_line import (
    Direction,
    ScaledFrame,
    frame_of,
    line_of,
    range_at,
    theta,
    turns_of,
)
from inference.realtime.solving.bracketing import EPSILON, LEAST
from inference.realtime.solving.known_background import Found, KnownBackground
from simulator.background import shadow, shadow_slope
from simulator.compiled import compiled

__all__ = ["End", "Phase", "solve_phase"]


class Phase(NamedTuple):
    """What phases are computed from.

    Attributes
    ----------
    wave : float
        Wave number k, in one over the background's unit of length.
    offset, far : float
        Phase offset, and k R reduced exactly [rad].
    """

    wave: float
    offset: float
    far: float


class End(NamedTuple):
    """What may have moved a root beyond the background, where the search ends.

    Attributes
    ----------
    band : float
        Standard deviations within which a frame is that of an object there.
    late : float
        Standard deviation of the object's phase by errors of the model [rad].
    shadow : float
        That of the readings across the background's direction by errors of the shadow, in units of
        its strength.
    """

    band: float
    late: float
    shadow: float


@compiled
def _length(r: float, frame: ScaledFrame, far: Direction, back: KnownBackground) -> float:
    """Return abs(x - B S(r) e^jkR), which turns an angle into a reading."""
    hidden = frame.b * shadow(r, back.c0, back.c1)
    return math.hypot(frame.x - hidden * far.cosine, frame.y - hidden * far.sine)


@compiled
def _spread(along: Direction, frame: ScaledFrame) -> float:
    """Return the standard deviation of a reading across a direction."""
    cs, sn = along.cosine, along.sine
    variance = sn * sn * frame.v1 + cs * cs * frame.v2 - 2.0 * sn * cs * frame.v12
    return math.sqrt(max(variance, 0.0))


@compiled
def _own_direction(
    r: float, hidden: float, turn: float, frame: ScaledFrame, far: Direction, phase: Phase
) -> Direction:
    """Return the direction of the object's own readings at a root."""
    cs, sn = frame.x - hidden * far.cosine, frame.y - hidden * far.sine
    length = math.hypot(cs, sn)
    if length > 0.0:
        sign = 1.0 if turn % 2.0 == 0.0 else -1.0
        return Direction(sign * cs / length, sign * sn / length)
    angle = phase.wave * r + phase.offset
    return Direction(math.cos(angle), math.sin(angle))


class _Reach(NamedTuple):
    """How steeply theta meets a root, and the object's light there with what it may err by."""

    steep: float
    flux: float
    slack: float


@compiled
def _reach(
    hidden: float,
    slope: float,
    frame: ScaledFrame,
    far: Direction,
    own: Direction,
    k: float,
    band: float,
) -> _Reach:
    """Return what errors of the readings do at a root; ``slope`` is that of ``hidden``."""
    cs, sn = own.cosine, own.sine
    # the background's direction as seen from the object's
    cos_far, sin_far = far.cosine * cs + far.sine * sn, far.sine * cs - far.cosine * sn
    flux = frame.x * cs + frame.y * sn - hidden * cos_far
    steep = -k * flux - slope * sin_far
    lever = slope * cos_far / steep
    g1, g2 = cs - lever * sn, sn + lever * cs
    variance = g1 * g1 * frame.v1 + g2 * g2 * frame.v2 + 2.0 * g1 * g2 * frame.v12
    slack = band * math.sqrt(max(variance, 0.0))
    slack += 64.0 * EPSILON * (frame.rho + frame.b) * (1.0 + abs(lever))
    return _Reach(steep, flux, slack)


@compiled
def _left(
    before: float,
    at_end: float,
    frame: ScaledFrame,
    far: Direction,
    back: KnownBackground,
    end: End,
) -> bool:
    """Say whether errors may have moved a root beyond the background.

    Parameters
    ----------
    before, at_end : float
        theta where the last interval begins, and at the background.
    """
    # an even multiple of pi, of light that is not negative
    gap = 2.0 * math.pi * math.floor(at_end / (2.0 * math.pi) + 0.5) - at_end
    if not gap * (at_end - before) > 0.0:
        return False  # that root lies before the background
    hidden = frame.b * shadow(back.distance, back.c0, back.c1)
    x, y = frame.x - hidden * far.cosine, frame.y - hidden * far.sine
    flux = x * far.cosine + y * far.sine
    if flux < -end.band * _spread(Direction(-far.sine, far.cosine), frame):
        return False  # a negative object beyond any noise
    across = math.hypot(_spread(far, frame), end.late * flux)
    return abs(y * far.cosine - x * far.sine) < end.band * math.hypot(across, end.shadow * frame.b)


@compiled
def solve_phase(
    net: Net, back: KnownBackground, phase: Phase, band: float, end: End, found: Found
) -> None:
    """Find all roots of every frame with an object that is not negative beyond noise.

    Parameters
    ----------
    net : Net
        Net readings of n frames; those of a state other than 0 are passed over.
    back : KnownBackground
        The background.
    phase : Phase
        Wave number and phases.
    band : float
        Standard deviations that count as within the noise.
    end : End
        What may have moved a root beyond the background.
    found : Found
        Receives the results; beside a root the background's own place, without a standard
        deviation, where another may have been moved beyond it.
    """
    k = phase.wave
    angle = phase.far + phase.offset
    far = Direction(math.cos(angle), math.sin(angle))
    quartic, turns, ends = np.empty(5), np.empty(5), np.empty(6)
    for i in range(net.first.size):
        if net.state[i] != 0 or (net.first[i] == 0.0 and net.second[i] == 0.0):
            continue
        frame = frame_of(net, i, back.strength)
        line = line_of(frame, phase.offset, far)
        count = turns_of(line, back, k, quartic, turns)
        ends[0] = LEAST
        for j in range(count):
            ends[j + 1] = turns[j]
        ends[count + 1] = back.distance
        roots = 0
        for j in range(count + 1):
            low, high = ends[j], ends[j + 1]
            left, right = theta(low, line, back, k), theta(high, line, back, k)
            first_turn = math.ceil(min(left, right) / math.pi)
            last_turn = math.floor(max(left, right) / math.pi)
            for step in range(int(last_turn - first_turn) + 1):
                turn = first_turn + step if left < right else last_turn - step
                goal = turn * math.pi
                r = range_at(low, high, goal, line, back, k)
                if not 0.0 < r < back.distance or (roots > 0 and r <= found.roots[i, roots - 1]):
                    continue
                if roots == found.roots.shape[1]:
                    continue
                hidden = frame.b * shadow(r, back.c0, back.c1)
                slope = frame.b * shadow_slope(r, back.c0, back.c1)
                own = _own_direction(r, hidden, turn, frame, far, phase)
                error = _reach(hidden, slope, frame, far, own, k, band)
                if turn % 2.0 != 0.0 and abs(error.flux) > error.slack:
                    continue  # a negative object beyond any noise
                spread = _spread(own, frame)
                sd, reach = spread / abs(error.steep), band * spread
                near = j > 0 and abs(left - goal) * _length(low, frame, far, back) < reach
                near |= j < count and abs(right - goal) * _length(high, frame, far, back) < reach
                found.roots[i, roots], found.sds[i, roots] = r, sd
                found.late[i, roots] = -k * error.flux / error.steep
                found.near[i, roots] = near
                found.physical[i, roots] = r + back.c1 >= -(band * sd + 1e-12 * r)
                roots += 1
            if j < count:
                # whether noise reaches the fold between this interval and the next
                off = right / (2.0 * math.pi)
                gap = 2.0 * math.pi * abs(off - math.floor(off + 0.5))
                there = Direction(
                    math.cos(k * high + phase.offset), math.sin(k * high + phase.offset)
                )
                if gap * _length(high, frame, far, back) < band * _spread(there, frame):
                    found.near_frame[i] = True
            elif 0 < roots < found.roots.shape[1] and _left(left, right, frame, far, back, end):
                found.roots[i, roots], found.late[i, roots] = back.distance, 0.0
                found.near[i, roots], found.physical[i, roots] = True, True
