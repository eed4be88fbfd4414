"""From a checkpoint to the answer."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.posterior.collapsed import CollapsedDensity
from inference.posterior.diagnostics import (
    effective_sample_size,
    split_r_hat,
    tail_effective_sample_size,
)
from inference.posterior.importance import MAX_K_HAT, draw_weighted
from inference.posterior.job import Checkpoint, Job, chains
from inference.posterior.modes import range_modes
from inference.posterior.posterior import (
    Draws,
    Fit,
    Identifiability,
    LeftOutTerm,
    Mode,
    ParameterSummary,
    Posterior,
    RangeSummary,
    Runtime,
)
from inference.posterior.ranges import draw_ranges, replicate
from inference.posterior.verdict import Verdict
from simulator.priors import Distribution
from simulator.scene import Scene, Stroke

__all__ = ["summarise"]

Array = NDArray[np.float64]

_RANGE_DRAWS = 1000
_MISFIT = 1e-3
_CHECK_DRAWS = 2000


def _weighted_quantiles(x: Array, weights: Array) -> list[float]:
    order = np.argsort(x)
    cumulative = np.cumsum(weights[order]) - 0.5 * weights[order]
    return [float(np.interp(q, cumulative, x[order])) for q in (0.05, 0.5, 0.95)]


def _summaries_of_chains(names: tuple[str, ...], draws: Array) -> dict[str, ParameterSummary]:
    """Summarise draws of shape (ensembles, walkers, steps, d)."""
    result = {}
    for j, name in enumerate(names):
        x = draws[..., j]
        q05, q50, q95 = (float(q) for q in np.quantile(x, [0.05, 0.5, 0.95]))
        ess = effective_sample_size(x)
        sd = float(x.std(ddof=1))
        result[name] = ParameterSummary(
            float(x.mean()),
            sd,
            q05,
            q50,
            q95,
            ess,
            tail_effective_sample_size(x),
            split_r_hat(x),
            sd / math.sqrt(ess),
        )
    return result


def _summaries_of_weights(
    names: tuple[str, ...], x: Array, weights: Array
) -> dict[str, ParameterSummary]:
    """Summarise weighted draws of shape (n, d)."""
    ess = float(1 / np.sum(weights**2))
    result = {}
    for j, name in enumerate(names):
        mean = float(weights @ x[:, j])
        variance = float(weights @ (x[:, j] - mean) ** 2)
        error = float(np.sqrt(weights**2 @ (x[:, j] - mean) ** 2))
        q05, q50, q95 = _weighted_quantiles(x[:, j], weights)
        result[name] = ParameterSummary(
            mean, math.sqrt(variance), q05, q50, q95, ess, ess, None, error
        )
    return result


def _range_summary(job: Job, drawn: Array) -> RangeSummary:
    """Summarise draws of log r, shape (m, usable frames), for all frames of the job."""
    usable = np.flatnonzero(job.usable)
    ranges = np.exp(drawn)
    n = len(job.frames)
    columns = {name: np.full(n, np.nan) for name in ("q05", "q50", "q95", "mean", "sd")}
    modes: list[tuple[Mode, ...]] = [()] * n
    for j, frame in enumerate(usable):
        r = ranges[:, j]
        if not np.isfinite(r[0]):
            continue
        columns["q05"][frame], columns["q50"][frame], columns["q95"][frame] = np.quantile(
            r, [0.05, 0.5, 0.95]
        )
        columns["mean"][frame], columns["sd"][frame] = r.mean(), r.std(ddof=1)
        modes[frame] = range_modes(r)
    return RangeSummary(**columns, modes=tuple(modes))


def _predictive_check(
    density: CollapsedDensity, z: Array, log_r: Array, rng: np.random.Generator
) -> Fit:
    """Compare the collapsed likelihood of the frames with that of readings drawn anew.

    The replicates share the ranges' draws, so the p-value leans towards one half and the false
    alarms are rarer than stated. One replicate a draw.
    """
    anew = density.paired_log_likelihood(z, replicate(density, z, log_r, rng))
    seen = density.log_likelihood(z)
    p = float((np.sum(anew <= seen) + 0.5) / (len(z) + 1))
    return Fit(p, p < _MISFIT)


def _status(spread: float, limits: tuple[float, float]) -> str:
    if spread < limits[0]:
        return "identified"
    return "weak" if spread < limits[1] else "not_identified"


def _identifiability(
    names: tuple[str, ...], z: Array, log_r: Array, range_law: Distribution | Stroke
) -> tuple[Identifiability, ...]:
    """Judge every unknown by its spread in z, where the prior's is one, and the ranges' scale."""
    rows = []
    for j, name in enumerate(names):
        spread = float(z[:, j].std())
        status = _status(spread, (0.2, 0.7))
        reason = {
            "identified": f"the data narrow the prior to {spread:.2g} of its width",
            "weak": f"the data narrow the prior only to {spread:.0%} of its width",
            "not_identified": "the answer is little more than the prior: more frames, a wider "
            "span of ranges or less noise would be needed",
        }[status]
        rows.append(Identifiability(name, status, 1 - spread**2, reason))
    present = np.isfinite(log_r[0])
    if present.any():
        scale = log_r[:, present].mean(axis=1)
        spread = float(scale.std())
        wide = _log_spread(range_law)
        status = _status(spread, (0.05, 0.3))
        reason = {
            "identified": f"the common scale of the ranges is known to {spread:.2g} of itself",
            "weak": f"the common scale of the ranges is known only to {spread:.0%} of itself",
            "not_identified": "the data leave the common scale of the ranges open: a wider stroke, "
            "or known crosstalk or object, would fix it",
        }[status]
        rows.append(Identifiability("range_m", status, 1 - (spread / wide) ** 2, reason))
    return tuple(rows)


def _log_spread(law: Distribution | Stroke) -> float:
    """Return the prior's standard deviation of log r, from its quantiles."""
    if isinstance(law, Stroke):
        return math.log(law.high / law.low) / math.sqrt(12)
    low, high = law.from_normal(np.array([-1.0, 1.0]))
    return 0.5 * math.log(high / low)


