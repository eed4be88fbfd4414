"""Room for larger errors, where readings refute the model: of the flux, of the noise, or of both.

What the errors that are granted explain is an honest answer, only wider. Noise that is larger than
stated asks for an error of the flux too, since a fit takes it for one: what the first room leaves
unexplained the second may explain, unless what is left lasts from frame to frame, as no noise does.
One frame of something else, or light that drifts, is neither.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.fit import Fit
from inference.posterior.answer.whole import Whole
from inference.posterior.criticism.discrepancy_check import LargerDiscrepancy
from inference.posterior.criticism.model_check import (
    asked_for,
    lasts_from_frame_to_frame,
    model_check,
    noise_asked_for,
)
from inference.posterior.job import Job

__all__ = ["Room", "room_for", "with_room"]

Parts = tuple[Job, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class Room:
    """What an answer was given room for.

    Attributes
    ----------
    parts : tuple of Job
        With the sizes of the errors.
    whole : Whole
        The draws, moved by these.
    explained : bool
        Whether the readings are such as these errors make.
    """

    parts: Parts
    whole: Whole
    explained: bool


def room_for(
    given: Job,
    density: CollapsedDensity,
    stated: Room,
    checked: tuple[Fit, LargerDiscrepancy | None],
    moved: Callable[[Job], Whole],
    rng: np.random.Generator,
) -> Room:
    """Give an answer the room that readings ask for: the least that explains them.

    Parameters
    ----------
    given : Job
        As it was given.
    density : CollapsedDensity
        Of the first of its parts.
    stated : Room
        For what the scene allows.
    checked : (Fit, LargerDiscrepancy or None)
        What `inference.posterior.criticism.model_check.model_check` says of that.
    moved : callable
        Moves the draws of a part by the errors of the model that it allows for.

    Returns
    -------
    Room
        ``stated`` where nothing more is asked for; where nothing explains the readings, room for
        both.
    """
    fit, larger = checked
    of_flux, of_noise = asked_for(given, density, fit, larger)
    if not max(of_flux, of_noise) > 1:
        return stated

    def checked_again(flux: float, noise: float) -> tuple[Room, Fit]:
        parts = tuple(
            dataclasses.replace(part, flux_times=flux, noise_times=noise) for part in stated.parts
        )
        whole = moved(parts[0])
        again = model_check(parts[0], density, whole, rng, parts[1:])[0]
        return Room(parts, whole, not again.misfit), again

    first, left = checked_again(of_flux, of_noise)
    noise = noise_asked_for(fit)
    if first.explained or not (of_flux > 1 and noise > 1):
        return first
    second, left_by_noise = checked_again(1.0, noise)
    if second.explained and not lasts_from_frame_to_frame(left_by_noise):
        return second
    rest = noise_asked_for(left)
    return checked_again(of_flux, rest)[0] if rest > 1 else first


def with_room(fit: Fit, job: Job) -> Fit:
    """Say for what an answer was given room."""
    reasons = fit.reasons
    if job.flux_times > 1:
        reasons += (
            f"every interval has room for errors of the object's flux {job.flux_times:.2g} times "
            "what `discrepancy` allows",
        )
    if job.noise_times > 1:
        reasons += (
            f"every interval is as wide as noise {math.sqrt(job.noise_times):.2g} times what is "
            "stated makes it",
        )
    return dataclasses.replace(fit, reasons=reasons)
