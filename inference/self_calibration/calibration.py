"""One calibration: what is asked of a posterior, and what it said."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from inference.posterior.answer.posterior import Posterior
from inference.posterior.calibrated import calibrated_scene
from inference.posterior.infer import infer
from inference.posterior.job import prepare
from inference.posterior.settings import SamplerSettings
from simulator.errors import HybridTofError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Asked", "Outcome", "answer", "outcome_of", "sampler_of", "seed_of"]

_TARGET_ESS = 200


@dataclasses.dataclass(frozen=True, eq=False)
class Asked:
    """A posterior that is wanted.

    Attributes
    ----------
    number : int
        Counts the calibrations of a stream, from 1.
    seed : int
        Of the posterior: of the stream's seed and the number.
    reason : str
        Why.
    decided_at : int
        Number of the frame after which it was asked for.
    sequence : tuple of int
        Numbers of its frames, ascending.
    scene : Scene
        What is known before.
    frames : Frames
        From which it is to learn.
    """

    number: int
    seed: int
    reason: str
    decided_at: int
    sequence: tuple[int, ...]
    scene: Scene
    frames: Frames


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What became of it.

    Attributes
    ----------
    scene : Scene or None
        The calibrated scene; None where it is not taken.
    reason : str
        Why it is not.
    misfit : bool
        Whether the model did not fit.
    statuses : mapping of str to str
        "identified", "weak" or "not_identified", by unknown, and of range_m.
    """

    scene: Scene | None
    reason: str = ""
    misfit: bool = False
    statuses: Mapping[str, str] = dataclasses.field(default_factory=dict)


def sampler_of(asked: Asked) -> SamplerSettings:
    """Return how a calibration is sampled."""
    return SamplerSettings(seed=asked.seed, target_ess=_TARGET_ESS)


def outcome_of(summary: Mapping[str, Any], scene: Scene | None) -> Outcome:
    """Judge a posterior.

    Parameters
    ----------
    summary : mapping
        As sent to clients (`Posterior.to_json`).
    scene : Scene or None
        What it knows as a scene; None where nothing was drawn.

    Returns
    -------
    Outcome
        Taken only where it has converged and the model fits.
    """
    misfit = bool(summary["fit"]["misfit"])
    statuses = {row["parameter"]: row["status"] for row in summary["identifiability"]}
    if not summary["verdict"]["converged"] or scene is None:
        reasons = "; ".join(summary["verdict"]["reasons"])
        return Outcome(None, f"it has not converged: {reasons}", misfit, statuses)
    if misfit:
        reasons = "; ".join(summary["fit"]["reasons"])
        return Outcome(None, f"the model does not fit its frames: {reasons}", True, statuses)
    if scene.calibration is not None:
        calibration = scene.calibration.model_copy(update={"date": None})
        scene = scene.model_copy(update={"calibration": calibration})
    return Outcome(scene, "", False, statuses)


def answer(sensor: Sensor, asked: Asked) -> Outcome:
    """Compute a calibration at once; the same request has the same outcome.

    That holds for as long as the processor time of a posterior does not run out, after which it
    has not converged.
    """
    try:
        found = infer(sensor, asked.scene, asked.frames, sampler_of(asked))
        return outcome_of(found.to_json(), _scene_of(sensor, asked, found))
    except HybridTofError as error:
        return Outcome(None, f"there is no posterior: {error}")


def _scene_of(sensor: Sensor, asked: Asked, found: Posterior) -> Scene | None:
    if not found.drawn:
        return None
    # as sampled, which is how a service keeps it
    sampled = prepare(sensor, asked.scene, asked.frames, sampler_of(asked)).scene
    return calibrated_scene(sensor, sampled, asked.frames, found)


def seed_of(seed: int, number: int) -> int:
    """Return the seed of a calibration, of 53 bits."""
    return int(np.random.SeedSequence([seed, number]).generate_state(1, np.uint64)[0] >> 11)
