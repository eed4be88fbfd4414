"""How wrong the Object Parameter Model may be: a smooth relative error of the flux along log r.

log Phi = log Phi_obj + delta(log r), delta a Gaussian process with Matern 5/2 covariance. Its size
and length are not those of the misfit of fitted models (`simulator.optics.misfit`): a fit takes up
the part of the error that looks like c0, c1 and c2. Of a path of length 1 in log r it leaves a
share of 0.43 in root mean square over 0.01 to 1 m, with a correlation length of 0.32; a length of
0.44 would leave 0.23, and no length above 1 leaves more than 0.37. Measured are 0.38 and 3.0 %.
"""

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from simulator.scipy_later import scipy

__all__ = [
    "DISCREPANCY_LENGTH",
    "DISCREPANCY_SD",
    "NEGLECTED",
    "SLOPE_SD",
    "DiscrepancyBasis",
    "discrepancy_basis",
    "matern",
]

Array = NDArray[np.float64]

# in log r: the shortest whose misfit, once fitted, is as smooth as that of the optical simulator
DISCREPANCY_LENGTH = 1.0
# 3.046 % of misfit left by a fit ("all" of `simulator.optics.misfit_table`), 0.425 of the whole
DISCREPANCY_SD = 0.072
# of the slope of the process along log r, in units of its own
SLOPE_SD = math.sqrt(5.0 / 3.0) / DISCREPANCY_LENGTH

_SPACING = 0.05  # of the knots, in lengths: cubics between them err by 1e-6 of a path
NEGLECTED = 1e-4
"""Share of the variance that a basis leaves out: a hundredth of the error's size."""
_LONGEST = 8.0  # e-folds; below exp(-8) of the largest range the error is taken as constant


def matern(lag: Array, length: float = DISCREPANCY_LENGTH) -> Array:
    """Return the Matern 5/2 correlation of a length at lags of log r."""
    x = math.sqrt(5.0) * np.abs(lag) / length
    return np.asarray((1.0 + x + x * x / 3.0) * np.exp(-x))


def _matern_slope(lag: Array) -> Array:
    """Return the derivative of `matern`."""
    x = math.sqrt(5.0) * np.abs(lag) / DISCREPANCY_LENGTH
    size = math.sqrt(5.0) / DISCREPANCY_LENGTH * x * (1.0 + x) / 3.0 * np.exp(-x)
    return np.asarray(-np.sign(lag) * size)


@dataclasses.dataclass(frozen=True, eq=False)
class DiscrepancyBasis:
    """Karhunen-Loeve functions of the process: with independent standard normal coefficients.

    Attributes
    ----------
    first : float
        log r of the first knot.
    spacing : float
        Distance of the knots in log r.
    knots : ndarray, shape (knots, 2, functions)
        Value, and slope times spacing, of every function of a process of unit standard deviation;
        cubic between knots, constant outside.
    """

    first: float
    spacing: float
    knots: Array

    @property
    def size(self) -> int:
        """Number of functions."""
        return int(self.knots.shape[2])

    def _place(self, log_r: Array) -> tuple[Array, NDArray[np.intp]]:
        """Place in the cell, in 0 to 1, and the knot left of it."""
        x = np.clip((log_r - self.first) / self.spacing, 0.0, self.knots.shape[0] - 1.0)
        i = np.minimum(x.astype(int), self.knots.shape[0] - 2)
        return (x - i)[..., None], i

    def _cell(self, log_r: Array) -> tuple[Array, Array, Array]:
        """Place in the cell, in 0 to 1, and the knots left and right of it."""
        t, i = self._place(log_r)
        return t, self.knots[i], self.knots[i + 1]

    def slopes(self, log_r: Array) -> Array:
        """Return the derivatives of all functions, shape (*log_r.shape, functions)."""
        t, left, right = self._cell(log_r)
        rest = 1.0 - t
        inside = (log_r > self.first) & (
            log_r < self.first + self.spacing * (self.knots.shape[0] - 1)
        )
        slope = 6.0 * t * rest * (right[..., 0, :] - left[..., 0, :])
        slope += rest * (1.0 - 3.0 * t) * left[..., 1, :] + t * (3.0 * t - 2.0) * right[..., 1, :]
        return np.asarray(np.where(inside[..., None], slope / self.spacing, 0.0))

    def values(self, log_r: Array) -> Array:
        """Return all functions at given log ranges, shape (*log_r.shape, functions)."""
        t, left, right = self._cell(log_r)
        return _cubic(t, left, right)

    def sums(self, log_r: Array, coefficients: Array) -> Array:
        """Return a sum of the functions in every row, at log ranges of its own.

        Parameters
        ----------
        log_r : ndarray, shape (n, m)
            Log ranges.
        coefficients : ndarray, shape (n, functions)
            Of the functions.

        Returns
        -------
        ndarray, shape (n, m)
        """
        curves = np.tensordot(coefficients, self.knots, axes=(1, 2))
        t, i = self._place(log_r)
        row = np.arange(len(log_r))[:, None]
        return _cubic(t, curves[row, i, :, None], curves[row, i + 1, :, None])[..., 0]


def _cubic(t: Array, left: Array, right: Array) -> Array:
    """Return Hermite's cubic at a place in a cell, of values and slopes at its ends."""
    rest = 1.0 - t
    return np.asarray(
        rest * rest * ((1.0 + 2.0 * t) * left[..., 0, :] + t * left[..., 1, :])
        + t * t * ((3.0 - 2.0 * t) * right[..., 0, :] - rest * right[..., 1, :])
    )


@functools.lru_cache(maxsize=16)
def discrepancy_basis(low: float, high: float, neglected: float = NEGLECTED) -> DiscrepancyBasis:
    """Make the basis for ranges between two bounds.

    Parameters
    ----------
    low, high : float
        [m], ``high`` positive.
    neglected : float
        Share of the variance that may be left out.

    Returns
    -------
    DiscrepancyBasis
        As few functions as leave out no more.
    """
    last = math.log(high)
    first = max(math.log(low), last - _LONGEST) if low > 0 else last - _LONGEST
    first = min(first, last - _SPACING)
    count = max(math.ceil((last - first) / (_SPACING * DISCREPANCY_LENGTH)), 4) + 1
    u = np.linspace(first, last, count)
    values, vectors = scipy.linalg.eigh(matern(u[:, None] - u[None, :]))
    values, vectors = values[::-1], vectors[:, ::-1]
    # eigenvectors are known but for their signs, and draws must be the same everywhere
    vectors = vectors * np.where(vectors[0] < 0.0, -1.0, 1.0)
    size = int(np.searchsorted(np.cumsum(values), (1.0 - neglected) * count)) + 1
    values, vectors = values[:size], vectors[:, :size]
    knots = np.empty((count, 2, size))
    knots[:, 0] = vectors * np.sqrt(values)
    spacing = float(u[1] - u[0])
    slopes = _matern_slope(u[:, None] - u[None, :]) @ vectors / np.sqrt(values)
    knots[:, 1] = spacing * slopes
    knots.flags.writeable = False
    return DiscrepancyBasis(first, spacing, knots)
