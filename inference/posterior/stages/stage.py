"""The stages of a posterior: what is known in each, and nothing else.

::

    Selecting -> Starting -+-> Weighted (-> Walking)
                           +-> Settled
                           +-> Tempering -> Weighted (-> Walking) or Walking
                           +-> Walking -> (Tempering -> Weighted (-> Walking) or Walking)

A job without optional terms begins with `Starting`. Ensembles that hardly move call for
populations, once. From weighted draws that could be the answer ensembles walk with the method
`emcee`. Where errors of the model are integrated out behind an exact model, `Tempering`
follows once more, on its moved draws, and the checkpoint keeps what the exact model came to, or
would begin with.
"""

import dataclasses
import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from inference.posterior.progress import Phase, Progress
from inference.posterior.sampling.ensemble import Ensemble
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.proposal import Mixture, Proposal
from inference.posterior.sampling.rounds_so_far import RoundsSoFar
from inference.posterior.sampling.scouts import Scouts
from inference.posterior.sampling.shape import Shape
from inference.posterior.sampling.start import Optimum, added
from inference.posterior.sampling.verdict import Chains, Verdict, chains_of

__all__ = [
    "MOST_STEPS",
    "Drawing",
    "Outset",
    "Selecting",
    "Settled",
    "Stage",
    "Starting",
    "Tempering",
    "Walking",
    "Weighted",
    "optima_of",
]

Array = NDArray[np.float64]

MOST_STEPS = 20_000
_COMPARED = 40_000  # draws at most, whose density is compared with that of the proposal


class _NotBegun:
    """A stage before the first step."""

    phase: ClassVar[Phase] = "starting"

    def progress(self, _: int) -> Progress:
        """Tell how far this is."""
        return Progress(self.phase, 0, None, None, None, False)


@dataclasses.dataclass(frozen=True, eq=False)
class Starting(_NotBegun):
    """It is decided which optional terms stay; optima are looked for, in ways of their own.

    Attributes
    ----------
    fitted : tuple of Optimum or None
        Optima near those of the fit over all frames; None before that was made.
    climbed : tuple of Optimum or None
        Those that climbs from the prior led to, the best first; None before these.
    scouts : Scouts or None
        Points that came from the prior alone; None before they are sent out.
    ends : tuple of Optimum
        Roughly where the best scout leads to; none where sampling does not begin with a shape.
    shapes : tuple of Shape or None
        With the model's errors integrated out, that the best of all these led to; None before
        these, and where sampling begins with none.
    """

    fitted: tuple[Optimum, ...] | None = None
    climbed: tuple[Optimum, ...] | None = None
    scouts: Scouts | None = None
    ends: tuple[Optimum, ...] = ()
    shapes: tuple[Shape, ...] | None = None

    @property
    def looked(self) -> bool:
        """Whether optima were looked for in both ways that know of the readings."""
        return self.fitted is not None and self.climbed is not None

    @property
    def optima(self) -> list[Optimum]:
        """All that were found so far, the best first."""
        found = list(self.climbed or ())
        for one in self.fitted or ():
            found = added(found, one)
        return found


@dataclasses.dataclass(frozen=True, eq=False)
class Selecting(_NotBegun):
    """It is being decided which optional terms stay.

    Attributes
    ----------
    starts : tuple of Starting
        Of the scene with each choice of the terms, in the order of `candidate_terms`. With the
        optima of all of them the choices are assessed; that of the best is where sampling starts.
    """

    starts: tuple[Starting, ...]

    @property
    def looking(self) -> bool:
        """Whether optima are still looked for."""
        return not all(start.looked for start in self.starts)


@dataclasses.dataclass(frozen=True, eq=False)
class Tempering(_NotBegun):
    """Populations are on their way from the prior to the posterior: the Laplace shapes misfit.

    Attributes
    ----------
    proposal : Proposal
        Laplace approximations at the optima.
    populations : tuple of Population or None
        None before they are drawn.
    verdict : Verdict
        On what was drawn so far, which is nothing.
    weighted : WeightedDraws or None
        Importance draws that points from the prior do not contradict; None where they do.
    scouted : bool
        Whether the populations are the scouts, and where these stood on their way from the prior:
        they find every branch and weigh none. Rounds of importance sampling are tried from them
        before populations are carried.
    shaped : bool
        Whether these rounds begin with a shape that the proposal brings, and are only held to the
        scouts.
    reach : float
        Power of the likelihood that populations are carried to. Below 1 they are small, and rounds
        of importance sampling are tried from them before larger ones are carried all the way.
    tried : bool
        Whether rounds from small populations were tried once: what they drew begins them again.
    rounds : RoundsSoFar or None
        Rounds of importance sampling that the populations that arrived began; None before, and
        behind them.
    near : bool
        Whether they are draws of a model without errors, moved by these: near where they are to be.
    """

    phase: ClassVar[Phase] = "tempering"

    proposal: Proposal
    populations: tuple[Population | None, ...]
    verdict: Verdict
    weighted: WeightedDraws | None = None
    scouted: bool = False
    shaped: bool = False
    reach: float = 1.0
    tried: bool = False
    rounds: RoundsSoFar | None = None
    near: bool = False

    @property
    def early(self) -> bool:
        """Whether populations are carried all the way only where rounds from these fail."""
        return self.scouted or self.reach < 1.0

    @property
    def arrived(self) -> bool:
        """Whether no population is on its way any more."""
        return all(map(self.has_come, self.populations))

    def has_come(self, population: Population | None) -> bool:
        """Whether a population is where it is carried to, or died on the way."""
        return population is not None and (population.ended or population.power >= self.reach)


