"""A posterior of one or two unknowns as a quadrature: lines along one, peaks along each line.

Two unknowns are integrated twice, lines along the one and lines along the other. A mode that one
of them passes by lowers its evidence; what both have is taken for whole.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from tests.extreme.peaks import Heights, Nodes, integrated, laplace, tops_of

__all__ = ["Reference", "reference_of"]

Array = NDArray[np.float64]
Density = Callable[[Array], Array]

# of the grids on which peaks are looked for, among lines and along each
_POINTS = ((101, 101), (101, 301))
_OFF_MEAN = 0.02  # standard deviations
_OFF_SD = 0.03  # relative
_OFF_EVIDENCE = 0.01  # nat


@dataclasses.dataclass(frozen=True, eq=False)
class Reference:
    """Nodes of a quadrature of a posterior.

    Attributes
    ----------
    z : ndarray, shape (n, d)
        Coordinates.
    values : ndarray, shape (n, d)
        The unknowns.
    weights : ndarray, shape (n,)
        Sum to one.
    log_evidence : float
        Log integral over z.
    error : float
        Largest difference of two quadratures, in shares of what is allowed; less than 1.
    """

    z: Array
    values: Array
    weights: Array
    log_evidence: float
    error: float

    @property
    def mean(self) -> Array:
        """Means of the unknowns, shape (d,)."""
        return np.asarray(self.weights @ self.values)

    def moment(self, order: int) -> Array:
        """Central moments of the unknowns, shape (d,)."""
        return np.asarray(self.weights @ (self.values - self.mean) ** order)

    @property
    def sd(self) -> Array:
        """Standard deviations of the unknowns, shape (d,)."""
        return np.sqrt(self.moment(2))

    @property
    def precision(self) -> float:
        """Largest variance of the prior over that of the posterior."""
        return float(1 / (self.weights @ (self.z - self.weights @ self.z) ** 2).min())


def reference_of(density: Density, natural: Density, d: int) -> Reference | None:
    """Integrate a posterior.

    Parameters
    ----------
    density : callable
        Log density at z, shape (n, d).
    natural : callable
        The unknowns at z, shape (n, d).
    d : int
        One or two.

    Returns
    -------
    Reference or None
        None where two quadratures differ on the finest grid too, or no grid meets any density.
    """
    for points in _POINTS:
        if d == 1:
            fine, coarse = (_along_one(density, count * points[1]) for count in (2, 4))
        else:
            fine, coarse = (_along_two(density, outer, points) for outer in (0, 1))
        if not (len(fine[0]) and len(coarse[0])):
            continue
        one, other = (_reference(natural, *nodes) for nodes in (fine, coarse))
        off = max(
            float(np.max(np.abs(one.mean - other.mean) / one.sd)) / _OFF_MEAN,
            float(np.max(np.abs(np.log(one.sd / other.sd)))) / _OFF_SD,
            abs(one.log_evidence - other.log_evidence) / _OFF_EVIDENCE,
        )
        if off < 1:
            best = one if one.log_evidence > other.log_evidence else other
            return dataclasses.replace(best, error=off)
    return None


def _reference(natural: Density, z: Array, logs: Array) -> Reference:
    evidence = float(logsumexp(logs))
    return Reference(z, natural(z), np.exp(logs - evidence), evidence, np.nan)


def _along_one(density: Density, points: int) -> tuple[Array, Array]:
    def heights(_: NDArray[np.intp], place: Array) -> Array:
        return density(place[:, None])

    nodes = integrated(heights, tops_of(heights, 1, points), 1)
    return nodes.place[:, None], nodes.fine


def _along_two(density: Density, outer: int, points: tuple[int, int]) -> tuple[Array, Array]:
    """Integrate over the lines of one unknown, and over the other along each."""
    order = [0, 1] if outer == 0 else [1, 0]
    seen: dict[float, tuple[Array, Array]] = {}

    def along(x: Array) -> Heights:
        return lambda line, place: density(np.column_stack([x[line], place])[:, order])

    def roughly(_: NDArray[np.intp], x: Array) -> Array:
        return laplace(tops_of(along(x), len(x), points[1]), len(x))

    def exactly(_: NDArray[np.intp], x: Array) -> Array:
        heights = along(x)
        nodes: Nodes = integrated(heights, tops_of(heights, len(x), points[1]), len(x))
        out = np.full(len(x), -np.inf)
        for k in np.unique(nodes.line):
            of = nodes.line == k
            out[k] = logsumexp(nodes.fine[of])
            seen[float(x[k])] = nodes.place[of], nodes.fine[of] - out[k]
        return out

    lines = integrated(exactly, tops_of(roughly, 1, points[0]), 1)
    held = [k for k, x in enumerate(lines.place) if float(x) in seen]
    if not held:
        return np.empty((0, 2)), np.empty(0)
    inner = [seen[float(lines.place[k])] for k in held]
    x = np.repeat(lines.place[held], [len(y) for y, _ in inner])
    y = np.concatenate([y for y, _ in inner])
    weights = np.concatenate([lines.fine[k] + w for k, (_, w) in zip(held, inner, strict=True)])
    return np.column_stack([x, y])[:, order], weights
