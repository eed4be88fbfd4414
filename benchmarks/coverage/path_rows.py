"""How the intervals of one data set of a path stand to the truth, as a row of a table."""

import time
from collections.abc import Mapping

import numpy as np

from benchmarks.coverage.paths import PathSet, draw_path, random_scene
from benchmarks.resumable import Row
from inference.posterior import fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.scene import parse_scene

__all__ = ["COLUMNS", "path_row", "posterior_of", "random_row", "row_of"]

COLUMNS = (
    "set",
    "scene",
    "version",
    "sensor",
    "inside",
    "width",
    "identified",
    "identified_inside",
    "unknowns",
    "unknowns_inside",
    "scale",
    "worst",
    "of",
    "misfit",
    "converged",
    "method",
    "seconds",
    "reason",
)


def posterior_of(data: PathSet, settings: SamplerSettings) -> Posterior:
    """Infer; all of it counts against the time limit, in processor time.

    A busy machine does not change the answer so.

    Parameters
    ----------
    data : PathSet
        The data set.
    settings : SamplerSettings
        Of the posterior.

    Raises
    ------
    RefusedError
        Where no honest answer exists.
    """
    start = time.process_time()
    job = fold.prepare(data.sensor, parse_scene(data.scene), data.frames, settings)
    checkpoint = fold.start(job)
    while tasks := fold.tasks(job, checkpoint, time.process_time() - start):
        checkpoint = fold.merge(job, checkpoint, [fold.run(task) for task in tasks])
    used = time.process_time() - start
    return fold.summarise(job, checkpoint, used, used)


def row_of(data: PathSet, settings: SamplerSettings, version: str) -> Row:
    """Infer, and hold intervals of ranges and parameters to the truth.

    Parameters
    ----------
    data : PathSet
        The data set.
    settings : SamplerSettings
        As for `posterior_of`.
    version : str
        Of the code, for the table.

    Returns
    -------
    Row
        ``inside``: share of the frames whose 90 % interval holds the truth; ``width``: median of
        width over truth; ``identified``: parameters that are called so, and ``identified_inside``
        how many of those hold theirs; ``unknowns``, ``unknowns_inside``: of all parameters;
        ``worst``: largest distance of a mean from the truth in standard deviations among what is
        called identified, ``of`` which. Without these where there are no draws.
    """
    row: dict[str, str | int | float] = {
        "scene": data.name,
        "version": version,
        "sensor": data.sensor.kind,
    }
    try:
        found = posterior_of(data, settings)
    except RefusedError as error:
        return {**row, "converged": 0, "reason": f"refused: {error}"}
    row |= {"seconds": found.runtime.cpu_s, "method": found.method}
    reason = " / ".join(found.verdict.reasons)
    if not found.drawn:
        return {**row, "converged": 0, "reason": reason}
    status = {each.parameter: each.status for each in found.identifiability}
    ranges, truth = found.range_m, data.range_m
    held = {
        name: summary.q05 <= data.parameters[name] <= summary.q95
        for name, summary in found.parameters.items()
    }
    named = [name for name in held if status[name] == "identified"]
    off = {
        name: abs(found.parameters[name].mean - data.parameters[name]) / found.parameters[name].sd
        for name in named
    }
    if status["range_m"] == "identified":
        away = np.abs(ranges.mean - truth) / ranges.sd
        off |= {f"frame {i}": float(x) for i, x in enumerate(away) if np.isfinite(x)}
    worst = max(off, key=lambda name: off[name]) if off else ""
    return {
        **row,
        "inside": float(np.mean((ranges.q05 <= truth) & (truth <= ranges.q95))),
        "width": float(np.median((ranges.q95 - ranges.q05) / truth)),
        "identified": len(named),
        "identified_inside": sum(held[name] for name in named),
        "unknowns": len(held),
        "unknowns_inside": sum(held.values()),
        "scale": status["range_m"],
        "worst": off[worst] if off else 0.0,
        "of": worst,
        "misfit": int(bool(found.fit.misfit)),
        "converged": int(found.verdict.converged),
        "reason": reason,
    }


def path_row(group: Mapping[str, str], max_seconds: float, number: int, version: str = "") -> Row:
    """Draw a data set of a class of paths, and infer."""
    data = draw_path(group["path"], group["light"], group["told"], number)
    settings = SamplerSettings(method="auto", seed=number, max_seconds=max_seconds)
    return row_of(data, settings, version)


def random_row(seed: int, max_seconds: float, number: int, version: str = "") -> Row:
    """Draw a random scene, and infer."""
    settings = SamplerSettings(method="auto", seed=number, max_seconds=max_seconds)
    return row_of(random_scene(seed, number), settings, version)
