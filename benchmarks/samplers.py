"""Samplers on one density in one run: this project's, plain emcee, NUTS and nested sampling.

    python -m benchmarks.samplers [--cap 120] [--scenes object,...] [--output docs/samplers.md]

Needs the peers: pip install numpyro==0.22.0 jax==0.10.2 dynesty==3.1.0

* ours: `inference.posterior`, four ensembles, until its own verdict is content.
* plain emcee: stretch moves over all dimensions, the logs of the ranges among them; four ensembles
  of four walkers a dimension, started in a small ball, a tenth of the Laplace shape at the best
  optimum (a present) with every range at its best; the first half of the steps is left out.
* NUTS: NumPyro on the collapsed density in the axes of the best optimum's Laplace shape (another
  present), four chains, gradients by central differences inside a callback.
* nested: dynesty on the collapsed density from the prior, 500 live points, once.

Cost is processor time of one core, which other work on the machine does not enlarge; the first
call that compiles is not counted. Plain emcee and NUTS are looked at ten times within the cap and
stop at an effective sample size of 400 and R-hat of 1.01 for every global parameter, by the same
functions as ours.

Who is wrong is told by a reference: importance sampling from a mixture that follows a long run of
ours, which the density itself corrects; its Pareto k-hat says whether that can be trusted, and
where it cannot, the long run itself is used and marked.
"""

import argparse
import dataclasses
import importlib.metadata
import importlib.util
import math
import os
import platform
import time
from pathlib import Path

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import emcee
import numba
import numpy as np
from scipy import special, stats

from inference.posterior import fold
from inference.posterior.diagnostics import effective_sample_size, split_r_hat
from inference.posterior.importance import draw_weighted
from inference.posterior.integrand import log_integrand
from inference.posterior.job import chains
from inference.posterior.profile import best_ranges
from inference.posterior.proposal import Proposal, mixture_of
from inference.posterior.rows import background_of, crosstalk_of, law_of
from inference.posterior.settings import SamplerSettings
from inference.posterior.start import find_optima
from inference.posterior.transport import fit_map
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

PEERS = ("numpyro", "jax", "dynesty")
FRAMES = 40
TARGET_ESS = 400
TARGET_R_HAT = 1.01
STRENGTH = {"prior": "lognormal", "median": 0.018, "sigma": 0.5}
CROSSTALK = [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2
TRUE_WALL = {"strength": 0.017, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.02}}
# name: what is true beside the object, what is stated; what is left out is unknown
SCENES = {
    "object": ({}, {}),
    "object + crosstalk": ({"crosstalk": [0.002, 0.01]}, {"crosstalk": CROSSTALK}),
    "free shadow": (
        {"background": TRUE_WALL},
        {"background": {"strength": STRENGTH, "distance_m": 3.0}},
    ),
    "everything unknown": (
        {"crosstalk": [0.002, 0.01], "background": TRUE_WALL},
        {
            "crosstalk": CROSSTALK,
            "background": {
                "strength": STRENGTH,
                "distance_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.3},
            },
        },
    ),
}


@dataclasses.dataclass
class Outcome:
    """What a sampler reached: cost, and weighted draws of the globals in z."""

    seconds: float
    reached: bool
    ess: float
    r_hat: float
    z: np.ndarray
    weights: np.ndarray
    note: str = ""


def _problem(name, seed):  # type: ignore[no-untyped-def]
    truth, stated = SCENES[name]
    sensor = sensor_of("pulsed")
    simulation = data(sensor, truth, FRAMES, seed)
    scene = parse_scene(stated)
    job = fold.prepare(sensor, scene, simulation.frames, SamplerSettings(seed=seed))
    density = job.density()
    true = {**{f"object.{k}": v for k, v in OBJECT.items()}}
    if "crosstalk" in truth:
        true |= dict(zip(("crosstalk.w1", "crosstalk.w2"), truth["crosstalk"], strict=True))
    if "background" in truth:
        wall = truth["background"]
        true |= {f"background.shadow.{k}": v for k, v in wall["shadow"].items()}
        true |= {f"background.{k}": wall[k] for k in ("strength", "distance_m")}
    natural = np.array([[true[n] for n in density.parameters.names]])
    return job, density, density.parameters.standard(natural)[0]


def _judged(z):  # type: ignore[no-untyped-def]
    """Least effective sample size and largest R-hat of (chains, walkers, steps, d)."""
    columns = np.moveaxis(z, -1, 0)
    sizes = [effective_sample_size(x) for x in columns]
    return float(np.nan_to_num(min(sizes))), float(max(split_r_hat(x) for x in columns))


