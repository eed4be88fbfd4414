"""Bounds of the range where the object is not known: what its distortion and the noise may be."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.assemble import NOISE_BAND
from inference.realtime.net import Net
from inference.realtime.solving.ratio_reach import ratio_ends
from inference.realtime.turns import several_turns
from inference.technique import Task
from simulator.sensor import PulsedSensor

__all__ = ["Bounds", "bounds_of"]

Array = NDArray[np.float64]

# zeta of objects with c1 >= -0.648 sqrt(c0), all of Appendix B (docs/model.md, eq-4-19)
_LEAST, _MOST = 0.485, 0.754
_COVERED = 2.0  # standard deviations of noise that bounds hold: at least 95 % of the frames


@dataclasses.dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of ranges.

    Attributes
    ----------
    near, far : ndarray, shape (n,)
        [m]; nan where there are none.
    exact : ndarray of bool, shape (n,)
        Whether they hold no noise, which is not known.
    open : ndarray of bool, shape (n,)
        Whether noise leaves no range out.
    """

    near: Array
    far: Array
    exact: NDArray[np.bool_]
    open: NDArray[np.bool_]


def bounds_of(
    task: Task,
    target: tuple[Array, Array, Array],
    rate: Net,
    contact: NDArray[np.bool_],
    turn: float,
) -> Bounds:
    """Bound the ranges of objects whose zeta lies within `_LEAST` and `_MOST`, noise included.

    Parameters
    ----------
    task : Task
        Gives the sensor.
    target : (ndarray, ndarray, ndarray), each of shape (n,)
        top and bottom of q = top / bottom: of a pulse r0 w1' / w2' [m], of a sine wave the phase of
        the derivative in [0, pi) [rad], nan where there is none; and its standard deviation.
    rate : Net
        Derivatives, with noise and bias.
    contact : ndarray of bool, shape (n,)
        Which are at contact as far as their noise tells.
    turn : float
        Farthest range that derivatives tell, of a sine wave that after which they begin anew [m].

    Returns
    -------
    Bounds
        Of the ranges that `_COVERED` standard deviations of noise leave; of several turns from the
        first to the last.
    """
    top, bottom, sd = target
    several = task.high_m is None and several_turns(task.sensor, task.known, turn)
    high = turn if task.high_m is None else task.high_m
    with np.errstate(all="ignore"):
        q = top / bottom
        if isinstance(task.sensor, PulsedSensor):
            # copied, so that the machine code is one, however columns lie in memory
            own = rate.select(np.arange(q.size))
            low, up = ratio_ends(own.first, own.second, own.var1, own.cov, own.var2, _COVERED)
            exact = np.isnan(low)
            low, up = (np.where(exact | np.isnan(q), q, task.sensor.r0 * end) for end in (low, up))
            near, far = np.maximum(low, 0.0) / _MOST, up / _LEAST
        else:
            # exactly: psi = k r - atan(k r / N) with N = 1 / (1 - zeta)
            k, exact = task.sensor.wave_number, np.isnan(sd)
            spread = _COVERED * np.where(exact, 0.0, sd)
            low, up = np.maximum(q - spread, 0.0), q + spread
            # beyond half a turn the phases begin anew, and noise that turns any way leaves all
            any_way = NOISE_BAND * sd >= np.maximum(q, np.pi - q) * (1.0 - 1e-9)
            low, up = np.where(any_way, 0.0, low), np.where(any_way, np.pi, up)
            near = _turn_of(low, 1.0 / (1.0 - _MOST)) / k
            if several:
                assert task.known.stated_end_m is not None  # noqa: S101  # it holds them
                high = task.known.stated_end_m
                # the phase of a derivative lies behind that of its range, by less than a quarter
                least = np.where(any_way, 0.0, q - spread)
                last = np.maximum(np.floor((k * high - least) / np.pi), 0.0)
                beyond = _turn_of(least + np.pi * last, 1.0 / (1.0 - _MOST)) > k * high
                last -= beyond & (last > 0)
                far = _turn_of(up + np.pi * last, 1.0 / (1.0 - _LEAST)) / k
                near = np.where(contact, 0.0, near)
            else:
                far = np.where(up < np.pi, _turn_of(up, 1.0 / (1.0 - _LEAST)) / k, np.inf)
        far = np.minimum(far, high)
        good = (q > 0) & (near <= far)
        if task.physical and not several:
            good &= ~contact
        nothing = good & (near <= 0) & (far >= high)
        good &= ~nothing
    return Bounds(np.where(good, near, np.nan), np.where(good, far, np.nan), exact, nothing)


def _turn_of(psi: Array, power: float) -> Array:
    """Solve x - atan(x / N) = psi for x in (psi, psi + pi/2) by bisection: the left increases."""
    low, high = psi.copy(), psi + 0.5 * math.pi
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = middle - np.arctan(middle / power) < psi
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    # near zero the bisection is absolute; one Newton step makes it relative
    x = 0.5 * (low + high)
    small = psi < 1e-6
    return np.where(small, psi * power / (power - 1.0), x)
