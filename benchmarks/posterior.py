"""Time to a posterior: ensembles in one and in two processes, and importance sampling.

    python -m benchmarks.posterior [--seeds 3]

N = 40 frames log-uniform in 0.1-2 m, signal-to-noise 1000 at 1 m. The baseline is the same answer
from ensembles in one process; a ratio above one is faster. Compilation is not counted.
"""

import argparse
import multiprocessing
import statistics
import time
from concurrent.futures import Executor, ProcessPoolExecutor

from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor
from tests.posterior.scenes import example


def _seconds(
    request: tuple[Sensor, Scene, Frames],
    settings: SamplerSettings,
    executor: Executor | None = None,
) -> tuple[float, Posterior]:
    begin = time.perf_counter()
    sensor, scene, frames = request
    posterior = infer(sensor, scene, frames, settings, executor)
    return time.perf_counter() - begin, posterior


def _warm(kind: str, crosstalk: bool) -> None:
    infer(*example(kind, crosstalk, 8), SamplerSettings(seed=1, target_ess=10))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = range(parser.parse_args().seeds)
    print(
        f"{'scene':<28}{'one process':>12}{'two':>8}{'ratio':>7}{'importance':>12}{'ratio':>7}"
        f"{'k-hat':>7}{'ESS':>7}{'R-hat':>8}  converged"
    )
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=context) as executor:
        for kind in ("pulsed", "sine_wave"):
            for crosstalk in (False, True):
                request = example(kind, crosstalk, 40)
                _warm(kind, crosstalk)
                list(executor.map(_warm, [kind] * 4, [crosstalk] * 4))
                one, two, weighted, converged, k_hats = [], [], [], 0, []
                ess, r_hat = float("inf"), 0.0
                for seed in seeds:
                    seconds, posterior = _seconds(request, SamplerSettings(seed=seed))
                    one.append(seconds)
                    converged += posterior.verdict.converged
                    ess = min(ess, *(p.ess_bulk for p in posterior.parameters.values()))
                    r_hat = max(r_hat, *(p.rhat or 9 for p in posterior.parameters.values()))
                    two.append(_seconds(request, SamplerSettings(seed=seed), executor)[0])
                    settings = SamplerSettings(seed=seed, method="importance")
                    try:
                        seconds, posterior = _seconds(request, settings)
                    except RefusedError:
                        continue
                    weighted.append(seconds)
                    k_hats.append(posterior.runtime.k_hat or 0.0)
                base = statistics.median(one)
                both = statistics.median(two)
                light = statistics.median(weighted) if weighted else float("nan")
                name = f"{kind}, object{' + crosstalk' if crosstalk else ''}"
                print(
                    f"{name:<28}{base:>10.2f} s{both:>6.2f} s{base / both:>7.1f}"
                    f"{light:>10.2f} s{base / light:>7.1f}{max(k_hats, default=9):>7.2f}"
                    f"{ess:>7.0f}{r_hat:>8.4f}  {converged}/{len(seeds)}"
                )


if __name__ == "__main__":
    main()
