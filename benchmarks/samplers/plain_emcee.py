"""Plain emcee over all dimensions, the logs of the ranges among them."""

import math
import time

import emcee
import numba
import numpy as np
from numpy.typing import NDArray

from benchmarks.samplers.outcome import Outcome, enough, equal, judged
from benchmarks.samplers.scenes import FRAMES
from inference.density.collapsed import CollapsedDensity
from inference.frame.arguments import scene_of
from inference.frame.blocks import block_of
from inference.frame.log_density import log_density
from inference.posterior.job import Job
from inference.posterior.sampling.proposal import mixture_of
from inference.posterior.sampling.start import Optimum

Array = NDArray[np.float64]


@numba.njit
def _joint(out, u, rows, data, instrument):  # type: ignore[no-untyped-def]
    for i in range(u.shape[0]):
        scene = scene_of(rows, instrument, i)
        prior = scene.range_prior
        low, high = math.log(max(prior.low, 1e-300)), math.log(prior.high)
        total = 0.0
        for j in range(u.shape[1]):
            if not low <= u[i, j] <= high:
                total = -math.inf
                break
            total += log_density(u[i, j], block_of(data, j), scene)
        out[i] = total


def _joint_density(density: CollapsedDensity, x: Array) -> Array:
    d = len(density.parameters)
    z, u = x[:, :d], x[:, d:]
    value = density.parameters.log_prior(z)
    terms = density.parameters.terms(z)
    c0, c1, _ = terms.object.T
    good = np.isfinite(value) & np.isfinite(terms.object).all(axis=1) & (c0 > 0)
    good &= c1 > -2 * np.sqrt(np.where(good, c0, 1.0))
    if not good.any():
        return np.full(len(x), -np.inf)
    rows = density.rows(density.parameters.terms(z[good]))
    out = np.empty(int(good.sum()))
    _joint(out, np.ascontiguousarray(u[good]), rows, density.data, density.instrument)
    result = np.full(len(x), -np.inf)
    result[good] = value[good] + np.where(np.isnan(out), -np.inf, out)
    return result


def _normal(rng: np.random.Generator, best: Array) -> Array:
    return rng.standard_normal(best.shape[:2])


def plain_emcee(job: Job, density: CollapsedDensity, optima: list[Optimum], cap: float) -> Outcome:
    """All globals and all ranges in one space, emcee's defaults."""
    d = len(density.parameters)
    size = d + FRAMES
    walkers = 4 * size
    rng = np.random.default_rng(job.seed)
    mixture = mixture_of(optima[:1])
    states, samplers = [], []
    for _ in range(4):
        ball = mixture.centres + 0.1 * rng.standard_normal((walkers, d)) @ mixture.factors[0].T
        best = density.best_ranges(ball)
        x = np.column_stack([ball, best[:, :, 0] + 0.1 * best[:, :, 2] * _normal(rng, best)])
        sampler = emcee.EnsembleSampler(
            walkers, size, lambda x: _joint_density(density, x), vectorize=True
        )
        state = emcee.State(
            x, random_state=np.random.RandomState(int(rng.integers(2**31))).get_state()
        )
        sampler.run_mcmc(state, 1, skip_initial_state_check=True)  # compiles
        states.append(emcee.State(x, random_state=state.random_state))
        sampler.reset()
        samplers.append(sampler)
    begin = time.process_time()
    for look in range(1, 11):
        for k, sampler in enumerate(samplers):
            until = begin + cap * (look - 1 + (k + 1) / 4) / 10
            while time.process_time() < until:
                states[k] = sampler.run_mcmc(states[k], 20, skip_initial_state_check=True)
        steps = min(s.iteration for s in samplers)
        kept = np.array(
            [s.get_chain()[steps // 2 : steps, :, :d].transpose(1, 0, 2) for s in samplers]
        )
        ess, r_hat = judged(kept)
        if enough(ess, r_hat):
            break
    seconds = time.process_time() - begin
    note = f"{size} dimensions, {steps} steps of {walkers} walkers"
    return Outcome(seconds, enough(ess, r_hat), ess, r_hat, *equal(kept), note=note)
