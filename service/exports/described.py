"""Draws with what a reader of a file must know of them."""

import dataclasses
import json
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.posterior.answer.draws import Draws
from inference.posterior.job import Job

__all__ = ["DescribedDraws", "describe_draws", "unit_of"]

Array = NDArray[np.float64]

_UNITS = {
    "object.c0": "m2",
    "object.c1": "m",
    "object.c2": "1",
    "background.strength": "reading",
    "background.distance_m": "m",
    "background.shadow.c0": "m2",
    "background.shadow.c1": "m",
}


@dataclasses.dataclass(frozen=True, eq=False)
class DescribedDraws:
    """Draws of a posterior and what they are of.

    Attributes
    ----------
    columns : (str, str)
        Names of the two readings.
    frames : ndarray of int, shape (n,)
        Indices of the frames that were used: those that are not saturated, and of more than are
        judged at once a random part.
    readings : ndarray, shape (n, 2)
        Their readings.
    columns_of_frames : dict of str to ndarray, shape (n,)
        What else is known of these frames: time_s, gain, object_present.
    attributes : dict of str to str or int
        Method, seed, version, and sensor and scene as JSON.
    """

    draws: Draws
    columns: tuple[str, str]
    frames: NDArray[np.intp]
    readings: Array
    columns_of_frames: dict[str, NDArray[Any]]
    attributes: dict[str, str | int]


def unit_of(parameter: str) -> str:
    """Return the unit of a parameter, "reading" for units of the readings."""
    return _UNITS.get(parameter, "reading" if parameter.startswith("crosstalk.") else "1")


def describe_draws(job: Job, method: str, draws: Draws) -> DescribedDraws:
    """Put draws together with the request that they answer.

    Parameters
    ----------
    method : str
        How it was sampled.
    """
    frames = np.flatnonzero(job.usable)
    also = {
        name: getattr(job.frames, name)[frames]
        for name in ("time_s", "gain", "object_present")
        if getattr(job.frames, name) is not None
    }
    attributes: dict[str, str | int] = {
        "inference_library": "hybridtof",
        "inference_library_version": version("hybridtof"),
        "method": method,
        "seed": job.seed,
        "sensor": json.dumps(job.sensor.model_dump(mode="json", exclude_none=True)),
        "scene": json.dumps(job.scene.model_dump(mode="json", exclude_unset=True)),
    }
    first, second = job.sensor.columns
    readings = np.asarray(job.frames.readings[frames])
    return DescribedDraws(draws, (first, second), job.of_sent(frames), readings, also, attributes)
