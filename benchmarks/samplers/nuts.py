"""NUTS of NumPyro on the collapsed density."""

import math
import os
import time

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.samplers.outcome import Outcome, enough, equal, judged
from inference.density.collapsed import CollapsedDensity
from inference.posterior.job import Job
from inference.posterior.sampling.start import Optimum

Array = NDArray[np.float64]


def nuts(job: Job, density: CollapsedDensity, optima: list[Optimum], cap: float) -> Outcome:
    """NumPyro's NUTS on the collapsed density, whitened."""
    import jax
    import jax.numpy as jnp
    from numpyro.infer import NUTS

    jax.config.update("jax_enable_x64", True)
    d = len(density.parameters)
    centre, factor = optima[0].z, optima[0].factor
    h = 1e-4
    offsets = np.concatenate([np.zeros((1, d)), h * np.eye(d), -h * np.eye(d)])
    evaluations = 0

    def value_and_slope(x: Array) -> tuple[np.float64, Array]:
        nonlocal evaluations
        evaluations += 2 * d + 1
        values = -density(centre + (np.asarray(x) + offsets) @ factor.T)
        slope = (values[1 : d + 1] - values[d + 1 :]) / (2 * h)
        if not (np.isfinite(values[0]) and np.isfinite(slope).all()):
            return np.float64(1e10), np.zeros(d)  # a divergence, which NUTS turns back from
        return np.float64(values[0]), slope

    shapes = (jax.ShapeDtypeStruct((), jnp.float64), jax.ShapeDtypeStruct((d,), jnp.float64))

    @jax.custom_vjp  # type: ignore[untyped-decorator, unused-ignore]
    def potential(x: Any) -> Any:
        return jax.pure_callback(value_and_slope, shapes, x)[0]

    def forward(x: Any) -> Any:
        return jax.pure_callback(value_and_slope, shapes, x)

    potential.defvjp(forward, lambda slope, g: (g * slope,))
    rng = np.random.default_rng(job.seed)
    warmup, divergent = 300, 0
    kernels, states = [], []
    for chain in range(4):
        kernel = NUTS(potential_fn=potential, target_accept_prob=0.8)
        start = jnp.asarray(rng.standard_normal(d))
        states.append(kernel.init(jax.random.PRNGKey(10 * job.seed + chain), warmup, start, (), {}))
        kernels.append(jax.jit(lambda s, kernel=kernel: kernel.sample(s, (), {})))
        kernels[-1](states[-1])  # compiles
    evaluations, begin = 0, time.process_time()
    draws: list[list[Array]] = [[] for _ in range(4)]
    done, reached = 0, False
    while not reached and time.process_time() - begin < cap:
        for k in range(4):  # all chains side by side: a quarter of the time each
            for i in range(done, done + 50):
                states[k] = kernels[k](states[k])
                if i >= warmup:
                    draws[k].append(np.asarray(states[k].z))
                    divergent += bool(states[k].diverging)
                if time.process_time() - begin > cap:
                    break
        done += 50
        if done >= warmup + 100:
            pooled = np.array([x[: done - warmup] for x in draws if len(x) >= done - warmup])
            reached = len(pooled) == 4 and enough(*judged(pooled[:, None]))
    seconds = time.process_time() - begin
    drawn = [np.array(x).reshape(-1, d) for x in draws]
    steps = min(len(x) for x in drawn)
    note = f"{evaluations} density evaluations, {divergent} divergences"
    if steps < 8:
        note += f", {steps} draws after {warmup} of warm-up in the slowest chain"
        z = centre + np.concatenate(drawn) @ factor.T
        return Outcome(seconds, False, 0.0, math.inf, z, np.full(len(z), 1 / max(len(z), 1)), note)
    z = centre + np.array([x[:steps] for x in drawn])[:, None] @ factor.T
    ess, r_hat = judged(z)
    return Outcome(seconds, enough(ess, r_hat), ess, r_hat, *equal(z), note=note)
