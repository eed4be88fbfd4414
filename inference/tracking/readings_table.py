"""The mean readings of a scene along its ranges, as a table.

The filter knows no optics: it sees a curve in the plane of the readings, tabulated over u = log r
in units of the read noise, its derivatives, and what the nuisance parameters do to it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.roots import Root, add_factor
from simulator.compiled import compiled
from simulator.readings import light_that_errs, noise_parts

__all__ = [
    "FIRST",
    "LOG_PRIOR",
    "NUISANCE",
    "SECOND",
    "ReadingsNoise",
    "ReadingsTable",
    "cell_of",
    "mean_at",
    "noise_root",
    "nuisance_at",
    "nuisance_count",
    "nuisance_root",
    "object_at",
]

Array = NDArray[np.float64]

FIRST, SECOND = range(2)  # the two readings
# columns of a table: means and slopes, the object's part of both, log prior, root of the covariance
# by nuisance parameters, nuisance Jacobian
MEAN, SIGNAL, LOG_PRIOR, SPREAD, NUISANCE = 0, 4, 8, 9, 12


class ReadingsNoise(NamedTuple):
    """Noise of the two readings."""

    plain: bool  # whether it does not depend on the range
    shot: float  # variance per mean reading, in units of the second reading's read noise
    ratio: float  # read noise of the first reading over that of the second
    relative: float  # common relative error
    pulsed: bool  # whether shot noise is shared by both readings
    of_source: bool = False  # whether all light has the relative error, not the object's alone


class ReadingsTable(NamedTuple):
    """What a frame's readings are expected to be, as a function of u = log r."""

    # (knots, 12 + 2 p): mean readings in units of the read noise, their derivatives along u times
    # ``step``, the object's part of both, log prior density of u, lower triangular root of
    # the covariance that p independent standard normal nuisance parameters add to the readings, and
    # the change of either reading with each of them. By rate the means are factors
    # of du/dt
    knots: Array
    # first knot and spacing of u
    start: float
    step: float
    end: float  # last knot
    # known crosstalk
    crosstalk1: float
    crosstalk2: float
    by_rate: bool  # whether the readings are derivatives in time
    noise: ReadingsNoise  # of the readings
    channels: int  # how many of the two readings are used


@compiled
def _hermite(u: float, table: ReadingsTable, first: int) -> tuple[float, float, float, float]:
    """Interpolate two columns and their derivatives, cubically."""
    position = (u - table.start) / table.step
    p = table.knots
    i = min(max(int(position), 0), p.shape[0] - 2)
    t = position - i
    a1, a2, left1, left2 = p[i, first], p[i, first + 1], p[i, first + 2], p[i, first + 3]
    right1, right2 = p[i + 1, first + 2], p[i + 1, first + 3]
    gap1, gap2 = p[i + 1, first] - a1, p[i + 1, first + 1] - a2
    c1, d1 = 3.0 * gap1 - 2.0 * left1 - right1, left1 + right1 - 2.0 * gap1
    c2, d2 = 3.0 * gap2 - 2.0 * left2 - right2, left2 + right2 - 2.0 * gap2
    return (
        a1 + t * (left1 + t * (c1 + t * d1)),
        a2 + t * (left2 + t * (c2 + t * d2)),
        (left1 + t * (2.0 * c1 + 3.0 * t * d1)) / table.step,
        (left2 + t * (2.0 * c2 + 3.0 * t * d2)) / table.step,
    )


@compiled
def mean_at(u: float, table: ReadingsTable) -> tuple[float, float, float, float]:
    """Return the two mean readings and their derivatives along u."""
    return _hermite(u, table, MEAN)


@compiled
def object_at(u: float, table: ReadingsTable) -> tuple[float, float]:
    """Return the object's part of the readings."""
    value1, value2, _, _ = _hermite(u, table, SIGNAL)
    return value1, value2


@compiled
def cell_of(u: float, table: ReadingsTable) -> tuple[int, float]:
    """Return the knot before u and the share of the cell that lies before u."""
    position = (u - table.start) / table.step
    i = min(max(int(position), 0), table.knots.shape[0] - 2)
    return i, min(max(position - i, 0.0), 1.0)


@compiled
def nuisance_count(table: ReadingsTable) -> int:
    """Return the number of nuisance parameters."""
    return int((table.knots.shape[1] - NUISANCE) // 2)


@compiled
def nuisance_at(i: int, t: float, j: int, table: ReadingsTable) -> tuple[float, float]:
    """Return the change of the readings with nuisance parameter j, in the cell after knot i."""
    p = table.knots
    k = NUISANCE + 2 * j
    return p[i, k] + t * (p[i + 1, k] - p[i, k]), p[i, k + 1] + t * (p[i + 1, k + 1] - p[i, k + 1])


@compiled
def nuisance_root(u: float, gain: float, table: ReadingsTable) -> Root:
    """Return the root of the covariance that all nuisance parameters add to the readings."""
    i, t = cell_of(u, table)
    p = table.knots
    r11 = p[i, SPREAD] + t * (p[i + 1, SPREAD] - p[i, SPREAD])
    r21 = p[i, SPREAD + 1] + t * (p[i + 1, SPREAD + 1] - p[i, SPREAD + 1])
    r22 = p[i, SPREAD + 2] + t * (p[i + 1, SPREAD + 2] - p[i, SPREAD + 2])
    return Root(gain * r11, gain * r21, gain * r22)


@compiled
def noise_root(m1: float, m2: float, o1: float, o2: float, noise: ReadingsNoise) -> Root:
    """Return the triangular root of the noise's covariance at mean readings m, object's part o.

    The covariance is that of `simulator.readings.noise_parts`. Its root is not
    `inference.frame.noise.root`: each reading has its own unit here, and what crosstalk and
    nuisance parameters add goes on by the rotations that add the parts.
    """
    ratio = noise.ratio
    mean = m1 * ratio, m2
    errs = light_that_errs(mean, (o1 * ratio, o2), noise.of_source)
    own1, own2, shared, common1, common2 = noise_parts(
        (ratio, 1.0), noise.shot, noise.relative, noise.pulsed, mean, errs
    )
    root = Root(math.sqrt(own1) / ratio, 0.0, math.sqrt(own2))
    if shared > 0.0:
        photons = math.sqrt(shared)
        root = add_factor(root, photons / ratio, photons)
    if noise.relative > 0.0:
        root = add_factor(root, common1 / ratio, common2)
    return root
