"""What is known of a frame's range beside its readings: further readings, of the range itself.

A ruler or a robot tells the range, odometry tells it up to one offset that all frames share. Both
multiply the law of the ranges; of a reference prior they are part of what the frame resolves.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.frame.blocks import DISPLACEMENT, DISPLACEMENT_RATE, RANGE, RATE, WARM, Known
from simulator.compiled import compiled
from simulator.frames import Frames
from simulator.parameters import OFFSET, Parameters, Terms, with_offset

__all__ = [
    "Beside",
    "beside",
    "columns_of",
    "free_of_range",
    "known_information",
    "known_log_density",
    "known_rounding",
    "known_slope",
    "offset_slopes",
    "rates_of",
    "with_displacements",
]

Array = NDArray[np.float64]

_STEP = 1e-5  # the map from z is smooth: a central difference errs by 1e-10 of itself


def columns_of(frames: Frames) -> Array:
    """Return frames as kernels take them, shape (n, 3), or (n, 7) where ranges are known.

    Of a frame without an object nothing is known.
    """
    gain = np.ones(len(frames)) if frames.gain is None else frames.gain
    columns = [frames.readings, gain]
    if frames.known_range_m is not None or frames.displacement_m is not None:
        columns += _told(frames.known_range_m, frames.known_range_sd_m, frames.present)
        columns += _told(frames.displacement_m, frames.displacement_sd_m, frames.present)
    return np.ascontiguousarray(np.column_stack(columns))


def _told(value: Array | None, sd: Array | None, present: NDArray[np.bool_]) -> list[Array]:
    """Return what is known and one over its standard deviation, both zero where nothing is."""
    told, rate = np.zeros((2, present.size))
    if value is not None and sd is not None:
        known = np.isfinite(value) & present
        told[known], rate[known] = value[known], 1.0 / sd[known]
    return [told, rate]


def with_displacements(parameters: Parameters, columns: Array) -> Parameters:
    """Add the offset of displacements to the unknowns where frames, from `columns_of`, tell any."""
    if columns.shape[1] <= RANGE or not (moved := columns[:, DISPLACEMENT_RATE] > 0).any():
        return parameters
    return with_offset(parameters, columns[moved, DISPLACEMENT])


def offset_slopes(parameters: Parameters, z: Array) -> Array:
    """Return the derivative of the offset of displacements along z [m], shape (d,)."""
    slopes = np.zeros(z.size)
    if OFFSET in parameters.names:
        j, steps = parameters.names.index(OFFSET), np.zeros((2, z.size))
        steps[:, j] = _STEP, -_STEP
        ends = parameters.natural(z + steps)[:, j]
        slopes[j] = (ends[0] - ends[1]) / (2 * _STEP)
    return slopes


class Beside(NamedTuple):
    """What is known of ranges beside the readings, in units of its noise, at given ranges.

    Attributes
    ----------
    residual, along : ndarray, shape (n, 2)
        Of range and displacement: what is known less what would be, and its derivative along log r.
    by_offset : ndarray, shape (n, 2)
        Derivative along the offset of all displacements [1/m].
    """

    residual: Array
    along: Array
    by_offset: Array


def rates_of(frames: Array) -> Array | None:
    """Return one over the standard deviations of range and displacement [1/m], shape (n, 2).

    Zero where nothing is known; None where nothing is of any frame.
    """
    if frames.shape[1] <= RANGE:
        return None
    rates = frames[:, [RATE, DISPLACEMENT_RATE]]
    return None if frames.shape[1] > WARM and not rates.any() else rates


def beside(frames: Array, log_r: Array, terms: Terms) -> Beside | None:
    """Compare what is known of ranges with given ones.

    Parameters
    ----------
    frames : ndarray, shape (n, 3 or 7)
        From `columns_of`.
    log_r : ndarray, shape (n,)
        nan for a frame without object, of which nothing is known.
    terms : Terms
        Of one parameter vector.

    Returns
    -------
    Beside or None
        None where nothing is known of any range.
    """
    rates = rates_of(frames)
    if rates is None:
        return None
    present = np.isfinite(log_r)
    rates = np.where(present[:, None], rates, 0.0)
    r = np.exp(np.where(present, log_r, 0.0))[:, None]
    offset = np.array([0.0, 0.0 if terms.offset is None else terms.offset[0]])
    residual = (frames[:, [RANGE, DISPLACEMENT]] + offset - r) * rates
    return Beside(residual, r * rates, -rates * [0.0, 1.0])


def free_of_range(along: Array, other: Array, own: Array, vectors: Array) -> Array:
    """Return the parts of vectors that no change of the ranges makes, beside those across readings.

    Parameters
    ----------
    along, other : ndarray, shape (n, 2)
        Derivatives along log r of whitened readings, and of what is known beside them.
    own, vectors : ndarray, shape (n, 2, k)
        Of the readings, and of what is known beside them.

    Returns
    -------
    ndarray, shape (n, 2, k)
        With the part across the readings' own direction an orthonormal decomposition.
    """
    length, size = np.linalg.norm(along, axis=1), np.linalg.norm(other, axis=1)
    whole = np.hypot(length, size)

    def over(values: Array, by: Array) -> Array:
        return np.divide(values, by[:, None], out=np.zeros_like(values), where=by[:, None] > 0)

    share = np.einsum("ni,nik->nk", over(along, length), own)
    unit = over(other, size)
    mean = np.einsum("ni,nik->nk", unit, vectors)
    first = over(length[:, None] * mean - size[:, None] * share, whole)
    second = unit[:, [0]] * vectors[:, 1] - unit[:, [1]] * vectors[:, 0]
    return np.stack([first, second], axis=1)


@compiled
def _off_known(r: float, known: Known) -> float:
    """Return by how many standard deviations a range lies off what is known of it."""
    return (r - known.range_m) * known.rate


@compiled
def _off_moved(r: float, known: Known, offset: float | None) -> float:
    """Return the same of a displacement, zero where the scene has no offset."""
    if offset is not None:
        return (r - offset - known.displacement_m) * known.displacement_rate
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return 0.0


@compiled
def known_log_density(r: float, known: Known | None, offset: float | None) -> float:
    """Return the log density of what is known of a range r, relative to its top."""
    if known is not None:
        first, second = _off_known(r, known), _off_moved(r, known, offset)
        return -0.5 * (first * first + second * second)
    else:  # noqa: RET505
        return 0.0


@compiled
def known_slope(r: float, known: Known | None, offset: float | None) -> float:
    """Return the derivative of `known_log_density` along log r."""
    if known is not None:
        pull = _off_known(r, known) * known.rate
        return -r * (pull + _off_moved(r, known, offset) * known.displacement_rate)
    else:  # noqa: RET505
        return 0.0


@compiled
def known_information(r: float, known: Known | None) -> float:
    """Return the information on log r, which is the curvature of `known_log_density` too."""
    if known is not None:
        rate, other = known.rate * r, known.displacement_rate * r
        return rate * rate + other * other
    else:  # noqa: RET505
        return 0.0


@compiled
def known_rounding(r: float, u: float, known: Known | None, offset: float | None) -> float:
    """Return by how many roundings `known_log_density` moves from one log r to the next."""
    if known is not None:
        size = r * (1.0 + abs(u))
        off = abs(_off_known(r, known)) + 1.0
        total = (size + abs(known.range_m)) * known.rate * off
        off = abs(_off_moved(r, known, offset)) + 1.0
        total += (size + abs(known.displacement_m)) * known.displacement_rate * off
        return total
    else:  # noqa: RET505
        return 0.0
