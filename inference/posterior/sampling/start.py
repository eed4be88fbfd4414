"""Starting points: a screen of the prior, Levenberg-Marquardt with ranges eliminated, all optima.

The fits climb the joint density of parameters and best ranges, which is cheap to linearise but
biased (incidental parameters); each optimum is then refined on the collapsed density itself.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.profile import linearise

__all__ = [
    "Finish",
    "Optimum",
    "added",
    "climb",
    "curvature_factor",
    "derivatives",
    "find_optima",
    "lower_factor",
    "refine",
    "roughly",
]

Array = NDArray[np.float64]

# of a standard deviation: the log density is then near quadratic, differences are exact
_DIFFERENCE = 0.05
_SCREEN = 600  # points of the prior that are looked at
_CLIMBS = 10  # of which the best, spread out, are climbed
_ITERATIONS = 60
_FOLLOWED = 4  # of them, the best, that are climbed on where they are not at the top
_NEAR = 0.5  # standard deviations within which two optima are one
_MORE_ITERATIONS = 340  # the valleys of readings a million times above their noise are long
# of climbs whose ends are climbed on from: the best are then within some nats of their tops
_BRIEF = (15, 25)


@dataclasses.dataclass(frozen=True, eq=False)
class Optimum:
    """A local maximum of the collapsed density.

    Attributes
    ----------
    z : ndarray, shape (d,)
        Where.
    log_density : float
        Its collapsed log density.
    factor : ndarray, shape (d, d)
        Lower triangular L with L L^T the inverse of the negative Hessian there.
    """

    z: Array
    log_density: float
    factor: Array

    @property
    def log_mass(self) -> float:
        """Log of its Laplace mass."""
        d = self.z.size
        logdet = float(np.log(np.diagonal(self.factor)).sum())
        return self.log_density + logdet + 0.5 * d * math.log(2 * math.pi)

    def is_near(self, z: Array) -> bool:
        """Tell whether z of shape (d,) lies within half a standard deviation."""
        step = scipy.linalg.solve_triangular(self.factor, z - self.z, lower=True)
        return bool(np.linalg.norm(step) < _NEAR)


Finish = Callable[[CollapsedDensity, Array], Optimum | None]


def added(optima: Sequence[Optimum], found: Optimum | None) -> list[Optimum]:
    """Return optima, the best first, with one more if it is not among those found before."""
    if found is None or any(other.is_near(found.z) for other in optima):
        return list(optima)
    return sorted([*optima, found], key=lambda optimum: -optimum.log_density)


def _profile(density: CollapsedDensity, z: Array) -> tuple[Array, Array]:
    """Log density at the best ranges, shape (n,), and those log ranges, shape (n, frames)."""
    found = density.best_ranges(z)
    value = density.total(found[:, :, 1]) + density.parameters.log_prior(z)
    return np.where(np.isnan(value), -np.inf, value), found[:, :, 0]


def climb(
    density: CollapsedDensity, z: Array, iterations: int = _ITERATIONS
) -> tuple[Array, float]:
    """Climb to a maximum of the joint density of parameters and ranges.

    Parameters
    ----------
    z : ndarray, shape (d,)
        Start.
    iterations : int
        At most so many Levenberg-Marquardt steps.

    Returns
    -------
    (ndarray, float)
        The end point and its joint log density.
    """
    value, positions = (part[0] for part in _profile(density, z[None]))
    damping = 1e-3
    d = z.size
    for _ in range(iterations):
        if not np.isfinite(value):
            break
        line = linearise(density, z, positions)
        matrix = np.concatenate([line.jacobian.reshape(-1, d), np.eye(d)])
        target = -np.concatenate([line.residual.ravel(), z])
        if not (np.isfinite(matrix).all() and np.isfinite(target).all()):
            break
        scale = np.linalg.norm(matrix, axis=0)
        q, r = scipy.linalg.qr(matrix / scale, mode="economic")
        right = q.T @ target
        improved = False
        for _ in range(10):
            # damped in scaled columns: the augmented system, never the normal equations
            stacked = np.concatenate([r, np.sqrt(damping) * np.eye(d)])
            step = scipy.linalg.lstsq(stacked, np.concatenate([right, np.zeros(d)]))[0] / scale
            trial = z + np.clip(step, -2.0, 2.0)
            trial_value, trial_positions = (part[0] for part in _profile(density, trial[None]))
            if trial_value > value:
                improved = True
                break
            damping = max(damping, 1e-8) * 8.0
        if not improved:
            break
        gain = trial_value - value
        z, value, positions = trial, trial_value, trial_positions
        damping = max(damping / 10.0, 1e-12)
        if gain < 1e-3:
            break
    return z, float(value)


def curvature_factor(density: CollapsedDensity, z: Array) -> Array:
    """Return the inverse square root of the Gauss-Newton information at z, shape (d, d)."""
    positions = density.best_ranges(z[None])[0, :, 0]
    line = linearise(density, z, positions)
    matrix = np.concatenate([line.jacobian.reshape(-1, z.size), np.eye(z.size)])
    r = scipy.linalg.qr(matrix, mode="economic")[1]
    return np.asarray(scipy.linalg.solve_triangular(r, np.eye(z.size)))


def derivatives(
    density: Callable[[Array], Array], z: Array, frame: Array, h: float = _DIFFERENCE
) -> tuple[float, Array, Array]:
    """Return value, gradient and Hessian along the columns of a frame, by central differences.

    Parameters
    ----------
    density : callable
        Log density of points of shape (n, d), shape (n,).
    z : ndarray, shape (d,)
        Where.
    frame : ndarray, shape (d, d)
        Directions, as long as the density is wide there.
    h : float
        Step, of a column.
    """
    d = z.size
    pairs = [(i, j) for i in range(d) for j in range(i)]
    steps = [np.zeros(d)]
    for i in range(d):
        steps += [h * np.eye(d)[i], -h * np.eye(d)[i]]
    for i, j in pairs:
        both = h * (np.eye(d)[i] + np.eye(d)[j])
        steps += [both, -both]
    values = density(z + np.array(steps) @ frame.T)
    centre = values[0]
    plus, minus = values[1 : 2 * d + 1 : 2], values[2 : 2 * d + 1 : 2]
    # where the density ends within a step, the result is not finite: steps then shrink
    with np.errstate(invalid="ignore"):
        gradient = (plus - minus) / (2 * h)
        hessian = np.diag((plus - 2 * centre + minus) / h**2)
        for k, (i, j) in enumerate(pairs):
            a, b = values[2 * d + 1 + 2 * k], values[2 * d + 2 + 2 * k]
            mixed = (a + b - 2 * centre) / h**2
            hessian[i, j] = hessian[j, i] = 0.5 * (mixed - hessian[i, i] - hessian[j, j])
    return float(centre), gradient, hessian


def refine(density: CollapsedDensity, z: Array) -> Optimum | None:
    """Climb the collapsed density by Newton steps and measure its curvature.

    Parameters
    ----------
    z : ndarray, shape (d,)
        A point near a maximum.

    Returns
    -------
    Optimum or None
        None where the density is not finite around the point.
    """
    frame = curvature_factor(density, z)
    best = float(density(z[None])[0])
    for _ in range(25):
        value, gradient, hessian = derivatives(density, z, frame)
        if not (np.isfinite(gradient).all() and np.isfinite(hessian).all()):
            frame = 0.3 * frame  # a bound of the support is near
            continue
        values, vectors = np.linalg.eigh(-hessian)
        # a direction that does not bend downwards is climbed as if it had the frame's scale
        bend = np.maximum(np.abs(values), 1e-3)
        step = vectors @ ((vectors.T @ gradient) / bend)
        length = float(np.linalg.norm(step))
        step *= min(1.0, 3.0 / max(length, 1e-300))
        frame = frame @ (vectors / np.sqrt(np.maximum(values, 1e-2)))
        trials = z + np.outer(0.5 ** np.arange(6), step) @ _previous(frame, vectors, values).T
        found = density(trials)
        k = int(np.argmax(found))
        if found[k] > value:
            z, best = trials[k], float(found[k])
        if length < 0.02 or not found[k] > value:
            break
    value, gradient, hessian = derivatives(density, z, frame)
    if not np.isfinite(hessian).all():
        return None
    values, vectors = np.linalg.eigh(-hessian)
    spread = frame @ (vectors / np.sqrt(np.maximum(values, 1e-2)))
    return Optimum(z, best, lower_factor(spread))


def _previous(frame: Array, vectors: Array, values: Array) -> Array:
    """Undo the last rescaling of a frame."""
    return (frame * np.sqrt(np.maximum(values, 1e-2))) @ vectors.T


def roughly(density: CollapsedDensity, z: Array) -> Optimum | None:
    """Return a point as an optimum whose shape is that of Gauss-Newton information alone.

    It takes one evaluation where `refine` takes thousands, and does for what climbs on in
    coordinates of its own.

    Parameters
    ----------
    z : ndarray, shape (d,)
        A point near a maximum.

    Returns
    -------
    Optimum or None
        As of `refine`.
    """
    factor = curvature_factor(density, z)
    value = float(density(z[None])[0])
    if not (np.isfinite(value) and np.isfinite(factor).all() and np.diagonal(factor).all()):
        return None
    return Optimum(z, value, lower_factor(factor))


def lower_factor(spread: Array) -> Array:
    """Return the lower triangular L with L L^T = F F^T, its diagonal positive, shape (d, d)."""
    factor = scipy.linalg.qr(spread.T, mode="r")[0][: len(spread)].T
    return np.asarray(factor * np.sign(np.diagonal(factor)), dtype=np.float64)


def _spread_out(points: Array, values: Array, count: int) -> Array:
    """Return the best points that are not close to a better one."""
    chosen: list[int] = []
    for k in np.argsort(-values):
        if not np.isfinite(values[k]):
            break
        if all(np.linalg.norm(points[k] - points[j]) > 0.3 for j in chosen):
            chosen.append(int(k))
        if len(chosen) == count:
            break
    return points[chosen]


def find_optima(
    density: CollapsedDensity, rng: np.random.Generator, *, brief: bool = False
) -> list[Optimum]:
    """Find the maxima of the collapsed density that matter, the best first.

    Parameters
    ----------
    density : CollapsedDensity
        The density; at least one unknown.
    rng : numpy.random.Generator
        Source of the screen.
    brief : bool
        Whether short climbs are enough, and rough shapes: for what climbs on from there, in
        coordinates in which the valley is straight.

    Returns
    -------
    list of Optimum
        Distinct maxima within 20 nats of the best; empty where the density is nowhere finite.
    """
    optima: list[Optimum] = []
    visited: list[Optimum] = []
    finish, iterations = refine, (_ITERATIONS, _MORE_ITERATIONS)
    if brief:
        finish, iterations = roughly, _BRIEF
    ends = _climbed(density, rng, *iterations)
    for z, value in ends:
        if not np.isfinite(value) or value < ends[0][1] - 60.0:
            continue
        if any(one.is_near(z) for one in visited):
            continue
        optimum = finish(density, z)
        if optimum is None:
            continue
        visited += [dataclasses.replace(optimum, z=z), optimum]
        if not any(one.is_near(optimum.z) for one in optima):
            optima.append(optimum)
    optima.sort(key=lambda optimum: -optimum.log_density)
    return [o for o in optima if o.log_density > optima[0].log_density - 20.0]


def _climbed(
    density: CollapsedDensity, rng: np.random.Generator, iterations: int, more: int
) -> list[tuple[Array, float]]:
    """Climb the joint density from the best points of the prior; the best ends first."""
    screen = density.parameters.sample(rng, _SCREEN)
    screen[0] = 0.0
    starts = _spread_out(screen, _profile(density, screen)[0], _CLIMBS)
    ends = sorted((climb(density, start, iterations) for start in starts), key=lambda end: -end[1])
    best, others = ends[:_FOLLOWED], ends[_FOLLOWED:]
    best = [climb(density, z, more) for z, value in best if np.isfinite(value)]
    return sorted([*best, *others], key=lambda end: -end[1])