def _left_out(scene: Scene) -> tuple[LeftOutTerm, ...]:
    absent = {
        "crosstalk": scene.crosstalk,
        "background": scene.background,
        "discrepancy": scene.discrepancy,
    }
    return tuple(
        LeftOutTerm(term, "the scene states none")
        for term, value in absent.items()
        if value is None
    )


def _cross_check(
    verdict: Verdict, job: Job, checkpoint: Checkpoint, z: Array, ess: float
) -> tuple[Verdict, float | None]:
    """Hold the draws' means to importance sampling, where that can be trusted."""
    if checkpoint.proposal is None:
        return verdict, None
    weighted = draw_weighted(job.density(), checkpoint.proposal, job.stream(5), _CHECK_DRAWS)
    if not weighted.k_hat < MAX_K_HAT or not weighted.ess > 100:
        return verdict, weighted.k_hat
    other = weighted.weights @ weighted.z
    error = np.sqrt(weighted.weights**2 @ (weighted.z - other) ** 2 + z.var(axis=0) / max(ess, 1.0))
    worst = float(np.max(np.abs(other - z.mean(axis=0)) / error))
    if worst > 6.0:
        reason = f"means differ from importance sampling by {worst:.0f} standard errors"
        return Verdict(False, (*verdict.reasons, reason)), weighted.k_hat
    return verdict, weighted.k_hat


def summarise(job: Job, checkpoint: Checkpoint, wall_s: float, cpu_s: float) -> Posterior:
    """Make the answer of a job, finished or not.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands.
    wall_s, cpu_s : float
        What it has cost so far [s].

    Returns
    -------
    Posterior
    """
    density = job.density()
    parameters = density.parameters
    names = parameters.names
    rng = job.stream(4)
    verdict, k_hat = checkpoint.verdict, None
    if checkpoint.weighted is not None:
        weighted = checkpoint.weighted
        natural = parameters.natural(weighted.z)
        summaries = _summaries_of_weights(names, natural, weighted.weights)
        keep = rng.choice(len(weighted.z), size=len(weighted.z), p=weighted.weights)
        z, k_hat = weighted.z[keep], weighted.k_hat
        draws = natural[keep][None, None]
        log_density = weighted.log_density[keep][None, None]
    elif checkpoint.ensembles and checkpoint.ensembles[0].steps >= 4:
        kept = chains(job, checkpoint)
        z = kept.z.reshape(-1, len(names))
        draws = parameters.natural(z).reshape(kept.z.shape)
        log_density = kept.log_density
        summaries = _summaries_of_chains(names, draws)
        least = checkpoint.ess or 1.0
        verdict, k_hat = _cross_check(verdict, job, checkpoint, z, least)
    else:
        # nothing unknown, or stopped before the first chunk: the starting points are all there is
        starts = [e.coords for e in checkpoint.ensembles] or [np.empty((_RANGE_DRAWS, 0))]
        z = np.concatenate(starts)
        draws = parameters.natural(z)[None, None]
        log_density = density(z)[None, None]
        weights = np.full(len(z), 1 / len(z))
        summaries = _summaries_of_weights(names, draws[0, 0], weights)
    chosen = z[np.linspace(0, len(z) - 1, min(_RANGE_DRAWS, len(z))).astype(int)]
    drawn = draw_ranges(density, chosen, rng)
    fit = _predictive_check(density, chosen, drawn, rng)
    ranges = np.full((len(chosen), len(job.frames)), np.nan)
    ranges[:, job.usable] = np.exp(drawn)
    return Posterior(
        checkpoint.method,
        job.seed,
        verdict,
        summaries,
        _range_summary(job, drawn),
        _identifiability(names, z, drawn, parameters.range_prior),
        fit,
        _left_out(job.scene),
        Runtime(wall_s, cpu_s, checkpoint.calls, k_hat),
        Draws(names, draws, log_density, ranges),
    )
