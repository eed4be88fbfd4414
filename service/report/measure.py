"""Error and run time of every technique and of the posterior."""

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from inference.realtime.registry import TECHNIQUES
from service.report.scenes import ReportScene
from simulator.errors import RefusedError
from simulator.simulate import Simulation, simulate

__all__ = ["FULL", "QUICK", "Effort", "Row", "measure"]

Array = NDArray[np.float64]
T = TypeVar("T")

_SEED = 1
_REPEATS = 3


@dataclasses.dataclass(frozen=True)
class Effort:
    """How much is measured: frames of a batch, frames of a posterior, its effective draws."""

    batch: int
    frames: int
    target_ess: tuple[int, ...]


QUICK = Effort(2000, 40, (400, 3200))
FULL = Effort(100_000, 100, (400, 1600, 6400))


@dataclasses.dataclass(frozen=True)
class Row:
    """One line of the report.

    Attributes
    ----------
    scene, technique : str
        Which, on what.
    remark : str
        What the technique was told, or what the posterior says of itself.
    frames : int
        Number of frames.
    answered, holds_truth : float
        Share of frames with a single range; share in which one of the roots (the posterior's
        90 % interval) lies within two standard deviations of (around) the truth.
    median_error, p90_error : float or None
        Quantiles of the relative error of the single ranges; None where there are none.
    run_s, frame_s : float
        Run time, as a whole and of a frame [s].
    """

    scene: str
    technique: str
    remark: str
    frames: int
    answered: float
    holds_truth: float
    median_error: float | None
    p90_error: float | None
    run_s: float
    frame_s: float


def _best(action: Callable[[], T]) -> tuple[T, float]:
    """Run once for the compiler, then return the shortest of three runs."""
    result, shortest = action(), math.inf
    for _ in range(_REPEATS):
        begin = time.perf_counter()
        result = action()
        shortest = min(shortest, time.perf_counter() - begin)
    return result, shortest


def _row(
    scene: str,
    names: tuple[str, str],
    truth: Array,
    ranges: Array,
    held: NDArray[np.bool_],
    run_s: float,
) -> Row:
    error = np.abs(ranges - truth) / truth
    error = error[np.isfinite(error)]
    median, tail = np.quantile(error, [0.5, 0.9]).tolist() if error.size else (None, None)
    n = truth.size
    answered, holds = error.size / n, float(np.mean(held))
    return Row(scene, *names, n, answered, holds, median, tail, run_s, run_s / n)


def _techniques(scene: ReportScene, made: Simulation) -> Iterator[Row]:
    names = list(TECHNIQUES)
    served = estimate(scene.sensor, scene.known, made.frames, names)
    bare = scene.known.model_copy(update={"crosstalk": None, "background": None})
    blind = estimate(scene.sensor, bare, made.frames, [x.name for x in served.left_out])
    told = [(x.technique, scene.known, "") for x in served.results]
    told += [(x.technique, bare, "as if there were none") for x in blind.results]
    for name, known, remark in told:
        run = functools.partial(estimate, scene.sensor, known, made.frames, [name])
        estimates, seconds = _best(run)
        (result,) = estimates.results
        off = np.abs(result.roots_m - made.range_m[:, None])
        held = np.asarray(np.any(off <= 2 * result.roots_sd_m, axis=1))
        ambiguous = np.mean(result.status == Status.AMBIGUOUS)
        words = [remark, f"{ambiguous:.0%} ambiguous" if ambiguous > 0 else ""]
        text = ", ".join(filter(None, words))
        yield _row(scene.name, (name, text), made.range_m, result.range_m, held, seconds)


def _posteriors(scene: ReportScene, made: Simulation, target_ess: tuple[int, ...]) -> Iterator[Row]:
    asked = [("emcee", ess) for ess in target_ess] + [("importance", target_ess[-1])]
    warm = SamplerSettings(target_ess=10, max_seconds=1.0, seed=_SEED)
    infer(scene.sensor, scene.free, made.frames, warm)
    for method, ess in asked:
        settings = SamplerSettings.model_validate(
            {"method": method, "target_ess": ess, "seed": _SEED}
        )
        begin = time.perf_counter()
        try:
            answer = infer(scene.sensor, scene.free, made.frames, settings)
        except RefusedError as error:
            nothing = np.full(made.range_m.size, np.nan)
            remark = f"refused: {str(error).split(':')[0]}"
            names = (f"posterior ({method})", remark)
            seconds = time.perf_counter() - begin
            yield _row(scene.name, names, made.range_m, nothing, np.isfinite(nothing), seconds)
            continue
        seconds = time.perf_counter() - begin
        found = answer.range_m
        held = (found.q05 <= made.range_m) & (made.range_m <= found.q95)
        words = [f"{ess} draws", "" if answer.verdict.converged else "not converged"]
        if answer.fit.misfit:
            words.append("misfit")
        names = (f"posterior ({method})", ", ".join(filter(None, words)))
        yield _row(scene.name, names, made.range_m, found.q50, held, seconds)


def measure(scene: ReportScene, effort: Effort) -> Iterator[Row]:
    """Measure one scene.

    Parameters
    ----------
    scene : ReportScene
        The scene.
    effort : Effort
        How much to measure.

    Yields
    ------
    Row
        Techniques first; those that the scene cannot serve are tried as if it had neither
        crosstalk nor background, and left out where they still cannot be used.
    """
    made = simulate(scene.sensor, scene.truth, scene.trajectory(effort.batch), _SEED)
    yield from _techniques(scene, made)
    made = simulate(scene.sensor, scene.truth, scene.trajectory(effort.frames), _SEED)
    yield from _posteriors(scene, made, effort.target_ess)
