"""How draws of a posterior that takes its model for exact follow errors of flux and shadow.

Some draws are taken, and each is followed linearly (`inference.identifiability.model_response`);
where that bends, steps are repeated from fewer of them.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.frame.blocks import DISPLACEMENT, RANGE
from inference.frame.known_range import rates_of
from inference.frame.warmth import gains_of
from inference.identifiability.experiment import Experiment
from inference.identifiability.model_response import (
    ModelResponse,
    common_pull,
    curvature_of_response,
    model_response,
)
from inference.posterior.job import Job

__all__ = [
    "MEASURED",
    "Responses",
    "chosen_draws",
    "first_responses",
    "flux_leads",
    "repeated",
    "responses_at",
]

Array = NDArray[np.float64]

_STRAIGHTEST = 0.05  # share of a way of unknowns that the next order may add unseen
_REFERENCES = 100  # draws at which the response is computed
_FRAMES = 20_000  # that this may cost
_FEWEST = 20
_STRAIGHT = 0.1  # share of the response that the next order adds, below which the first is all
_THINNED = 4  # of them one is followed further
# errors that are followed beyond the first order at draws: to tell whether that is of any size, and
# of what size, which few far draws decide
_TRIED, MEASURED = 24, 200
_OF_FLUX = 0.6  # of what all errors move the scale by, that those of the flux move it by alone


@dataclasses.dataclass(frozen=True, eq=False)
class Responses:
    """Responses of some draws to errors of flux and shadow.

    Attributes
    ----------
    z, log_r : ndarray, shape (m, d) and (m, frames)
        The draws; nan for a frame without object.
    experiments : tuple of Experiment
        The draws with the sizes of the errors.
    each : tuple of ModelResponse
        Their responses.
    readings : ndarray, shape (frames, 2 or 4)
        What they answer to.
    curvature : float
        What the next order would add to a response, as a share of it, root mean square over ranges
        and draws; 0 where there is no such error.
    repeated : bool
        Whether steps were repeated until they settled, because the first one bends.
    """

    z: Array
    log_r: Array
    experiments: tuple[Experiment, ...]
    each: tuple[ModelResponse, ...]
    readings: Array
    curvature: float
    repeated: bool

    @property
    def by_z(self) -> Array:
        """Change of z, and with each of k standard normal errors, shape (m, d, 1 + k)."""
        shift = np.array([of.shift[0] for of in self.each])[:, :, None]
        return self._beside(shift, np.array([of.parameters for of in self.each]))

    @property
    def by_log_r(self) -> Array:
        """Change of log r likewise, shape (m, frames, 1 + k)."""
        shift = np.array([of.shift[1] for of in self.each])[:, :, None]
        return self._beside(shift, np.array([of.log_r for of in self.each]))

    @property
    def of_scale(self) -> float:
        """Standard deviation of the mean of log r over the frames from the errors."""
        present = np.isfinite(self.log_r[0])
        moved = self.by_log_r[:, present, 1:].mean(axis=1)
        return float(np.sqrt(np.square(moved).sum(axis=1).mean()))

    @property
    def missed(self) -> Array:
        """By how many standard deviations the next order would move each unknown, shape (d,).

        An exact model may put an unknown far from where errors let it be, as measured by what they
        leave of it: what the next order adds to so long a way then counts, however small a share.
        That share is measured on ranges, and an unknown's own may be larger.
        """
        moved = self.by_z
        there = self.z + moved[:, :, 0]
        spread = there.var(axis=0) + np.square(moved[:, :, 1:]).sum(axis=2).mean(axis=0)
        off = max(self.curvature, _STRAIGHTEST) * np.abs(moved[:, :, 0].mean(axis=0))
        sd = np.sqrt(spread)
        return np.asarray(np.divide(off, sd, out=np.zeros_like(off), where=sd > 0))

    def _beside(self, shift: Array, moved: Array) -> Array:
        stretch = np.hypot(1.0, min(self.curvature, 1.0))  # the next order makes nothing narrower
        return np.concatenate([shift, stretch * moved], axis=2)


def chosen_draws(count: int, frames: int) -> NDArray[np.intp]:
    """Return which of so many draws are followed, evenly spread over them."""
    most = int(np.clip(_FRAMES // max(frames, 1), _FEWEST, _REFERENCES))
    return np.linspace(0, count - 1, min(most, count)).astype(np.intp)


def responses_at(
    job: Job,
    density: CollapsedDensity,
    z: Array,
    log_r: Array,
    rng: np.random.Generator,
) -> Responses:
    """Follow draws, and where that bends until steps settle.

    Parameters
    ----------
    density : CollapsedDensity
        Of which they are draws.
    z : ndarray, shape (m, d)
        Draws, as `chosen_draws` chooses them.
    log_r : ndarray, shape (m, frames)
        Their ranges; nan for a frame without object.

    Returns
    -------
    Responses
        Of all of these draws, or of every fourth where they bend.
    """
    return repeated(job, first_responses(job, density, z, log_r, rng), rng)


def first_responses(
    job: Job,
    density: CollapsedDensity,
    z: Array,
    log_r: Array,
    rng: np.random.Generator,
) -> Responses:
    """Follow all of the draws by one step; parameters are those of `responses_at`."""
    error, rates = job.model_error, rates_of(density.frames)
    flux = 0.0 if error.integrated else error.flux
    shadow = density.parameters.has_background and not isinstance(density, DiscrepantDensity)
    experiments = tuple(
        Experiment(
            density.sensor,
            density.parameters,
            z[i],
            log_r[i],
            gains_of(density.frames),
            discrepancy=flux or None,
            shadow=error.shadow if shadow else 0.0,
            common_range=job.scene.motion == "static",
            rates=rates,
        )
        for i in range(len(z))
    )
    readings = density.frames[:, [0, 1] if rates is None else [0, 1, RANGE, DISPLACEMENT]]
    each = tuple(model_response(one, readings) for one in experiments)
    erring = each[0].parameters.shape[1] > 0
    curvature = _curvature(experiments, each, _TRIED, rng) if erring else 0.0
    return Responses(z, log_r, experiments, each, readings, curvature, repeated=False)


def repeated(
    job: Job, first: Responses, rng: np.random.Generator, tried: int = MEASURED
) -> Responses:
    """Return responses of every fourth of the draws, steps repeated until they settle.

    Parameters
    ----------
    first : Responses
        Of one step.
    tried : int
        Errors at most that are followed beyond the first order.

    Returns
    -------
    Responses
        ``first`` where that is straight.
    """
    pull = common_pull(first.each)
    erring = first.each[0].parameters.shape[1] > 0
    further = erring and job.scene.motion != "static"
    if not (further and (first.curvature > _STRAIGHT or bool(pull.any()))):
        return first
    fewer = slice(None, None, _THINNED)
    log_r, experiments = first.log_r[fewer], first.experiments[fewer]
    each = tuple(model_response(one, first.readings, pull) for one in experiments)
    measured = int(np.clip(_FRAMES // max(log_r.shape[1], 1), len(experiments), tried))
    curvature = _curvature(experiments, each, measured, rng)
    return Responses(
        first.z[fewer], log_r, experiments, each, first.readings, curvature, repeated=True
    )


def flux_leads(found: Responses) -> bool:
    """Tell whether most of what errors move the scale by is the flux's, not a shadow's.

    Both are told at the same draws, by as many steps, without what the next order adds.

    Parameters
    ----------
    found : Responses
        To errors of both.
    """
    if not found.experiments[0].shadow > 0:
        return True
    alone = tuple(dataclasses.replace(one, shadow=0.0) for one in found.experiments)
    each = tuple(model_response(one, found.readings) for one in alone)
    if found.repeated:
        pull = common_pull(each)
        each = tuple(model_response(one, found.readings, pull) for one in alone)
    both = dataclasses.replace(found, curvature=0.0)
    flux = dataclasses.replace(both, experiments=alone, each=each)
    return flux.of_scale >= _OF_FLUX * both.of_scale


def _curvature(
    experiments: Sequence[Experiment],
    responses: Sequence[ModelResponse],
    tried: int,
    rng: np.random.Generator,
) -> float:
    """Return the share of the response that the next order would add, by so many random errors."""
    chosen = np.linspace(0, len(experiments) - 1, tried).astype(int)
    normal = rng.standard_normal((tried, responses[0].log_r.shape[1]))
    missed, size = 0.0, 0.0
    for i in np.unique(chosen):
        of, each = responses[i], normal[chosen == i]
        present = np.isfinite(experiments[i].log_r)
        if not present.any():
            return 0.0
        way = (each @ of.log_r.T + of.shift[1])[:, present]
        moved = np.mean(np.square(way), axis=1)
        off = curvature_of_response(experiments[i], of, each)
        # what is wildly off counts as wholly off, and no more
        missed += float(np.minimum(np.square(off), moved).sum())
        size += float(moved.sum())
    return float(np.sqrt(missed / size)) if size > 0 else 0.0