@dataclasses.dataclass(frozen=True, eq=False)
class Walking:
    """Ensembles walk.

    Attributes
    ----------
    proposal : Proposal
        What the independent move proposes from; adapted to pilot draws that are then thrown away.
    ensembles : tuple of Ensemble
        With all their steps since the proposal was adapted.
    verdict : Verdict
        On the draws so far.
    adaptations : int
        How often the proposal was adapted; 0 where no populations were called for.
    ess, r_hat : float or None
        Least effective sample size and largest R-hat so far.
    weighted : WeightedDraws or None
        Importance draws that the ensembles started from, and are held to; None where there are
        none to be trusted.
    start : float or None
        Their effective size, where they could be the answer and all walkers but those of the last
        ensemble began at them: such walkers need not forget where they began.
    """

    proposal: Proposal
    ensembles: tuple[Ensemble, ...]
    verdict: Verdict
    adaptations: int
    ess: float | None = None
    r_hat: float | None = None
    weighted: WeightedDraws | None = None
    start: float | None = None

    @property
    def steps(self) -> int:
        """Steps of each ensemble."""
        return self.ensembles[0].steps

    @property
    def finished(self) -> bool:
        """Whether more steps would serve nothing."""
        return self.verdict.converged or self.steps >= MOST_STEPS

    def chains(self, names: tuple[str, ...]) -> Chains:
        """Return the kept draws of all ensembles; `names` are those of the parameters."""
        kept = chains_of(self.ensembles, self.proposal.optima.nearest, names, self.start)
        if self.start is not None:
            return kept  # where they stay is of no account
        ensembles, walkers, steps, d = kept.z.shape
        some = slice(min(walkers, max(_COMPARED // (ensembles * max(steps, 1)), 1)))
        proposed = self.proposal.log_density(kept.z[:, some].reshape(-1, d))
        log_density = kept.log_density[:, some]
        log_ratio = log_density - proposed.reshape(log_density.shape)
        return dataclasses.replace(kept, log_ratio=log_ratio)

    def progress(self, target_ess: int) -> Progress:
        """Tell how far this is."""
        if self.finished:
            return Progress("summarising", self.steps, self.steps, self.ess, self.r_hat, True)
        target = None
        # with enough draws it is R-hat or a mode that is waited for, nobody knows for how long
        if self.steps and self.ess is not None and self.ess < target_ess:
            wanted = min(self.steps * target_ess / self.ess, MOST_STEPS)
            target = max(math.ceil(wanted), self.steps + 1)
        ess = self.ess
        if ess is None and self.steps == 0 and self.weighted is not None:
            ess = self.weighted.worth  # what an answer would be made of now
        return Progress("sampling", self.steps, target, ess, self.r_hat, False)


@dataclasses.dataclass(frozen=True, eq=False)
class Outset:
    """From where ensembles walk behind weighted draws.

    Attributes
    ----------
    proposal : Proposal
        Of their jumps.
    others : ndarray, shape (n, d)
        Points that came from the prior and know nothing of the draws: where the last one begins.
    adaptations : int
        As of `Walking`.
    """

    proposal: Proposal
    others: Array
    adaptations: int


@dataclasses.dataclass(frozen=True, eq=False)
class Weighted:
    """Importance sampling was done.

    Attributes
    ----------
    optima : Mixture
        Laplace approximations at the optima.
    draws : WeightedDraws
        Draws with their weights.
    verdict : Verdict
        On them.
    outset : Outset or None
        Of ensembles that are to walk from them; None where they are the answer.
    """

    optima: Mixture
    draws: WeightedDraws
    verdict: Verdict
    outset: Outset | None = None

    def progress(self, _: int) -> Progress:
        """Tell how far this is."""
        if self.outset is not None:
            return Progress("sampling", 0, None, self.draws.worth, None, False)
        count = len(self.draws.z)
        return Progress("summarising", count, count, self.draws.worth, None, True)


@dataclasses.dataclass(frozen=True)
class Settled:
    """Nothing is unknown but the ranges: there is nothing to sample."""

    @property
    def verdict(self) -> Verdict:
        """There is nothing that could fail."""
        return Verdict(True, ())

    def progress(self, _: int) -> Progress:
        """Tell how far this is."""
        return Progress("summarising", 0, 0, None, None, True)


Drawing = Tempering | Walking | Weighted | Settled


def optima_of(stage: Drawing) -> Mixture | None:
    """Return Laplace approximations at the optima; None where nothing is unknown."""
    if isinstance(stage, Settled):
        return None
    return stage.optima if isinstance(stage, Weighted) else stage.proposal.optima


Stage = Selecting | Starting | Drawing
