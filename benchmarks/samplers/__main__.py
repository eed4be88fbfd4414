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
import importlib.metadata
import importlib.util
import math
import os
import platform
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from benchmarks.samplers.nested import nested
from benchmarks.samplers.nuts import nuts
from benchmarks.samplers.ours import ours, reference
from benchmarks.samplers.outcome import TARGET_ESS, TARGET_R_HAT, Outcome
from benchmarks.samplers.plain_emcee import plain_emcee
from benchmarks.samplers.scenes import FRAMES, SCENES, problem
from inference.posterior.sampling.start import find_optima

Array = NDArray[np.float64]

PEERS = ("numpyro", "jax", "dynesty")


def _wrong(outcome: Outcome, mean: Array, sd: Array, truth: Array, names: tuple[str, ...]) -> str:
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


def _row(sampler: str, outcome: Outcome, wrong: str) -> str:
    r_hat = "-" if not math.isfinite(outcome.r_hat) else f"{outcome.r_hat:.3f}"
    reached = "yes" if outcome.reached else "no"
    return (
        f"| {sampler} | {outcome.seconds:.1f} | {reached} | {outcome.ess:.0f} | {r_hat} | {wrong} "
        f"| {outcome.note or '-'} |"
    )


def _versions() -> str:
    packages = ("numpy", "scipy", "numba", "emcee", *PEERS)
    return ", ".join(f"{name} {importlib.metadata.version(name)}" for name in packages)


def measure(name: str, cap: float, seed: int, samplers: list[str]) -> str:
    """One scene, all samplers: a section of the document."""
    load = os.getloadavg()[0]
    job, density, truth = problem(name, seed)
    names = density.parameters.names
    ours(job, 1.0)  # compiles
    optima = find_optima(density, np.random.default_rng(seed))
    mean, sd, basis = reference(job, density, optima, cap)
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


def _write(path: Path, name: str, section: str) -> None:
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
