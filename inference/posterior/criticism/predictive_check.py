"""Posterior predictive checks: is the model able to make such readings at all."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.fit import Fit, FitCheck
from inference.posterior.criticism.best_point import BestPoint
from inference.posterior.criticism.erring_residuals import erring_residuals
from inference.posterior.criticism.fit_residuals import FitResiduals, fit_residuals
from inference.posterior.job import Job
from simulator.discrepancy import matern

__all__ = ["FLUX_ERROR", "MISFIT_P", "NEIGHBOURS", "TOTAL", "WANDER", "predictive_check"]

Array = NDArray[np.float64]

MISFIT_P = 1e-3
_DRAWS = 5  # of the parameters
_REPLICATES = 200  # of each
_FEWEST = 40  # of the frames of each part, where they were dealt out
_TAIL = 0.1  # share of the replicates that tell how the tail falls
_LENGTH = 0.5  # in log r, of a smooth error
TOTAL, WORST_FRAME, FLUX_ERROR = "total", "worst_frame", "flux_error"
NEIGHBOURS, WANDER = "neighbours", "wander"


def _total(of: FitResiduals) -> Array:
    return np.asarray(of.squared.sum(axis=1), dtype=np.float64)


def _worst(of: FitResiduals) -> Array:
    return np.asarray(of.squared.max(axis=1))


def _neighbours(of: FitResiduals) -> Array:
    """Correlation of each residual with that of the next range."""
    if of.log_r.size < 3:
        return np.zeros(len(of.across))
    size = np.sum(of.across**2, axis=1)
    products = np.sum(of.across[:, 1:] * of.across[:, :-1], axis=1)
    correlation = np.zeros(len(size))
    np.divide(products, size, out=correlation, where=size > 0)
    return correlation


def _wander(of: FitResiduals) -> Array:
    """Square of the residuals under a Matern 5/2 kernel along log r: large where they wander."""
    if of.log_r.size < 3:
        return np.zeros(len(of.across))
    kernel = matern(of.log_r[:, None] - of.log_r, _LENGTH)
    return np.asarray(np.sum((of.across @ kernel) * of.across, axis=1))


def _flux_error(of: FitResiduals) -> Array:
    return of.error


_CHECKS: dict[str, Callable[[FitResiduals], Array]] = {
    TOTAL: _total,
    WORST_FRAME: _worst,
    NEIGHBOURS: _neighbours,
    WANDER: _wander,
    FLUX_ERROR: _flux_error,
}


# how a statistic of all frames is made from those of parts; others are sums
_TOGETHER: dict[str, Callable[..., Array]] = {WORST_FRAME: np.max, NEIGHBOURS: np.mean}


def _survival(anew: Array, seen: Array) -> float:
    """Return how rarely replicates are as large, the tail taken for exponential.

    Statistics of normal residuals have tails that fall like that or faster.
    """
    start = float(np.quantile(anew, 1.0 - _TAIL))
    excess = anew[anew > start] - start
    scale = float(excess.mean()) if excess.size else 0.0
    shares = []
    for value in seen:
        if value > start and scale > 0:
            shares.append(_TAIL * math.exp(-(value - start) / scale))
        else:
            shares.append((float(np.sum(anew >= value)) + 0.5) / (anew.size + 1))
    return float(np.mean(shares))


def predictive_check(
    job: Job,
    density: CollapsedDensity,
    z: Array,
    rng: np.random.Generator,
    others: Sequence[Job] = (),
    best: BestPoint | None = None,
) -> Fit:
    """Check the frames against replicates of them.

    Four things are looked at: the chi-square of all frames, the worst frame, the correlation of
    neighbours along the range, and slow wandering along it, which is how a smooth error of the
    object model shows long before the chi-square does. Frames and replicates alike are fitted
    before they are compared (`fit_residuals`), so that p is even under a true model up to what is
    not linear; four tests are made up for as if they were independent (Sidak), which errs towards
    fewer alarms.

    Parameters
    ----------
    z : ndarray, shape (m, d)
        Draws of the parameters.
    others : sequence of Job
        The other parts of a job whose frames were dealt out. Each is fitted on its own, and what
        is looked at is that of all together.
    best : BestPoint, optional
        Where readings before a background are met best with errors of the model: where draws of an
        exact model are no place to follow them from.

    Notes
    -----
    Of a job whose readings ask for larger errors (`Job.flux_times`, `Job.noise_times`) frames are
    compared with replicates that err by as much.
    """
    chosen = np.linspace(0, len(z) - 1, min(_DRAWS, len(z))).astype(np.intp)
    replicates = max(_REPLICATES // (1 + len(others)), _FEWEST)
    found, seen = [], []
    for part, own in ((job, density), *((other, other.density()) for other in others)):
        if best is None:
            every = [fit_residuals(part, own, z[k], replicates, rng) for k in chosen]
        else:
            every = [erring_residuals(best, _DRAWS * replicates, rng)]
        found.append({name: [check(of) for of in every] for name, check in _CHECKS.items()})
        seen.append(every)
    checks = []
    for name in _CHECKS:
        values = _TOGETHER.get(name, np.sum)([of[name] for of in found], axis=0)
        noisier = 1.0 if name == NEIGHBOURS else job.noise_times  # a correlation has no size
        p = _survival(values[:, 1:].ravel(), values[:, 0] / noisier)
        mean = float(values[:, 1:].mean())
        checks.append(FitCheck(name, float(np.median(values[:, 0])), mean, p))
    least = min(check.p_value for check in checks)
    p_value = -math.expm1(len(checks) * math.log1p(-min(least, 1.0 - 1e-12)))
    worst = np.max([of[WORST_FRAME] for of in found], axis=0)[:, 1:].ravel()
    failed = [c for c in checks if -math.expm1(len(checks) * math.log1p(-c.p_value)) < MISFIT_P]
    outliers: tuple[int, ...] = ()
    if any(check.name == WORST_FRAME for check in failed):
        outliers = _outliers((job, *others), seen, worst)
    return Fit(
        p_value,
        p_value < MISFIT_P,
        tuple(_words(check, outliers) for check in failed),
        checks[0].statistic,
        checks[0].expected,
        tuple(checks),
        outliers,
    )


def _outliers(
    parts: Sequence[Job], seen: Sequence[Sequence[FitResiduals]], worst: Array
) -> tuple[int, ...]:
    """Return the frames without which none is worse than all but one in a thousand should be."""
    start = float(np.quantile(worst, 1.0 - _TAIL))
    limit = start + float((worst[worst > start] - start).mean()) * math.log(_TAIL / MISFIT_P)
    found = [
        part.of_sent(np.flatnonzero(part.usable))[_beyond(every, limit)]
        for part, every in zip(parts, seen, strict=True)
    ]
    return tuple(np.sort(np.concatenate(found)).tolist())


def _beyond(every: Sequence[FitResiduals], limit: float) -> NDArray[np.bool_]:
    """Tell which frames are too far off at most of the draws, the others fitted without them."""
    told = np.zeros((len(every), every[0].squared.shape[1]), dtype=bool)
    for row, of in zip(told, every, strict=True):
        row[of.squared[0] > limit if of.refit is None else of.refit.outlying(limit)] = True
    return np.asarray(np.median(told, axis=0) > 0.5)


def _words(check: FitCheck, outliers: tuple[int, ...]) -> str:
    """Say what a failed check means."""
    if check.name == TOTAL:
        return (
            f"the frames' chi-square is {check.statistic:.4g} where {check.expected:.4g} is "
            "expected: the noise is larger than stated, or the model is wrong"
        )
    if check.name == WORST_FRAME:
        size = math.sqrt(check.statistic)
        which = ", ".join(str(frame) for frame in outliers[:10])
        more = f" and {len(outliers) - 10} more" if len(outliers) > 10 else ""
        named = f" (frames {which}{more}, counted from 0)" if outliers else ""
        return f"the worst frame lies {size:.3g} standard deviations off the model{named}"
    if check.name == NEIGHBOURS:
        return (
            f"residuals of neighbouring ranges go together (correlation {check.statistic:.2g}): "
            "the model has a smooth error along the range beyond what `discrepancy` allows"
        )
    if check.name == FLUX_ERROR:
        size = math.sqrt(check.statistic / max(check.expected, 1e-300))
        return (
            f"the object's flux would have to differ from the model by {size:.3g} times what "
            "`discrepancy` allows"
        )
    return (
        "residuals wander slowly along the range, "
        f"{check.statistic / max(check.expected, 1e-300):.3g} times as much as by noise: "
        "the model has a smooth error beyond what `discrepancy` allows"
    )
