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
        if not far.size:
            return _Far(far, squares)
        falls = np.where(squares > 0.0, self.beside, 0.0)
        frames, own, counts = np.unique(frame, return_inverse=True, return_counts=True)
        # rows of a frame side by side, what is missing without effect
        order = np.argsort(own, kind="stable")
        place = np.empty_like(own)
        place[order] = np.arange(own.size) - np.repeat(np.cumsum(counts) - counts, counts)
        many = int(counts.max())
        parts, shares = np.zeros((frames.size, many)), np.zeros((frames.size, many, basis.shape[1]))
        parts[own, place], shares[own, place] = left, basis
        free = np.eye(many) - shares @ shares.transpose(0, 2, 1)
        inverse = np.linalg.pinv(free, rcond=1e-12, hermitian=True)
        falls[frames] += np.einsum("ni,nij,nj->n", parts, inverse, parts)
        return _Far(far, falls)

    def _without(self, out: list[int]) -> tuple[Array, Array, NDArray[np.intp]]:
        """Return what a fit without some frames leaves of the others' rows, and its basis there."""
        kept = ~np.isin(self.frame, out)
        rows, before = self.rows[kept], self.before[kept]
        basis = scipy.linalg.qr(np.concatenate([rows, np.eye(rows.shape[1])]), mode="economic")[0]
        basis = basis[: len(rows)]
        return before - basis @ (basis.T @ before), basis, self.frame[kept]
