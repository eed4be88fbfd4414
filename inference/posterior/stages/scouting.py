"""Rounds of importance draws that begin where scouts stand, and stood on their way."""

from inference.density.collapsed import CollapsedDensity
from inference.posterior.job import Job
from inference.posterior.sampling.aliases import aliases_of
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.population import arrived_at
from inference.posterior.sampling.proposal import Proposal
from inference.posterior.sampling.reparametrisation import reparametrisation_of
from inference.posterior.sampling.scouts import MOST_FRAMES, Scouts
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.stages.chunk import evaluations
from inference.posterior.stages.setting_out import (
    HALFWAY_DRAWS,
    SCOUTED_DRAWS,
    small_populations,
)
from inference.posterior.stages.stage import Tempering

__all__ = ["from_scouts"]

_MOST_S = 40  # seconds that rounds may take: populations that are carried all the way take longer


def from_scouts(
    job: Job,
    density: CollapsedDensity,
    proposal: Proposal,
    stood: Scouts,
    known: WeightedDraws | None,
) -> Tempering | None:
    """Go on from the scouts; None where rounds of importance draws would take long.

    Where crosstalk and a background are confounded, or a background has aliases, so few points
    that never unbent what they stand on are no beginning: small populations are carried first.
    """
    hard = reparametrisation_of(density) is not None or aliases_of(density) is not None
    draws = HALFWAY_DRAWS if hard else SCOUTED_DRAWS
    cheap = _MOST_S * evaluations(job) >= draws and len(density.frames) <= MOST_FRAMES
    pending = Verdict(False, ("no steps were made",))
    if cheap and hard:
        return small_populations(Tempering(proposal, (), pending, known))
    if not (cheap and len(stood.hot) > stood.hot.shape[1]):
        return None
    arrived = arrived_at(stood.z), arrived_at(stood.hot)
    return Tempering(proposal, arrived, pending, known, scouted=True)
