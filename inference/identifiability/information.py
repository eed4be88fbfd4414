"""Fisher information of readings, every range eliminated: rank and Cramer-Rao bounds."""

import dataclasses
import functools

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["Information"]

Array = NDArray[np.float64]

_EPS = float(np.finfo(np.float64).eps)
# rounding errors of one entry of the projected Jacobian, in units of eps times what was there
# before the projection: the derivatives have about ten operations each, and twice as many follow
_OPERATIONS = 30.0


@dataclasses.dataclass(frozen=True, eq=False)
class Information:
    """What readings tell of d unknowns x, the ranges of all frames being unknown too.

    Nothing of a prior is in it, and nothing of what the scatter itself tells (a covariance that
    depends on x), which is smaller by the square of the relative noise.

    Attributes
    ----------
    names : tuple of str
        The unknowns.
    jacobian : ndarray, shape (m, d)
        Whitened derivatives of the readings along x, across each frame's range direction: one row
        a frame with an object, two for one without.
    before : ndarray, shape (m, d)
        Size of the entries before the projection; rounding errors are in proportion to it.
    response : ndarray, shape (n, d)
        d log r_i / dx along which frame i's readings stay as near as they can; nan for a frame
        without object.
    own_variance : ndarray, shape (n,)
        Variance of log r_i with x known; inf where the readings do not depend on r_i, nan for a
        frame without object.
    errors : ndarray, shape (m, k)
        Derivatives along k independent standard normal errors that all frames share, projected as
        ``jacobian`` is.
    error_response : ndarray, shape (n, k)
        d log r_i along them, as ``response``.
    common_range : bool
        Whether all frames have one range, which is eliminated once.
    drifts : ndarray, shape (n, j), optional
        d log r_i along j more such errors, of which no reading tells anything; left out: none.
    """

    names: tuple[str, ...]
    jacobian: Array
    before: Array
    response: Array
    own_variance: Array
    errors: Array
    error_response: Array
    common_range: bool = False
    drifts: Array | None = None

    @functools.cached_property
    def _equilibrated(self) -> tuple[Array, Array, Array]:
        """Column scale, singular values and right singular vectors, rows and columns scaled.

        The rank does not depend on the noise: rows are scaled too.
        """
        d = len(self.names)
        rows = np.linalg.norm(self.before, axis=1)
        used = rows > 0
        if not used.any():  # of nothing unknown, or of nothing that is read
            return np.ones(d), np.zeros(d), np.eye(d)
        scaled = self.before[used] / rows[used, None]
        columns = np.linalg.norm(scaled, axis=0)
        columns = np.where(columns > 0, columns, 1.0)
        # a second turn: a row of one faint unknown alone counts as much as any other
        rows = rows[used] * np.linalg.norm(scaled / columns, axis=1)
        columns = np.linalg.norm(self.before[used] / rows[:, None], axis=0)
        columns = np.where(columns > 0, columns, 1.0)
        matrix = self.jacobian[used] / rows[:, None] / columns
        _, values, vectors = scipy.linalg.svd(_triangle(matrix), full_matrices=True)
        return columns, np.pad(values, (0, d - values.size)), vectors.T

    @property
    def resolution(self) -> float:
        """Least singular value of the equilibrated Jacobian that rounding lets one tell from 0."""
        return _OPERATIONS * _EPS * float(np.sqrt(self.jacobian.size))

    @property
    def rank(self) -> int:
        """Number of directions of x that noise-free readings would tell.

        Singular values of the Jacobian with rows and columns scaled to the size that they had
        before the projection, above `resolution`.
        """
        return int(np.sum(self._equilibrated[1] > self.resolution))

    @property
    def margin(self) -> float:
        """Least singular value that counts as non-zero, as a multiple of `resolution`."""
        return float(self._equilibrated[1][self.rank - 1]) / self.resolution if self.rank else 0.0

    def _with_errors(self, columns: Array) -> Array:
        """Return the triangle of the shared errors and of given columns, the errors first."""
        k = self.errors.shape[1]
        prior = np.hstack([np.eye(k), np.zeros((k, columns.shape[1]))])
        return _triangle(np.vstack([np.hstack([self.errors, columns]), prior]))

    @functools.cached_property
    def singular_values(self) -> Array:
        """Singular values of the Jacobian, descending, those beyond the rank exactly 0, (d,).

        Where frames share errors, those of what the errors leave.
        """
        d, k = len(self.names), self.errors.shape[1]
        if d == 0:
            return np.empty(0)
        columns = np.linalg.norm(self.jacobian, axis=0)
        columns = np.where(columns > 0, columns, 1.0)
        # graded columns are scaled for the triangle only, which keeps their relative accuracy
        triangle = self._with_errors(self.jacobian / columns)[k:, k:] * columns
        values = scipy.linalg.svdvals(triangle) if triangle.size else np.empty(0)
        values = np.pad(values, (0, d - values.size))
        values[self.rank :] = 0.0
        return values

    @functools.cached_property
    def null_space(self) -> Array:
        """Directions of x that leave all readings as they are, shape (d, d - rank)."""
        columns, _, vectors = self._equilibrated
        null = vectors[:, self.rank :] / columns[:, None]
        return np.asarray(null / np.linalg.norm(null, axis=0))

    def companions(self, index: int) -> Array:
        """Return how x moves with one unknown while all readings stay as they are.

        Parameters
        ----------
        index : int
            Of an unknown that the readings do not tell.

        Returns
        -------
        ndarray, shape (d,)
            The direction of the null space nearest to the unknown, whose own part in it is 1.
        """
        columns, _, vectors = self._equilibrated
        null = vectors[:, self.rank :]
        direction = null @ null[index] / columns
        return np.asarray(direction / direction[index])

    @functools.cached_property
    def factors(self) -> tuple[Array, Array]:
        """F of x, shape (d, k + rank), and of the shared errors, shape (k, k + rank)."""
        columns, _, vectors = self._equilibrated
        k = self.errors.shape[1]
        told = vectors[:, : self.rank] / columns[:, None]
        sizes = np.linalg.norm(self.jacobian @ told, axis=0)
        told = told / np.where(sizes > 0, sizes, 1.0)
        triangle = self._with_errors(self.jacobian @ told)
        if triangle.size == 0:
            return np.zeros((len(self.names), 0)), np.zeros((0, 0))
        inverse = scipy.linalg.solve_triangular(triangle, np.eye(k + self.rank))
        return told @ inverse[k:], np.asarray(inverse[:k])

    @property
    def factor(self) -> Array:
        """F with F F^T the bound on the covariance inside the space that the readings tell."""
        return self.factors[0]

    def sd_of(self, functionals: Array, of_errors: Array | None = None) -> Array:
        """Return the Cramer-Rao bound on the standard deviation of linear functions of x.

        Parameters
        ----------
        functionals : ndarray, shape (k, d)
            Coefficients, a row each.
        of_errors : ndarray, shape (k, errors), optional
            Coefficients of the errors that the frames share.

        Returns
        -------
        ndarray, shape (k,)
            inf where a function has a part that the readings do not tell.
        """
        columns, values, vectors = self._equilibrated
        # what overflows is no number here, and a function that is none is not told
        with np.errstate(over="ignore", invalid="ignore"):
            scaled = functionals / columns
            size = np.linalg.norm(scaled, axis=1)
            size = np.where(size > 0, size, 1.0)
            part = np.linalg.norm(scaled @ vectors[:, self.rank :], axis=1) / size
            product = functionals @ self.factors[0]
            if of_errors is not None:
                product = product + of_errors @ self.factors[1]
            bound = np.linalg.norm(product, axis=1)
        # rounding turns the null space by its size over the gap
        least = values[self.rank - 1] if self.rank else 1.0
        told = part <= min(1e-12 + 10 * self.resolution / least, 0.1)
        return np.where(told & ~np.isnan(bound), bound, np.inf)

    def directions(self) -> list[tuple[float, dict[str, float]]]:
        """Return the directions of x that the readings tell worst, and their bounds.

        Returns
        -------
        list of (float, dict)
            A basis of those that they do not tell at all (inf), then the worst of the others: the
            weights, normalised, of the unknowns that make it up; those below 1 % are left out.
        """
        found = [(np.inf, vector) for vector in self.null_space.T]
        if self.rank > 0:
            vectors, sizes, _ = scipy.linalg.svd(self.factor, full_matrices=False)
            found.append((float(sizes[0]), vectors[:, 0]))
        named = []
        for sd, vector in found:
            # the sign is free: the largest weight is positive
            signed = vector * np.sign(vector[np.argmax(np.abs(vector))])
            weights = zip(self.names, signed.tolist(), strict=True)
            named.append((sd, {name: weight for name, weight in weights if abs(weight) >= 0.01}))
        return named

    @functools.cached_property
    def sd(self) -> Array:
        """Cramer-Rao bound of every unknown, shape (d,); inf where it is not identifiable."""
        return self.sd_of(np.eye(len(self.names)))

    @functools.cached_property
    def range_sd(self) -> Array:
        """Cramer-Rao bound of every log r, shape (n,); nan for a frame without object."""
        present = np.isfinite(self.response).all(axis=1) & ~np.isnan(self.own_variance)
        sd = np.full(self.own_variance.size, np.nan)
        shared = self.sd_of(self.response[present], self.error_response[present])
        sd[present] = np.sqrt(self.own_variance[present] + shared**2)
        return sd if self.drifts is None else np.hypot(sd, np.linalg.norm(self.drifts, axis=1))

    @functools.cached_property
    def scale_sd(self) -> float:
        """Cramer-Rao bound of the mean of log r over the frames; nan where none has an object."""
        present = ~np.isnan(self.own_variance)
        n = int(present.sum())
        if n == 0:
            return float("nan")
        own = float(self.own_variance[present].sum()) / n
        own /= 1 if self.common_range else n
        mean, of_errors = (
            part[present].mean(axis=0)[None] for part in (self.response, self.error_response)
        )
        shared = self.sd_of(mean, of_errors)[0]
        if self.drifts is not None:
            own += float(np.square(self.drifts[present].mean(axis=0)).sum())
        return float(np.sqrt(own + shared**2))


def _triangle(matrix: Array) -> Array:
    """Return R of a QR decomposition with rows sorted by size, which is stable for each row."""
    order = np.argsort(-np.abs(matrix).max(axis=1, initial=0.0))
    return np.asarray(scipy.linalg.qr(matrix[order], mode="r")[0][: matrix.shape[1]])
