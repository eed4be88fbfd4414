"""Nested sampling of dynesty on the collapsed density."""

import math
import time

import numpy as np
from numpy.typing import NDArray
from scipy import special

from benchmarks.samplers.outcome import TARGET_ESS, Outcome
from inference.density.collapsed import CollapsedDensity
from inference.posterior.job import Job

Array = NDArray[np.float64]


def nested(job: Job, density: CollapsedDensity, cap: float) -> Outcome:
    """Run dynesty from the prior."""
    from dynesty import NestedSampler

    d = len(density.parameters)

    def log_likelihood(z: Array) -> float:
        return max(float(density(z[None])[0] + 0.5 * z @ z), -1e300)

    sampler = NestedSampler(
        log_likelihood,
        special.ndtri,
        d,
        nlive=500,
        sample="rwalk",  # uniform sampling, the default, gets stuck where a posterior is thin
        rstate=np.random.default_rng(job.seed),
    )
    begin = time.process_time()
    remaining, finished = math.inf, True
    for result in sampler.sample(dlogz=0.05):
        remaining = result.delta_logz
        if time.process_time() - begin > cap:
            finished = False
            break
    if finished:
        for _ in sampler.add_live_points():
            pass
    seconds = time.process_time() - begin
    results = sampler.results
    weights = np.exp(results.logwt - special.logsumexp(results.logwt))
    ess = 1 / np.sum(weights**2)
    note = f"{int(np.sum(results.ncall))} calls"
    if not finished:  # the weights of a run that has not arrived say nothing of the posterior
        note += f", stopped with {remaining:.3g} nats of evidence to go"
        return Outcome(seconds, False, ess, math.nan, np.empty((0, d)), np.empty(0), note)
    return Outcome(seconds, bool(ess >= TARGET_ESS), ess, math.nan, results.samples, weights, note)
