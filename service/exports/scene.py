"""A posterior as a document of sensor and scene, made from its draws."""

import json
from collections.abc import Mapping
from typing import Any

from inference.posterior.answer.draws import Draws
from inference.posterior.calibrated import scene_of_draws
from inference.posterior.job import Job

__all__ = ["findings_of", "write_scene"]


def findings_of(result: Mapping[str, Any], seed: int, date: str) -> dict[str, Any]:
    """Return what a calibrated scene says of the posterior behind it, besides its draws.

    Parameters
    ----------
    result : mapping
        The posterior as sent to clients.
    seed : int
        Its seed.
    date : str
        Of writing.
    """
    return {
        "converged": result["verdict"]["converged"],
        "reasons": result["verdict"]["reasons"],
        "misfit": bool(result["fit"]["misfit"]),
        "left_out": result["left_out"],
        "seed": seed,
        "date": date,
    }


def write_scene(
    findings: Mapping[str, Any], other_objects: bool, job: Job, _: str, draws: Draws
) -> bytes:
    """Write the calibrated scene of draws.

    Parameters
    ----------
    findings : mapping
        Of `findings_of`.
    other_objects : bool
        Whether it is for other objects, as for `scene_of_draws`.
    job : Job
        With the terms that were kept.
    _ : str
        How it was sampled, which is all the same to a scene.

    Returns
    -------
    bytes
        JSON of an object with the members sensor and scene.
    """
    scene = scene_of_draws(job.sensor, job.scene, job.frames, draws, findings, other_objects)
    document = {
        "sensor": job.sensor.model_dump(mode="json", exclude_none=True),
        "scene": scene.model_dump(mode="json", exclude_none=True),
    }
    return json.dumps(document, allow_nan=False).encode()
