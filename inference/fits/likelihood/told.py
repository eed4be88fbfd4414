"""What is known of ranges beside the readings of a fit: residuals of the ranges themselves.

A ruler's are (known - r) / sd. Odometry's are so up to one offset of all frames, which is one more
error that frames share, of a standard deviation as wide as the ranges that the scene allows.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.frame.blocks import DISPLACEMENT, DISPLACEMENT_RATE, RANGE, RATE
from inference.frame.known_range import columns_of
from inference.identifiability.elimination import eliminate
from inference.identifiability.information import Information
from simulator.errors import RefusedError
from simulator.frames import Frames

__all__ = [
    "CONTRADICTED",
    "KnownRanges",
    "Told",
    "contradictions",
    "eliminated",
    "improbable",
    "known_ranges",
    "step_of",
    "told_at",
    "told_of",
    "unsettled",
    "with_column",
]

Array = NDArray[np.float64]

CONTRADICTED = 1e-3  # false alarms of naming a frame, in all frames together
_OUTSIDE = 5.0  # standard deviations by which a known range may lie off the possible ones


class KnownRanges(NamedTuple):
    """What frames know of their ranges.

    Attributes
    ----------
    values, rates : ndarray, shape (n, 2)
        Range and displacement [m], and one over their standard deviations; 0 where nothing is.
    offset, offset_sd : float
        Where the offset of displacements is looked for, and how widely [m]; a width of 0 is none.
    """

    values: Array
    rates: Array
    offset: float
    offset_sd: float

    def select(self, index: NDArray[np.intp]) -> "KnownRanges":
        """Return what some of the frames know."""
        return self._replace(values=self.values[index], rates=self.rates[index])

    def without(self, frame: int) -> "KnownRanges":
        """Return the same of all frames but one."""
        rates = self.rates.copy()
        rates[frame] = 0.0
        return self._replace(rates=rates)

    @property
    def numbers(self) -> int:
        """How many numbers are known."""
        return int((self.rates > 0).sum())


class Told(NamedTuple):
    """What is known of ranges, at given ones, in units of its standard deviation.

    Attributes
    ----------
    residual, along : ndarray, shape (n, 2)
        Of range and displacement: what is known less what is, and the derivative along log r.
    errors : ndarray, shape (n, 2, k)
        Derivative along the errors of the fit.
    """

    residual: Array
    along: Array
    errors: Array


def known_ranges(frames: Frames, support: tuple[float, float]) -> KnownRanges | None:
    """Return what frames know of their ranges; None where that is nothing.

    Parameters
    ----------
    frames : Frames
        Usable frames.
    support : (float, float)
        Ranges that the scene allows [m].

    Raises
    ------
    RefusedError
        Where that lies outside them.
    """
    columns = columns_of(frames)
    if columns.shape[1] <= RANGE or not (columns[:, [RATE, DISPLACEMENT_RATE]] > 0).any():
        return None
    values, rates = columns[:, [RANGE, DISPLACEMENT]], columns[:, [RATE, DISPLACEMENT_RATE]]
    low, high = support
    told = rates[:, 0] > 0
    beyond = np.maximum(low - values[:, 0], values[:, 0] - high) * rates[:, 0] > _OUTSIDE
    if (told & beyond).any():
        raise RefusedError(
            f"known ranges lie outside what range_m allows, {low:.4g} to {high:.4g} m: state a "
            "wider range_m"
        )
    offset = offset_sd = 0.0
    if (moved := rates[:, 1] > 0).any():
        least, most = float(values[moved, 1].min()), float(values[moved, 1].max())
        if not high - most > low - least:
            raise RefusedError(
                f"displacements span {most - least:.4g} m, and the ranges that the scene allows "
                f"{high - low:.4g} m"
            )
        offset, offset_sd = 0.5 * (low - least + high - most), high - low
    return KnownRanges(values, rates, offset, offset_sd)


def with_column(known: KnownRanges | None, errors: Array) -> Array:
    """Return derivatives along errors with one more error, which no reading depends on.

    Where displacements are known; ``errors`` has the shape (n, 2, k).
    """
    if known is None or known.offset_sd == 0.0:
        return errors
    return np.concatenate([errors, np.zeros((*errors.shape[:2], 1))], axis=2)


def told_at(known: KnownRanges | None, u: Array, a: Array) -> Told | None:
    """Compare what is known of ranges with given ones.

    Parameters
    ----------
    known : KnownRanges or None
        What is known.
    u : ndarray, shape (n,)
        log r; nan without an object, of which nothing is known.
    a : ndarray, shape (k,)
        Errors of the fit, the offset's last where there is one.
    """
    return None if known is None else told_of(known, u, a)


def told_of(known: KnownRanges, u: Array, a: Array) -> Told:
    """Return `told_at` of something that is known."""
    present = np.isfinite(u)
    rates = np.where(present[:, None], known.rates, 0.0)
    r = np.exp(np.where(present, u, 0.0))[:, None]
    errors = np.zeros((u.size, 2, a.size))
    shift = np.zeros(2)
    if known.offset_sd > 0.0:
        shift[1] = known.offset + known.offset_sd * a[-1]
        errors[:, 1, -1] = -known.offset_sd * rates[:, 1]
    return Told((known.values + shift - r) * rates, r * rates, errors)


def eliminated(
    names: tuple[str, ...], jacobian: Array, along: Array, errors: Array, told: Told | None
) -> Information:
    """Eliminate the ranges from readings and from what is known beside them.

    Parameters
    ----------
    names, jacobian, along, errors
        As for `eliminate`.
    told : Told or None
        With as many columns of errors.
    """
    if told is None:
        return eliminate(names, jacobian, along, errors)
    other = np.concatenate([np.zeros_like(jacobian), told.errors], axis=2)
    return eliminate(names, jacobian, along, errors, beside=(told.along, other))


def contradictions(told: Told, residual: Array, along: Array, free: Array) -> Array:
    """Return by how much readings and knowledge tell other ranges: a chi-square a frame, (n,).

    Parameters
    ----------
    told : Told
        At the ranges of the frames.
    residual, along : ndarray, shape (n, 2)
        Whitened residuals of the readings, and their model's derivative along log r.
    free : ndarray, shape (n, 2, m)
        What else moves the readings, by independent standard normal numbers.
    """
    move = np.where(np.isfinite(along), along, 0.0)
    own, known = np.square(move).sum(axis=1), np.square(told.along).sum(axis=1)
    both = (own > 0) & (known > 0)
    own, known = np.where(both, own, 1.0), np.where(both, known, 1.0)
    read = np.einsum("ni,ni->n", move, np.where(both[:, None], residual, 0.0)) / own
    said = np.einsum("ni,ni->n", told.along, told.residual) / known
    spread = np.einsum("ni,nik->nk", move, np.where(both[:, None, None], free, 0.0)) / own[:, None]
    variance = 1.0 / own + 1.0 / known + np.square(spread).sum(axis=1)
    return np.where(both, np.square(read - said) / variance, 0.0)


def unsettled(told: Told, residual: Array, along: Array) -> Array:
    """Return by how much a range is off where readings and knowledge together would have it, (n,).

    `contradictions` looks from any range to where both would lead by their slopes, and is small
    also where neither has led yet: what is no mode costs what there is left to gain. Where the
    readings have no slope that is all that knowledge says.

    Parameters
    ----------
    told, residual, along
        As for `contradictions`.
    """
    step, size = step_of(told, residual, along)
    return np.square(step) * size


def step_of(told: Told, residual: Array, along: Array) -> tuple[Array, Array]:
    """Return the step of Gauss and Newton in log r, and what is known along it, each shape (n,).

    The step is 0 where nothing is known beside the readings.

    Parameters
    ----------
    told, residual, along
        As for `contradictions`.
    """
    move = np.where(np.isfinite(along), along, 0.0)
    size = np.square(move).sum(axis=1) + np.square(told.along).sum(axis=1)
    pull = np.einsum("ni,ni->n", move, residual)
    pull += np.einsum("ni,ni->n", told.along, told.residual)
    moved = (told.along > 0).any(axis=1) & (size > 0)
    return np.divide(pull, size, out=np.zeros_like(pull), where=moved), size


def improbable(chi_square: Array) -> NDArray[np.intp]:
    """Return the frames, the worst first, whose `contradictions` are more than chance."""
    from scipy.special import chdtri

    limit = float(chdtri(1, CONTRADICTED / max(chi_square.size, 1)))
    worst = np.argsort(-chi_square, kind="stable")
    return np.asarray(worst[chi_square[worst] > max(limit, math.ulp(1.0))])
