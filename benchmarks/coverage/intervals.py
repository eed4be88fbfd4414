"""How the 90 % intervals of one data set stand to the truth, as a row of a table."""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.resumable import Row
from benchmarks.sampling import sample
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor

__all__ = ["COLUMNS", "interval_row"]

COLUMNS = (
    "set",
    "scene",
    "version",
    "inside",
    "width",
    "error",
    "misfit",
    "scale",
    "converged",
    "ess",
    "seconds",
    "reason",
)


def interval_row(
    name: str,
    sensor: Sensor,
    scene: Mapping[str, Any],
    frames: Frames,
    truth_m: NDArray[np.float64],
    settings: SamplerSettings,
    version: str,
) -> Row:
    """Infer, and hold the intervals to the truth.

    Parameters
    ----------
    name : str
        Of the scene, for the table.
    sensor, frames : Sensor, Frames
        What was read, and by what.
    scene : mapping
        What inference is told.
    truth_m : ndarray, shape (n,)
        True ranges [m]; nan for a frame without object.
    settings : SamplerSettings
        Of the posterior.
    version : str
        Of the code, for the table.

    Returns
    -------
    Row
        ``inside``: share of the intervals that hold the truth; ``width``: median of width over
        truth; ``error``: median of median over truth, minus one; ``scale``: status of the common
        scale of the ranges; ``seconds`` of processor time. Without these where the posterior was
        refused.
    """
    row: dict[str, str | int | float] = {"scene": name, "version": version}
    start = time.process_time()
    try:
        found = sample(sensor, parse_scene(scene), frames, settings)
    except RefusedError as error:
        return {**row, "converged": 0, "reason": f"refused: {error}"}
    posterior = found.posterior
    there = np.isfinite(truth_m)
    low, middle, high = (getattr(posterior.range_m, q)[there] for q in ("q05", "q50", "q95"))
    truth_m = truth_m[there]
    (scale,) = (each for each in posterior.identifiability if each.parameter == "range_m")
    return {
        **row,
        "inside": float(np.mean((low <= truth_m) & (truth_m <= high))),
        "width": float(np.median((high - low) / truth_m)),
        "error": float(np.median(middle / truth_m - 1.0)),
        "misfit": int(posterior.fit.misfit is True),
        "scale": scale.status,
        "converged": int(posterior.verdict.converged),
        "seconds": time.process_time() - start,
        "ess": "" if found.ess is None else round(found.ess),
        "reason": " / ".join(posterior.verdict.reasons),
    }