def _equal(z):  # type: ignore[no-untyped-def]
    flat = z.reshape(-1, z.shape[-1])
    return flat, np.full(len(flat), 1 / len(flat))


def _enough(ess, r_hat):  # type: ignore[no-untyped-def]
    return ess >= TARGET_ESS and r_hat <= TARGET_R_HAT


def ours(job, cap):  # type: ignore[no-untyped-def]
    begin = time.process_time()
    checkpoint, earlier = fold.start(job), ""
    while time.process_time() - begin < cap:
        tasks = fold.tasks(job, checkpoint)
        if not tasks:
            break
        checkpoint = fold.merge(job, checkpoint, [fold.run(task) for task in tasks])
        if not earlier and _enough(checkpoint.ess or 0.0, checkpoint.r_hat or math.inf):
            earlier = f"ESS and R-hat after {time.process_time() - begin:.1f} s"
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    seconds = time.process_time() - begin
    note = "; ".join(filter(None, [earlier, *posterior.verdict.reasons]))
    if not checkpoint.ensembles or checkpoint.ensembles[0].steps < 4:
        empty = np.empty((0, len(job.density().parameters)))
        return Outcome(seconds, False, 0.0, math.inf, empty, np.empty(0), note), checkpoint
    kept = chains(job, checkpoint).z
    ess, r_hat = _judged(kept)
    return Outcome(
        seconds, posterior.verdict.converged, ess, r_hat, *_equal(kept), note
    ), checkpoint


@numba.njit  # type: ignore[untyped-decorator]
def _joint(out, u, shapes, crosstalks, backgrounds, laws, frames, r0, wave, read, shot, relative):  # type: ignore[no-untyped-def]
    for i in range(u.shape[0]):
        shape = (shapes[i, 0], shapes[i, 1], shapes[i, 2])
        crosstalk = crosstalk_of(crosstalks, i)
        background = background_of(backgrounds, i)
        law = law_of(laws, i)
        low, high = math.log(max(law[6], 1e-300)), math.log(law[7])
        total = 0.0
        for j in range(u.shape[1]):
            if not low <= u[i, j] <= high:
                total = -math.inf
                break
            frame = (frames[j, 0], frames[j, 1], frames[j, 2])
            total += log_integrand(
                u[i, j], frame, shape, crosstalk, background, law, r0, wave, read, shot, relative
            )
        out[i] = total


def _joint_density(density, x):  # type: ignore[no-untyped-def]
    d = len(density.parameters)
    z, u = x[:, :d], x[:, d:]
    value = density.parameters.log_prior(z)
    terms = density.parameters.terms(z)
    c0, c1, _ = terms.object.T
    good = np.isfinite(value) & np.isfinite(terms.object).all(axis=1) & (c0 > 0)
    good &= c1 > -2 * np.sqrt(np.where(good, c0, 1.0))
    if not good.any():
        return np.full(len(x), -np.inf)
    shapes, crosstalk, background, laws, frames, _, *sensor = density.arguments(
        density.parameters.terms(z[good])
    )
    out = np.empty(int(good.sum()))
    sensor = sensor[:5]  # r0, wave, read, shot, relative
    _joint(out, np.ascontiguousarray(u[good]), shapes, crosstalk, background, laws, frames, *sensor)
    result = np.full(len(x), -np.inf)
    result[good] = value[good] + np.where(np.isnan(out), -np.inf, out)
    return result


def _normal(rng, best):  # type: ignore[no-untyped-def]
    return rng.standard_normal(best.shape[:2])


