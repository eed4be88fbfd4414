"""How a job starts: its optima, a first trial of their shape, and ensembles around them."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.checks import check_best_fit
from inference.posterior.fitted import fitted_optima
from inference.posterior.job import Checkpoint, Job
from inference.posterior.sampling.ensemble import Ensemble, new_ensemble
from inference.posterior.sampling.importance import MAX_K_HAT, WeightedDraws, draw_weighted
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.start import Optimum, climb, find_optima, refine
from inference.posterior.sampling.tempering import tempered_walkers
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.selecting import begin
from simulator.errors import RefusedError

__all__ = ["POPULATIONS", "WALKERS", "new_ensembles", "start"]

Array = NDArray[np.float64]

WALKERS = 32
POPULATIONS = 2  # independent of one another, so that they can disagree
_TEMPERED_FRAMES = 200  # at most; the walkers then start the wider, the more frames there are
_IMPORTANCE_DRAWS = 2000
_MOST_IMPORTANCE_DRAWS = 200_000
_MOST_IMPORTANCE_FRAMES = 8_000_000  # draws times frames: ten seconds that nothing interrupts
_TRIAL_DRAWS = 400
_FITTING = 0.5  # effective share of the trial above which jumps are mostly accepted
_MISFITTING = 0.1  # and below which the Laplace shapes are given up


def start(job: Job) -> Checkpoint:
    """Find the optima, and set up ensembles or draw weighted samples.

    With optional terms in the scene this is done once they are decided, by the first chunks.

    Parameters
    ----------
    job : Job
        From `prepare`.

    Returns
    -------
    Checkpoint

    Raises
    ------
    RefusedError
        Where no parameters explain the frames at all, or importance sampling alone was asked for
        and cannot be trusted.
    """
    if job.scene.optional_terms:
        return begin(job)
    density = job.density()
    settings = job.settings
    pending = Verdict(False, ("no steps were made",))
    if len(density.parameters) == 0:
        known = Verdict(True, ())
        if not np.isfinite(density(np.empty((1, 0)))[0]):
            raise RefusedError("no range allowed by the scene explains every frame")
        return Checkpoint("importance", None, None, calls=1, verdict=known, finished=True)
    optima = find_optima(density, job.stream(0))
    for fitted in fitted_optima(job, density):
        optima = _with(optima, fitted)
    tempered, calls = tempered_walkers(_thinned(density), job.stream(1), WALKERS)
    if len(tempered):
        optima = _with(optima, refine(density, climb(density, tempered[0])[0]))
        optima = _with(optima, refine(density, tempered[0]))
    if not optima:
        raise RefusedError(
            "no parameters within their priors explain the frames; widen the priors, or check the "
            "noise's `read` against the readings"
        )
    check_best_fit(density, optima[0].z)
    proposal = Proposal(mixture_of(optima), None, 0.5)
    if settings.method in ("importance", "auto"):
        weighted, used = _importance(density, proposal, job)
        calls += used
        trusted = weighted.k_hat < MAX_K_HAT and weighted.ess >= settings.target_ess
        if trusted or settings.method == "importance":
            if not weighted.k_hat < MAX_K_HAT:
                raise RefusedError(
                    f"importance sampling cannot be trusted here: Pareto k-hat is "
                    f"{weighted.k_hat:.2f}, above {MAX_K_HAT}; use the method emcee"
                )
            verdict = Verdict(
                trusted,
                ()
                if trusted
                else (f"the effective sample size is {weighted.ess:.0f}, below the target",),
            )
            return Checkpoint(
                method="importance",
                optima=proposal.optima,
                proposal=proposal,
                weighted=weighted,
                calls=calls,
                verdict=verdict,
                ess=weighted.ess,
                finished=True,
            )
    trial = draw_weighted(density, proposal, job.stream(8), _TRIAL_DRAWS)
    calls += _TRIAL_DRAWS
    begun = Checkpoint("emcee", proposal.optima, proposal, calls=calls, verdict=pending)
    if not trial.ess > _MISFITTING * _TRIAL_DRAWS:
        return dataclasses.replace(begun, populations=(None,) * POPULATIONS)
    if trial.ess > _FITTING * _TRIAL_DRAWS:  # jumps that are mostly accepted forget fastest
        proposal = dataclasses.replace(proposal, share=0.8)
    starts = (np.empty((0, len(density.parameters))),) * (job.settings.ensembles - 1)
    ensembles = new_ensembles(density, proposal, (*starts, tempered), job)
    calls += WALKERS * len(ensembles)
    return dataclasses.replace(begun, proposal=proposal, ensembles=ensembles, calls=calls)


def _thinned(density: CollapsedDensity) -> CollapsedDensity:
    """Return the density of some of the frames, spread over all: enough to show every branch."""
    n = len(density.frames)
    if n <= _TEMPERED_FRAMES:
        return density
    chosen = np.linspace(0, n - 1, _TEMPERED_FRAMES).round().astype(int)
    present = None if density.present is None else density.present[chosen]
    frames = np.ascontiguousarray(density.frames[chosen])
    return dataclasses.replace(density, frames=frames, present=present)


def _with(optima: list[Optimum], found: Optimum | None) -> list[Optimum]:
    """Add an optimum that is not among those found before, and drop what it makes negligible."""
    if found is None:
        return optima
    if any(other.is_near(found.z) for other in optima):
        return optima
    every = sorted([*optima, found], key=lambda optimum: -optimum.log_density)
    return [o for o in every if o.log_density > every[0].log_density - 20.0]


def _importance(
    density: CollapsedDensity, proposal: Proposal, job: Job
) -> tuple[WeightedDraws, int]:
    """Draw until the effective sample size is reached, if that is in sight."""
    most = min(_MOST_IMPORTANCE_DRAWS, _MOST_IMPORTANCE_FRAMES // len(density.frames))
    count = min(max(_IMPORTANCE_DRAWS, 2 * job.settings.target_ess), most)
    weighted = draw_weighted(density, proposal, job.stream(2), count)
    used = count
    if weighted.k_hat < MAX_K_HAT and weighted.ess < job.settings.target_ess:
        wanted = int(1.5 * count * job.settings.target_ess / max(weighted.ess, 1.0))
        count = min(wanted, most)
        weighted = draw_weighted(density, proposal, job.stream(2), count)
        used += count
    return weighted, used


def new_ensembles(
    density: CollapsedDensity, proposal: Proposal, starts: tuple[Array, ...], job: Job
) -> tuple[Ensemble, ...]:
    """Set up ensembles that have not moved yet.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    proposal : Proposal
        In whose coordinates they walk; points that are wanting are drawn around its optima.
    starts : tuple of ndarray, shape (n, d) each
        Starting points of every ensemble, of which the first `WALKERS` count.
    job : Job
        Its seed.

    Returns
    -------
    tuple of Ensemble

    Raises
    ------
    RefusedError
        Where the prior leaves no room around its best parameters.
    """
    seeds = np.random.SeedSequence(job.seed, spawn_key=(3,)).spawn(len(starts))
    ensembles = []
    for given, seed in zip(starts, seeds, strict=True):
        _, first = np.unique(given, axis=0, return_index=True)
        coords = given[np.sort(first)][:WALKERS]
        if np.linalg.matrix_rank(coords - coords[:1]) < coords.shape[1]:
            coords = coords[:0]  # walkers on a plane never leave it
        rng = np.random.default_rng(seed.spawn(1)[0])
        log_prob = density(coords) if len(coords) else np.empty(0)
        for _ in range(50):
            if len(coords) >= WALKERS:
                break
            more = proposal.optima.draw(rng, WALKERS)
            found = density(more)
            coords = np.concatenate([coords, more[np.isfinite(found)]])
            log_prob = np.concatenate([log_prob, found[np.isfinite(found)]])
        if len(coords) < WALKERS:
            raise RefusedError("the prior leaves no room around its best parameters")
        ensembles.append(new_ensemble(proposal, coords[:WALKERS], log_prob[:WALKERS], seed))
    return tuple(ensembles)
