"""A linear fit of frames without some of them: which few the others cannot be fitted with."""

import dataclasses
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["Refit"]

Array = NDArray[np.float64]

_MOST = 50  # frames that are left out, and half of all: beyond, which are right is not known


class _Far(NamedTuple):
    frames: NDArray[np.intp]
    falls: Array


@dataclasses.dataclass(frozen=True, eq=False)
class Refit:
    """Residuals of frames before they are fitted, and what the fit can follow.

    Attributes
    ----------
    before : ndarray, shape (rows,)
        Residuals, in units of the noise.
    rows : ndarray, shape (rows, d)
        Their derivatives along unknowns with standard normal priors.
    frame : ndarray of int, shape (rows,)
        Of which frame each row is.
    beside : ndarray, shape (n,)
        Squares that no unknown can follow.
    """

    before: Array
    rows: Array
    frame: NDArray[np.intp]
    beside: Array

    def outlying(self, limit: float) -> NDArray[np.intp]:
        """Leave out the worst frame until the fit of the others has none above a limit.

        A frame far off bends a fit, and others lie off that. The worst is the one without which
        chi-square falls most (deletion residuals: Cook and Weisberg 1982).

        Parameters
        ----------
        limit : float
            Of the squared residual of a frame, after the fit.

        Returns
        -------
        ndarray of int
            Frames, ascending; all that are far off the first fit where too many would go.
        """
        out: list[int] = []
        first: NDArray[np.intp] | None = None
        while (far := self._far(out, limit)).frames.size:
            first = far.frames if first is None else first
            if len(out) == min(_MOST, self.beside.size // 2):
                return first
            out.append(int(np.argmax(far.falls)))
        # what was taken for the worst while others bent the fit
        for k in tuple(out):
            rest = [j for j in out if j != k]
            if not self._far(rest, limit).frames.size:
                out = rest
        return np.sort(np.array(out, dtype=np.intp))

    def _far(self, out: list[int], limit: float) -> "_Far":
        """Return which frames are above a limit, without some, and what each makes worse."""
        left, basis, frame = self._without(out)
        squares = self.beside + np.bincount(frame, np.square(left), self.beside.size)
        squares[out] = 0.0
        far = np.flatnonzero(squares > limit)
        falls = np.zeros_like(squares)
        for k in np.unique(frame).tolist() if far.size else ():
            falls[k] = self.beside[k] + _fall(left[frame == k], basis[frame == k])
        return _Far(far, falls)

    def _without(self, out: list[int]) -> tuple[Array, Array, NDArray[np.intp]]:
        """Return what a fit without some frames leaves of the others' rows, and its basis there."""
        kept = ~np.isin(self.frame, out)
        rows, before = self.rows[kept], self.before[kept]
        basis = scipy.linalg.qr(np.concatenate([rows, np.eye(rows.shape[1])]), mode="economic")[0]
        basis = basis[: len(rows)]
        return before - basis @ (basis.T @ before), basis, self.frame[kept]


def _fall(left: Array, basis: Array) -> float:
    """Return by what chi-square falls without rows of which a fit leaves so much."""
    free = np.eye(len(left)) - basis @ basis.T
    return float(left @ np.linalg.lstsq(free, left, rcond=1e-12)[0])
