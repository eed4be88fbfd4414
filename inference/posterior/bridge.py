"""Bridge sampling: evidence where importance weights cannot be trusted.

Draws of the posterior stand for what a mixture reaches too seldom, and draws of the mixture for
its constant (Meng and Wong 1996). The posterior's draws come from a population of walkers.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.posterior.collapsed import CollapsedDensity
from inference.posterior.proposal import Mixture

__all__ = ["Walked", "bridge", "walk"]

Array = NDArray[np.float64]

_BATCHES = 8
_BURN = 0.5  # share of the steps that is not kept
_KEEP_EVERY = 5
_INDEPENDENT = 0.5  # share of the moves that propose from the mixture
_JITTER = 1e-5


@dataclasses.dataclass(frozen=True, eq=False)
class Walked:
    """Draws of a population of walkers.

    Attributes
    ----------
    z : ndarray, shape (kept, walkers, d)
        Draws of the later half of the steps.
    log_density : ndarray, shape (kept, walkers)
        Target log density.
    calls : int
        Density evaluations.
    """

    z: Array
    log_density: Array
    calls: int


def walk(
    density: CollapsedDensity, mixture: Mixture, z: Array, rng: np.random.Generator, steps: int
) -> Walked:
    """Move walkers by differential evolution and by independent proposals of a mixture.

    Each half of the walkers moves by differences of the other half, so that the target is left
    invariant (ter Braak 2006; Foreman-Mackey et al. 2013, section 3).

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    mixture : Mixture
        Independent proposals.
    z : ndarray, shape (walkers, d)
        Start, of positive density.
    rng : numpy.random.Generator
        Source of randomness.
    steps : int
        Moves of every walker.

    Returns
    -------
    Walked
    """
    n, d = z.shape
    z, target, proposal = z.copy(), density(z), mixture.log_density(z)
    kept, kept_density = [], []
    jump = 2.38 / math.sqrt(2 * d)
    for step in range(steps):
        order = rng.permutation(n)
        for mine, others in (
            (order[: n // 2], order[n // 2 :]),
            (order[n // 2 :], order[: n // 2]),
        ):
            m = mine.size
            independent = rng.random() < _INDEPENDENT
            if independent:
                trial = mixture.draw(rng, m)
            else:
                i = rng.integers(others.size, size=m)
                j = (i + rng.integers(1, others.size, size=m)) % others.size
                # now and then a whole difference: a jump from mode to mode
                length = np.where(rng.random(m) < 0.1, 1.0, jump * np.exp(0.5 * rng.normal(size=m)))
                trial = z[mine] + length[:, None] * (z[others[i]] - z[others[j]])
                trial = trial + _JITTER * rng.standard_normal((m, d))
            found, toward = density(trial), mixture.log_density(trial)
            gain = found - target[mine]
            if independent:
                gain = gain + proposal[mine] - toward
            accept = np.log(rng.random(m)) < gain
            moved = mine[accept]
            z[moved], target[moved], proposal[moved] = trial[accept], found[accept], toward[accept]
        if step >= _BURN * steps and step % _KEEP_EVERY == 0:
            kept.append(z.copy())
            kept_density.append(target.copy())
    return Walked(np.array(kept), np.array(kept_density), steps * n)


def _estimate(walked: Array, drawn: Array, share: float) -> float:
    """Iterate the optimal bridge from log ratios of target to mixture; share of the walked."""
    top = float(np.median(walked))
    a, b = walked - top, drawn - top
    first, second = math.log(share), math.log1p(-share)
    value = 0.0
    for _ in range(1000):
        above = special.logsumexp(b - np.logaddexp(first + b, second + value)) - math.log(b.size)
        below = special.logsumexp(-np.logaddexp(first + a, second + value)) - math.log(a.size)
        before, value = value, float(above - below)
        if not abs(value - before) > 1e-9:
            break
    return value + top


def bridge(
    walked: Walked, mixture: Mixture, drawn: Array, drawn_density: Array
) -> tuple[float, float]:
    """Estimate the log of the integral of the target.

    Parameters
    ----------
    walked : Walked
        Draws of the target.
    mixture : Mixture
        Not fitted to these draws.
    drawn : ndarray, shape (n, d)
        Draws of the mixture.
    drawn_density : ndarray, shape (n,)
        Target log density of them.

    Returns
    -------
    (float, float)
        Log integral, and its standard error from batches of walkers.
    """
    steps, walkers, d = walked.z.shape
    ratio = walked.log_density - mixture.log_density(walked.z.reshape(-1, d)).reshape(
        steps, walkers
    )
    other = drawn_density - mixture.log_density(drawn)
    # walkers forget slowly: each counts for a few of its draws at most
    share = 2 * walkers / (2 * walkers + len(drawn))
    value = _estimate(ratio.ravel(), other, share)
    parts = [
        _estimate(ratio[:, k::_BATCHES].ravel(), other[k::_BATCHES], share) for k in range(_BATCHES)
    ]
    return value, float(np.std(parts, ddof=1)) / math.sqrt(_BATCHES)
