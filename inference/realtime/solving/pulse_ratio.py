"""The conventional range of a pulse, r0 w1 / w2, as fast as two readings can be divided (4.47).

Loops without branches over one flat index: so the compiler sees how the pairs lie and computes
several frames at once.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.ratio_reach import FEW, ratio_reach
from simulator.compiled import compiled
from simulator.readings import noise_parts

__all__ = [
    "CONTRADICTED",
    "Codes",
    "Columns",
    "Pulse",
    "explain",
    "follow_noise",
    "pulsed_ranges",
    "ranges_alone",
]

Array = NDArray[np.float64]

_ROUNDING = 2.220446049250313e-16


class Pulse(NamedTuple):
    """What a pair of readings is computed with.

    Attributes
    ----------
    r0 : float
        Range at which the whole pulse is late [m].
    crosstalk_late, crosstalk_whole : float
        To subtract [reading units].
    read : (float, float)
        Standard deviations of the read noise.
    shot : float
        Variance per reading.
    flicker : float
        Relative error of all light of the source; 0 where only the object's light has one, which
        cancels in the ratio.
    low, high : float
        Ranges that are allowed [m].
    full_late, full_whole : float
        Full scale, inf where there is none.
    error : float
        Standard deviation of the error of the effective distance, the model's part [m].
    band : float
        Standard deviations by which noise parts windows that hold the same.
    """

    r0: float
    crosstalk_late: float
    crosstalk_whole: float
    read: tuple[float, float]
    shot: float
    flicker: float
    low: float
    high: float
    full_late: float
    full_whole: float
    error: float
    band: float


class Columns(NamedTuple):
    """Results of n frames: ranges, standard deviations, and why there is none (0: there is).

    The standard deviations are the whole and, of these, what noise does; ``near`` is 1 where noise
    reaches r0, at which the ratio ends: objects beyond it have w1 = w2.
    """

    roots: Array
    sds: Array
    noise: Array
    reason: NDArray[np.uint8]
    near: NDArray[np.uint8]


CONTRADICTED = 5.0
"""Standard deviations by which noise moves no reading to the wrong side of a limit."""


class Codes(NamedTuple):
    """Indices of the reasons that `explain` gives."""

    dark: int
    contact: int
    beyond: int
    outside: int
    lost: int
    saturated: int
    drowned: int
    negative: int
    swapped: int


@compiled
def _valid(r: float, late: float, whole: float) -> bool:
    """Whether the readings give a range; nan and infinities do not."""
    return (r > 0.0) & (late > 0.0) & (late <= whole) & (whole < math.inf)


@compiled
def _divided(late: float, whole: float, r0: float) -> float:
    return r0 * (late / whole)


@compiled
def ranges_alone(flat: Array, r0: float, crosstalk_late: float, crosstalk_whole: float) -> Array:
    """Return the ranges alone, nan where there is none.

    Parameters
    ----------
    flat : ndarray, shape (2 n,)
        Readings w1, w2 of every frame.
    r0 : float
        Range at which the whole pulse is late [m].
    crosstalk_late, crosstalk_whole : float
        To subtract.
    """
    out = np.empty(flat.size // 2)
    for i in range(out.size):
        late, whole = flat[2 * i] - crosstalk_late, flat[2 * i + 1] - crosstalk_whole
        r = _divided(late, whole, r0)
        out[i] = r if _valid(r, late, whole) else math.nan
    return out


@compiled
def pulsed_ranges(flat: Array, pulse: Pulse, columns: Columns) -> tuple[int, int]:
    """Fill ranges, standard deviations and a mark of the frames that have none.

    A frame's gain and the relative error of the object's signal cancel in the ratio.

    Parameters
    ----------
    flat : ndarray, shape (2 n,)
        Readings w1, w2 of every frame.
    pulse : Pulse
        What they are computed with.
    columns : Columns
        Receives the results.

    Returns
    -------
    (int, int)
        Frames that are marked, and such whose light nearly drowns: `follow_noise` is theirs.
    """
    roots, sds, noise, reason = columns.roots, columns.sds, columns.noise, columns.reason
    near = columns.near
    square = pulse.error * pulse.error
    beyond = pulse.high >= pulse.r0  # where objects may stand there at all
    bad, faint = 0, 0
    for i in range(roots.size):
        raw1, raw2 = flat[2 * i], flat[2 * i + 1]
        late, whole = raw1 - pulse.crosstalk_late, raw2 - pulse.crosstalk_whole
        # one division for the range and for its error
        inverse = 1.0 / whole
        share = late * inverse
        r = pulse.r0 * share
        # gradient of the ratio: (1, -share) / whole; shared photons enter with 1 - share
        own1, own2, shared, _, _ = noise_parts(
            pulse.read, pulse.shot, None, True, (raw1, raw2), (0.0, 0.0)
        )
        variance = own1 + share * share * own2 + (1.0 - share) * (1.0 - share) * shared
        # of a source's flicker what the object has cancels
        left = pulse.flicker * (pulse.crosstalk_late - share * pulse.crosstalk_whole)
        variance += left * left
        sd = pulse.r0 * inverse * math.sqrt(variance)
        # readings are rounded, however little noise they have
        sd = max(sd, _ROUNDING * r)
        good = (pulse.low <= r) & (r <= pulse.high) & _valid(r, late, whole)
        good &= (sd < math.inf) & (abs(raw1) < pulse.full_late) & (abs(raw2) < pulse.full_whole)
        roots[i] = r if good else math.nan
        noise[i] = sd if good else math.nan
        whole_sd = math.sqrt(sd * sd + square)
        # the square of what is tiny or huge is no number
        sds[i] = (whole_sd if sd < whole_sd < math.inf else sd) if good else math.nan
        reason[i] = 0 if good else 1
        # of an object there or farther the windows differ by noise alone
        early = pulse.flicker * (raw2 - raw1)
        together = whole - late < pulse.band * math.sqrt(own1 + own2 + early * early)
        near[i] = 1 if good & beyond & together else 0
        bad += 0 if good else 1
        bright = pulse.flicker * raw2
        faint += 1 if good & (FEW * (own2 + shared + bright * bright) > whole * whole) else 0
    return bad, faint


@compiled
def follow_noise(flat: Array, pulse: Pulse, columns: Columns) -> None:
    """Follow the noise along the curve in frames whose light nearly drowns.

    Parameters
    ----------
    flat, pulse, columns
        As for `pulsed_ranges`, which has filled them.
    """
    end = min(pulse.high / pulse.r0, 1.0)
    for i in range(columns.roots.size):
        if columns.reason[i] != 0:
            continue
        raw1, raw2 = flat[2 * i], flat[2 * i + 1]
        own1, own2, shared, _, _ = noise_parts(
            pulse.read, pulse.shot, None, True, (raw1, raw2), (0.0, 0.0)
        )
        # of a common error s nothing is less than s s^T, and twice its diagonal is no less
        own1 += 2.0 * (pulse.flicker * raw1) * (pulse.flicker * raw1)
        own2 += 2.0 * (pulse.flicker * raw2) * (pulse.flicker * raw2)
        late, whole = raw1 - pulse.crosstalk_late, raw2 - pulse.crosstalk_whole
        if FEW * (own2 + shared) > whole * whole:
            reach = pulse.r0 * ratio_reach(late, whole, own1, own2, shared, end)
            columns.noise[i] = max(columns.noise[i], reach)
            columns.sds[i] = math.hypot(columns.noise[i], pulse.error)


@compiled
def explain(flat: Array, pulse: Pulse, codes: Codes, columns: Columns) -> None:
    """Say of the frames marked why they have no range, or give it where only its sd overflows.

    Parameters
    ----------
    flat : ndarray, shape (2 n,)
        Readings w1, w2 of every frame.
    pulse : Pulse
        What they are computed with.
    codes : Codes
        The reasons.
    columns : Columns
        Filled by `pulsed_ranges`.
    """
    roots, reason = columns.roots, columns.reason
    read1, read2 = pulse.read
    for i in range(roots.size):
        if reason[i] == 0:
            continue
        raw1, raw2 = flat[2 * i], flat[2 * i + 1]
        late, whole = raw1 - pulse.crosstalk_late, raw2 - pulse.crosstalk_whole
        s1, s2 = pulse.flicker * raw1, pulse.flicker * raw2
        r = _divided(late, whole, pulse.r0)
        if abs(raw1) >= pulse.full_late or abs(raw2) >= pulse.full_whole:
            reason[i] = codes.saturated
        elif not (abs(late) < math.inf and abs(whole) < math.inf):
            reason[i] = codes.lost
        elif whole <= 0.0:
            reason[i] = codes.dark
            if -whole > CONTRADICTED * math.sqrt(read2 * read2 + pulse.shot * abs(raw2) + s2 * s2):
                reason[i] = codes.negative
        elif late <= 0.0:
            reason[i] = codes.contact
            # so near the error of the effective distance counts as noise does
            moved = whole * (pulse.error / pulse.r0)
            spread = read1 * read1 + pulse.shot * abs(raw1) + moved * moved + s1 * s1
            if -late > CONTRADICTED * math.sqrt(spread):
                reason[i] = codes.negative
        elif late > whole:
            reason[i] = codes.beyond
            # photons that are late are part of all, and cancel: this is their most
            photons = pulse.shot * (abs(raw1) + abs(raw2)) + (s1 - s2) * (s1 - s2)
            if late - whole > CONTRADICTED * math.sqrt(read1 * read1 + read2 * read2 + photons):
                reason[i] = codes.swapped
        elif not r > 0.0:
            reason[i] = codes.lost
        elif not pulse.low <= r <= pulse.high:
            reason[i] = codes.outside
        else:
            reason[i] = codes.drowned
            roots[i] = r
