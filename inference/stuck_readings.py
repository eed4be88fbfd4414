"""Readings that repeat, or scatter less than their noise: a reader that was stuck, or zeros."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import ABSENT, SATURATED, rule_out
from simulator.frames import Frames
from simulator.sensor import Sensor

__all__ = ["coarsest_step", "stuck_readings"]

Array = NDArray[np.float64]

_NONE = np.empty(0, dtype=np.intp)

# of a request whose read noise is as stated: how often it is doubted; runs, zeros, and the scatter
# of either column share it
_FALSE_ALARM = 1e-6 / 4
# steps are looked for down to that part of the noise, or of the reach of so many readings
_FINEST, _MOST, _LOOKED_AT = 1 / 100, 3e5, 24
_AT_ONCE = 32_768  # steps that a processor has at hand: the first that fits is the coarsest
_FIT = 0.2  # of a step, to which multiples of it are known: they may have been rounded again
_WORTH = 0.5  # of the stated scatter: noise that is stated twice too large is only cautious
_FEWEST = 2  # no fewer frames scatter


def stuck_readings(sensor: Sensor, frames: Frames) -> str | None:
    """Return where frames repeat a pair of readings that their noise makes another each time.

    The read noise alone is asked, which is independent in each reading: light, photons, gain and
    drift beside it make a repetition only rarer. What it is held against is how coarse the readings
    are, at most (docs/model.md, stuck-readings).

    Parameters
    ----------
    sensor, frames : Sensor, Frames
        The request.

    Returns
    -------
    str or None
        For a person. None where the stated noise and the steps of the readings explain all of it
        (false alarm at most 1e-6 a request). Frames at full scale do not count.
    """
    if len(frames) < _FEWEST or not (_any_again(frames.readings) or _any_empty(frames)):
        return None
    state = rule_out(sensor, frames)
    counted = np.flatnonzero(state != SATURATED)
    seen = _Seen(frames.readings[counted], frames.gains[counted], np.asarray(sensor.noise.read))
    for where in (_run(seen), _zeros(seen)):
        if where.size:
            return _said(sensor, state, counted[where], seen.readings[where[0]])
    return _still(sensor, seen, state[counted] == ABSENT)


class _Seen(NamedTuple):
    """Frames below full scale."""

    readings: Array  # (n, 2)
    gains: Array  # (n,)
    read: Array  # (2,): standard deviations


def _any_again(readings: Array) -> bool:
    """Tell quickly whether any frame may repeat the one before it, or reads zero."""
    first = readings[:, 0]
    return bool((first[1:] == first[:-1]).any() or (first == 0.0).any())


def _any_empty(frames: Frames) -> bool:
    return frames.object_present is not None and not bool(frames.object_present.all())


def _run(seen: _Seen) -> NDArray[np.intp]:
    """Return the most frames in a row that read the same, where noise rules that out."""
    readings, gains, _ = seen
    same = (readings[1:] == readings[:-1]).all(axis=1) & (gains[1:] == gains[:-1])
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]])))
    if not edges.size:
        return _NONE
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    begin, end = int(edges[2 * longest]), int(edges[2 * longest + 1]) + 1
    p = _equal(seen, gains[begin], readings[begin])
    often = math.log(len(readings)) + (end - begin - 1) * math.log(p)
    return np.arange(begin, end) if often < math.log(_FALSE_ALARM) else _NONE


def _zeros(seen: _Seen) -> NDArray[np.intp]:
    """Return the frames of which both readings are zero, where noise rules out as many."""
    zero = np.flatnonzero((seen.readings == 0.0).all(axis=1))
    if not zero.size or np.ptp(seen.gains) > 0.0:
        return _NONE
    import scipy  # a third of a second that frames without a doubt need not wait for

    p = _equal(seen, seen.gains[0], np.zeros(2))
    often = scipy.special.bdtrc(zero.size - 1, len(seen.readings), p)
    return zero if often < _FALSE_ALARM else _NONE


def _equal(seen: _Seen, gain: float, at: Array) -> float:
    """Return how often, at most, noise leads a frame to given readings, whatever its light."""
    of = seen.readings[seen.gains == gain]  # what follows a gain may have other steps
    p = 1.0
    for k, read in enumerate(seen.read.tolist()):
        # a normal law has no more than that within a step about its middle
        p *= math.erf(coarsest_step(of[:, k], at[k], read) / (2.0 * math.sqrt(2.0) * read))
    return max(p, 1e-300)


def coarsest_step(values: Array, at: float, read: float) -> float:
    """Return the coarsest step that readings at a value may have been rounded to; inf: any.

    All readings differ by multiples of it, to a fifth. Of steps that grow with the reading, as of
    digits or of a mantissa, those of no smaller readings are no finer.
    """
    large = np.unique(values[np.abs(values) >= abs(at)])
    large = large[np.argsort(np.abs(large), kind="stable")[:_LOOKED_AT]]
    with np.errstate(over="ignore"):
        away = np.abs(large[1:] - large[:1])
    reach = float(away.max(initial=0.0))
    # what was rounded to one step, and again by far finer ones, differs by less
    if not 0.1 * read <= reach < math.inf:
        return math.inf
    most = min(reach / (_FINEST * read), _MOST)
    # steps in the reach, so close that the next is off by a twentieth of a step at most; the
    # farthest is a step away, or more
    last = int(10.0 * most) + 1
    for begin in range(9, last, _AT_ONCE):
        counts = np.arange(begin, min(begin + _AT_ONCE, last)) / 10.0
        for share in away / reach:
            turns = share * counts
            counts = counts[np.abs(turns - np.rint(turns)) <= _FIT]
            if not counts.size:
                break
        else:
            return reach / float(counts[0])
    return reach / most


def _still(sensor: Sensor, seen: _Seen, empty: NDArray[np.bool_]) -> str | None:
    """Say which column of empty frames scatters less than read noise lets it."""
    n = int(empty.sum())
    if n < _FEWEST or np.ptp(seen.gains) > 0.0:
        return None
    bare, read = seen.readings[empty], seen.read
    away = bare - bare.mean(axis=0)
    small = np.sqrt(np.square(away).sum(axis=0) / (n - 1)) / read
    for k in np.flatnonzero(small < _WORTH):
        # rounding moves a reading by half a step at most
        step = coarsest_step(
            seen.readings[:, k], float(np.median(np.abs(bare[:, k]))), float(read[k])
        )
        most = math.sqrt(n - 1) * small[k] + math.sqrt(n) * step / (2.0 * read[k])
        import scipy  # as above

        if math.isfinite(most) and scipy.special.gammainc((n - 1) / 2, most**2 / 2) < _FALSE_ALARM:
            return (
                f"the {n} empty frames (object_present false) scatter about their mean by less "
                f"than read noise alone: {sensor.columns[k]} {small[k]:.2g} times as far as "
                "stated. If that is the noise of all frames, standard deviations are too large. "
                "Else that column was stuck, and the crosstalk it tells is wrong without a misfit"
            )
    return None


def _said(sensor: Sensor, state: NDArray[np.uint8], where: NDArray[np.intp], pair: Array) -> str:
    n = where.size
    which = f"frame {int(where[0])}"
    if n > 1:
        row = int(where[-1]) - int(where[0]) == n - 1
        which = f"frames {int(where[0])} to {int(where[-1])}"
        which = f"the {n} {which}" if row else f"{n} of {which}"
    bare = int((state[where] == ABSENT).sum())
    empty = f", {bare} of them empty (object_present false)," if bare else ""
    values = " and ".join(
        f"{column} {value:.6g}" for column, value in zip(sensor.columns, pair, strict=True)
    )
    return (
        f"{which}{empty} read exactly {values}, which the stated noise rules out: a reader that "
        "was stuck, zeros in place of what was not measured, readings that are cut off at an end, "
        "one sample that was read again, or readings without noise. Answers take each for a "
        "measurement of its own, and what rests on them may be wrong with small errors and "
        "without a misfit: leave these frames out, or measure them anew"
    )
