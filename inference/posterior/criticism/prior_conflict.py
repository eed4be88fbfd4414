"""A prior that ends, or fades, before what the data point to: the answer is then the prior's doing.

Three findings, none of which depends on how the walkers moved.

* Most draws of an unknown lie where its prior is least dense, in a part of next to no mass. If the
  truth comes from the prior, more than half of a posterior lies in a part of the prior's mass eps
  with probability at most 2 eps (Markov), whatever the model. The end at which a prior is densest,
  the zero of a half normal one, is no such part: it is stated of light that may be none at all.
* Most draws lie near an end of the prior's support, and the likelihood, the other unknowns giving
  way, and errors of the model as large as are allowed for, still climbs there by many of its own
  standard errors: a score test (Rao 1948), which does not depend on the coordinates.
* Most draws of a range lie where its prior has next to no mass; or near an end of it, and without
  that end the frame (all frames, of a static object) would fit far better: a likelihood ratio.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.profile import linearise
from inference.density.static import StaticDensity
from inference.posterior.criticism.errors_left import errors_left
from simulator.model_error import ModelError
from simulator.priors import Distribution, NormalDistribution, UniformDistribution
from simulator.scene import Reference, Stroke

__all__ = [
    "are_far_out",
    "parameter_conflicts",
    "prior_conflicts",
    "range_conflicts",
    "ranges_beyond",
    "scores",
]

Array = NDArray[np.float64]

_TAIL = 4.4  # prior standard deviations: beyond lies a mass of 1.1e-5
_OUTER = 0.05  # share of a prior's mass that counts as near its end
_SCORE = 5.0  # standard errors
_GAIN = 15.0  # nats a frame may gain: half of a chi-square of 30 with at most 2 degrees of freedom
_DRAWS = 15
_BEYOND = 100.0  # factor by which the ranges are widened
_WIDER = 1.5  # at least


def are_far_out(density: CollapsedDensity, z: Array) -> bool:
    """Tell whether most draws of an unknown, shape (n, d), lie where its prior has no mass left."""
    return bool(np.any(_middle_deviations(density, z) > _TAIL))


def _middle_deviations(density: CollapsedDensity, z: Array) -> Array:
    return np.asarray(np.median(density.parameters.deviations(z), axis=0))


def prior_conflicts(
    density: CollapsedDensity,
    z: Array,
    log_r: Array,
    sampled: CollapsedDensity,
    error: ModelError,
) -> tuple[str, ...]:
    """Find unknowns and ranges whose posterior piles up where their prior ends.

    Parameters
    ----------
    z : ndarray, shape (n, d)
        Draws of equal weight.
    log_r : ndarray, shape (m, frames)
        Draws of the ranges; nan for a frame without object.
    sampled : CollapsedDensity
        That of which z are draws: of all frames, where those of the ranges are some of them.
    error : ModelError
        Of the scene: what an error as large as is allowed for may take up pulls no unknown.

    Returns
    -------
    tuple of str
        The reasons; empty as a rule. The truth being one of the prior, each unknown is named in at
        most 2.2e-5 + 6e-7 of runs, and each frame in 3e-7.
    """
    names = density.parameters.names

    def linearised(x: Array) -> tuple[Array, Array]:
        best = sampled.best_ranges(x[None])[0, :, 0]
        line = linearise(sampled, x, best, errors_left(sampled, x, best, error))
        return line.residual.ravel(), line.jacobian.reshape(-1, len(names))

    found = parameter_conflicts(names, z, linearised, _middle_deviations(density, z))
    return (*found, *range_conflicts(density, z, log_r))


def scores(jacobian: Array, residual: Array, z: Array) -> Array:
    """Return how strongly the data pull every unknown away from zero, in standard errors.

    Parameters
    ----------
    jacobian : ndarray, shape (n, d)
        Of the whitened residuals.
    residual : ndarray, shape (n,)
        Whitened.
    z : ndarray, shape (d,)
        Where; the other unknowns keep their standard normal priors.

    Returns
    -------
    ndarray, shape (d,)
        Efficient scores, standard normal where the truth is at z; positive outwards.
    """
    d = z.size
    result = np.zeros(d)
    for j in range(d):
        others = np.arange(d) != j
        rows = np.eye(d)[others]
        matrix = np.concatenate([jacobian, rows])
        target = np.concatenate([residual, z[others]])
        scale = np.linalg.norm(matrix, axis=0)
        if not scale[j] > 0:
            continue
        column = matrix[:, j]
        if d > 1:
            rest = matrix[:, others] / scale[others]
            column = column - rest @ scipy.linalg.lstsq(rest, column)[0]
        length = float(np.linalg.norm(column))
        if length > 1e-9 * scale[j]:
            result[j] = -float(column @ target) / length * math.copysign(1.0, z[j])
    return result


def parameter_conflicts(
    names: tuple[str, ...],
    z: Array,
    linearised: Callable[[Array], tuple[Array, Array]],
    off: Array | None = None,
) -> tuple[str, ...]:
    """Find unknowns whose posterior piles up where their prior fades or ends.

    Parameters
    ----------
    names : tuple of str
        Names of the unknowns.
    z : ndarray, shape (n, d)
        Draws of equal weight.
    linearised : callable
        (d,) -> whitened residuals (k,) and their Jacobian (k, d).
    off : ndarray, shape (d,), optional
        Medians of `Parameters.deviations`; left out, all priors are normal.
    """
    reasons = []
    middle = np.median(z, axis=0)  # beyond a point where more than half of the draws are
    off = np.abs(middle) if off is None else off
    near = np.abs(middle) > -float(scipy.special.ndtri(_OUTER))
    pulls = np.zeros(len(names))
    if near.any():
        chosen = _few(z)
        found = []
        for x in chosen:
            residual, jacobian = linearised(x)
            found.append(scores(jacobian, residual, x))
        pulls = np.median(found, axis=0)
    for j, name in enumerate(names):
        side = "upper" if middle[j] > 0 else "lower"
        if off[j] > _TAIL:
            reasons.append(
                f"{name} is drawn where its prior has next to no mass, {off[j]:.1f} "
                f"standard deviations towards its {side} end: widen its prior"
            )
        elif near[j] and pulls[j] > _SCORE:
            reasons.append(
                f"{name} piles up at the {side} end of its prior, and the data pull it beyond by "
                f"{pulls[j]:.0f} standard errors: widen its prior"
            )
    return tuple(reasons)


def _few(z: Array) -> Array:
    return np.asarray(z[np.linspace(0, len(z) - 1, min(_DRAWS, len(z))).astype(int)])


def range_conflicts(density: CollapsedDensity, z: Array, log_r: Array) -> tuple[str, ...]:
    """Name the ends of the ranges' prior at which frames pile up.

    Parameters
    ----------
    z : ndarray, shape (n, d)
        Draws of equal weight.
    log_r : ndarray, shape (m, frames)
        Draws of the ranges; nan for a frame without object.
    """
    distribution = _distribution(density.parameters.range_prior)
    with np.errstate(invalid="ignore"):
        middle = np.exp(np.median(log_r, axis=0))
    ends = distribution.from_normal(scipy.special.ndtri([_OUTER, 1 - _OUTER]))
    near = [middle < ends[0], middle > ends[1]]
    if not (near[0].any() or near[1].any()):
        return ()
    chosen = _few(z)
    wide = _without_ends(density, distribution)
    gain = np.median(_best_fit(wide, chosen) - _best_fit(density, chosen), axis=0)
    out = _deviations(distribution, np.where(np.isnan(middle), ends.mean(), middle))
    # at most 1.1e-5 of runs in each direction, however many frames there are
    share = scipy.special.ndtr(-_TAIL) / max(np.isfinite(middle).sum(), 1)
    tail = -float(scipy.special.ndtri(share))
    reasons = []
    for here, side in zip(near, ("lower", "upper"), strict=True):
        beyond = here & (out > tail)
        if beyond.any():
            reasons.append(
                f"the ranges of {int(beyond.sum())} frames lie where range_m has next to no mass, "
                f"up to {out[beyond].max():.1f} standard deviations towards its {side} end: widen "
                "range_m"
            )
        count = int(np.sum(here & ~beyond & (gain > _GAIN)))
        if count:
            reasons.append(
                f"the ranges of {count} frames pile up at the {side} end of range_m, beyond which "
                "they would fit far better: widen range_m"
            )
    return tuple(reasons)


def ranges_beyond(density: CollapsedDensity, z: Array) -> tuple[NDArray[np.bool_], Array]:
    """Find frames that would fit far better beyond the ends of the prior of their ranges.

    Parameters
    ----------
    z : ndarray, shape (d,)
        Parameters, which stay as they are.

    Returns
    -------
    ndarray of bool, shape (frames,)
        Whether each would gain half of a chi-square of 30; none under a law that fades, as ranges
        that contradict it are followed.
    ndarray, shape (frames,)
        Where each would fit best [m]; nan for a frame without object.
    """
    law = _distribution(density.parameters.range_prior)
    wide = _without_ends(density, law)
    best = np.exp(wide.best_ranges(z[None])[0, :, 0])
    if isinstance(law, NormalDistribution):
        return np.zeros(best.size, dtype=bool), best
    gain = (_best_fit(wide, z[None]) - _best_fit(density, z[None]))[0]
    with np.errstate(invalid="ignore"):
        outside = (best < law.low) | (best > law.high)
    return np.broadcast_to(gain > _GAIN, best.shape) & outside, best


def _distribution(law: Distribution | Stroke | Reference) -> Distribution:
    """Return the law of a range, for one of unknown or no spread a uniform one."""
    return _uniform(law.low, law.high) if isinstance(law, Stroke | Reference) else law


def _without_ends(density: CollapsedDensity, law: Distribution) -> CollapsedDensity:
    """Return the density under a law that goes on where this one ends, as far as sensors see."""
    ends = law.from_normal(scipy.special.ndtri([_OUTER, 1 - _OUTER]))
    wave = density.instrument.wave
    farthest = density.sensor.max_range_m if wave is None else 2 * math.pi / wave[0]
    high = min(_BEYOND * float(ends[1]), farthest)
    if math.isfinite(law.high):
        high = max(high, law.high)
    # ranges that were stated beyond the sensor's reach have room as well
    high = max(high, _WIDER * float(ends[1]))
    wide = _uniform(float(ends[0]) / _BEYOND, high)
    parameters = dataclasses.replace(density.parameters, range_prior=wide)
    return dataclasses.replace(density, parameters=parameters)


def _deviations(law: Distribution, r: Array) -> Array:
    """Return by how many standard deviations ranges lie out in a law that fades; else zero.

    Ends are no tails: an object may well stand where its prior begins.
    """
    if not isinstance(law, NormalDistribution):
        return np.zeros(r.shape)
    with np.errstate(invalid="ignore", divide="ignore"):
        place = np.abs(((np.log(r) if law.log else r) - law.loc) / law.scale)
        return np.asarray(np.minimum(place, np.abs(law.to_normal(r))))


def _best_fit(density: CollapsedDensity, z: Array) -> Array:
    """Log likelihood of every frame at its best range, shape (n, frames); of a static one (n, 1).

    A range that all frames have in common is one unknown: its prior counts once, and all frames
    together are what may gain.
    """
    best = density.best_ranges(z)
    a0, a1, a2, a3, a4, a5, _, _ = density.parameters.terms(z).ranges.T[:, :, None]
    u = best[:, :, 0]
    prior = a0 + (a1 + 1) * u - 0.5 * (((np.exp(u) - a2) * a3) ** 2 + ((u - a4) * a5) ** 2)
    prior = np.where(np.isnan(u), 0.0, prior)
    if isinstance(density, StaticDensity):
        common = prior[:, np.flatnonzero(density.holds)[:1]]
        return np.asarray(best[:, :, 1].sum(axis=1, keepdims=True) - common)
    return np.asarray(best[:, :, 1] - prior)


def _uniform(low: float, high: float) -> Distribution:
    """Return a law uniform in log r; of computed ends, of which no size is asked."""
    return UniformDistribution(log=True, low=low, high=high)