def plain_emcee(job, density, optima, cap):  # type: ignore[no-untyped-def]
    """All globals and all ranges in one space, emcee's defaults."""
    d = len(density.parameters)
    size = d + FRAMES
    walkers = 4 * size
    rng = np.random.default_rng(job.seed)
    mixture = mixture_of(optima[:1])
    states, samplers, kept = [], [], []
    for _ in range(4):
        ball = mixture.centres + 0.1 * rng.standard_normal((walkers, d)) @ mixture.factors[0].T
        best = best_ranges(density, ball)
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
        kept = []
        for k, sampler in enumerate(samplers):
            until = begin + cap * (look - 1 + (k + 1) / 4) / 10
            while time.process_time() < until:
                states[k] = sampler.run_mcmc(states[k], 20, skip_initial_state_check=True)
        steps = min(s.iteration for s in samplers)
        kept = np.array(
            [s.get_chain()[steps // 2 : steps, :, :d].transpose(1, 0, 2) for s in samplers]
        )
        ess, r_hat = _judged(kept)
        if _enough(ess, r_hat):
            break
    seconds = time.process_time() - begin
    note = f"{size} dimensions, {steps} steps of {walkers} walkers"
    return Outcome(seconds, _enough(ess, r_hat), ess, r_hat, *_equal(kept), note)


def nuts(job, density, optima, cap):  # type: ignore[no-untyped-def]
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

    def value_and_slope(x):  # type: ignore[no-untyped-def]
        nonlocal evaluations
        evaluations += 2 * d + 1
        values = -density(centre + (np.asarray(x) + offsets) @ factor.T)
        slope = (values[1 : d + 1] - values[d + 1 :]) / (2 * h)
        if not (np.isfinite(values[0]) and np.isfinite(slope).all()):
            return np.float64(1e10), np.zeros(d)  # a divergence, which NUTS turns back from
        return np.float64(values[0]), slope

    shapes = (jax.ShapeDtypeStruct((), jnp.float64), jax.ShapeDtypeStruct((d,), jnp.float64))

    @jax.custom_vjp
    def potential(x):  # type: ignore[no-untyped-def]
        return jax.pure_callback(value_and_slope, shapes, x)[0]

    def forward(x):  # type: ignore[no-untyped-def]
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
    draws = [[] for _ in range(4)]
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
            reached = len(pooled) == 4 and _enough(*_judged(pooled[:, None]))
    seconds = time.process_time() - begin
    draws = [np.array(x).reshape(-1, d) for x in draws]
    steps = min(len(x) for x in draws)
    note = f"{evaluations} density evaluations, {divergent} divergences"
    if steps < 8:
        note += f", {steps} draws after {warmup} of warm-up in the slowest chain"
        z = centre + np.concatenate(draws) @ factor.T
        return Outcome(seconds, False, 0.0, math.inf, z, np.full(len(z), 1 / max(len(z), 1)), note)
    z = centre + np.array([x[:steps] for x in draws])[:, None] @ factor.T
    ess, r_hat = _judged(z)
    return Outcome(seconds, _enough(ess, r_hat), ess, r_hat, *_equal(z), note)


def nested(job, density, cap):  # type: ignore[no-untyped-def]
    """Run dynesty from the prior."""
    from dynesty import NestedSampler

    d = len(density.parameters)

    def log_likelihood(z):  # type: ignore[no-untyped-def]
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
    return Outcome(
        seconds, finished and ess >= TARGET_ESS, ess, math.nan, results.samples, weights, note
    )


def _reference(job, density, optima, cap):  # type: ignore[no-untyped-def]
    """Mean and sd of every z, and what they rest on."""
    long = job.settings.model_copy(update={"target_ess": 2000, "seed": job.seed + 1000})
    outcome, _ = ours(dataclasses.replace(job, settings=long), cap)
    rng = np.random.default_rng(job.seed + 2000)
    pilot = outcome.z[rng.integers(0, len(outcome.z), 20_000)]
    weighted = draw_weighted(
        density, Proposal(mixture_of(optima), fit_map(pilot), 1.0), rng, 30_000
    )
    if weighted.k_hat < 0.7:
        z, w = weighted.z, weighted.weights
        basis = f"importance sampling, k-hat {weighted.k_hat:.2f}, ESS {weighted.ess:.0f}"
    else:
        z, w = outcome.z, outcome.weights
        basis = f"a run of ours of {outcome.seconds:.0f} s (importance k-hat {weighted.k_hat:.2f})"
    mean = w @ z
    return mean, np.sqrt(w @ (z - mean) ** 2), basis


def _wrong(outcome, mean, sd, truth, names):  # type: ignore[no-untyped-def]
    """Say in words what is wrong with a sampler's answer, held to the reference."""
    if len(outcome.z) < 8:
        return "no answer"
    own = outcome.weights @ outcome.z
    spread = np.sqrt(outcome.weights @ (outcome.z - own) ** 2)
    shift, ratio = (own - mean) / sd, spread / sd
    found = []
    j = int(np.argmax(abs(shift)))
    if abs(shift[j]) > 0.2:
        found.append(f"mean of {names[j]} off by {shift[j]:+.2f} sd")
    j = int(np.argmin(ratio))
    if ratio[j] < 0.9:
        found.append(f"sd of {names[j]} {1 - ratio[j]:.0%} too small")
    j = int(np.argmax(ratio))
    if ratio[j] > 1.1:
        found.append(f"sd of {names[j]} {ratio[j] - 1:.0%} too large")
    ranks = outcome.weights @ (outcome.z < truth)
    reference = stats.norm.cdf((truth - mean) / sd)
    outside = (np.minimum(ranks, 1 - ranks) < 1e-3) & (np.minimum(reference, 1 - reference) > 5e-3)
    if outside.any():
        found.append(f"excludes the true {', '.join(np.array(names)[outside])}")
    if not found:
        return "nothing"
    return "; ".join(found)


def _row(sampler, outcome, wrong):  # type: ignore[no-untyped-def]
    r_hat = "-" if not math.isfinite(outcome.r_hat) else f"{outcome.r_hat:.3f}"
    reached = "yes" if outcome.reached else "no"
    return (
        f"| {sampler} | {outcome.seconds:.1f} | {reached} | {outcome.ess:.0f} | {r_hat} | {wrong} "
        f"| {outcome.note or '-'} |"
    )


def _versions():  # type: ignore[no-untyped-def]
    packages = ("numpy", "scipy", "numba", "emcee", *PEERS)
    return ", ".join(f"{name} {importlib.metadata.version(name)}" for name in packages)


def measure(name, cap, seed, samplers):  # type: ignore[no-untyped-def]
    """One scene, all samplers: a section of the document."""
    load = os.getloadavg()[0]
    job, density, truth = _problem(name, seed)
    names = density.parameters.names
    ours(job, 1.0)  # compiles
    optima = find_optima(density, np.random.default_rng(seed))
    mean, sd, basis = _reference(job, density, optima, cap)
    lines = [
        f"## {name}",
        "",
        f"{len(names)} unknowns ({', '.join(f'`{n}`' for n in names)}) and {FRAMES} ranges. "
        f"Reference: {basis}. At most {cap:g} s each, seed {seed}, load {load:.1f}; "
        f"Python {platform.python_version()}, {_versions()}.",
        "",
        "| sampler | processor s | reached | ESS | R-hat | wrong | |",
        "|---|---|---|---|---|---|---|",
    ]
    print("\n".join(lines), flush=True)
    runs = {
        "ours": lambda: ours(job, cap)[0],
        "plain emcee": lambda: plain_emcee(job, density, optima, cap),
        "NUTS": lambda: nuts(job, density, optima, cap),
        "nested": lambda: nested(job, density, cap),
    }
    for sampler in samplers:
        outcome = runs[sampler]()
        line = _row(sampler, outcome, _wrong(outcome, mean, sd, truth, names))
        lines.append(line)
        print(line, flush=True)
    return "\n".join([*lines, ""])


HEAD = f"""# Samplers compared

Written by `python -m benchmarks.samplers`, which runs all samplers of a scene one after the other
in one process on one core. {FRAMES} frames log-uniform in 0.1-2 m, pulsed, signal-to-noise 1000 at
1 m. Processor time does not count waiting, but other work on the two cores (their load is stated)
shares the caches and makes every row slower than on an idle machine.

*Ours* stops at its own verdict, the others at an effective sample size of {TARGET_ESS} and R-hat of
{TARGET_R_HAT} for every global parameter, nested sampling at 0.05 nats of evidence left. *Reached*
says whether they got there. *Wrong* compares with the reference: a mean off by more than 0.2
standard deviations, a standard deviation off by more than 10 %, a truth outside all but 1e-3 of the
draws which the reference does not exclude. Plain emcee and NUTS are given the best optimum and its
shape; ours and nested sampling start from the prior.
"""


def _write(path, name, section):  # type: ignore[no-untyped-def]
    """Put a scene's section into the document; those of other scenes stay."""
    old = path.read_text().split("\n## ")[1:] if path.exists() else []
    sections = {part.partition("\n")[0]: "## " + part.rstrip("\n") + "\n" for part in old}
    sections[name] = section
    path.write_text("\n".join([HEAD, *(sections[key] for key in SCENES if key in sections)]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cap", type=float, default=120.0, help="processor seconds each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--samplers", default="ours,plain emcee,NUTS,nested")
    parser.add_argument("--output", type=Path, help="Markdown to write, docs/samplers.md for one")
    wanted = parser.parse_args()
    missing = [name for name in PEERS if importlib.util.find_spec(name) is None]
    if missing:
        raise SystemExit(
            f"the peers {', '.join(missing)} are not installed; "
            "pip install numpyro==0.22.0 jax==0.10.2 dynesty==3.1.0"
        )
    for name in wanted.scenes.split(","):
        section = measure(name, wanted.cap, wanted.seed, wanted.samplers.split(","))
        if wanted.output:
            _write(wanted.output, name, section)


if __name__ == "__main__":
    main()
