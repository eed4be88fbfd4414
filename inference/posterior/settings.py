"""What a caller may choose about the sampling of a posterior."""

from typing import Annotated, Literal

import pydantic

from simulator.validated import Validated

__all__ = ["SamplerSettings"]


class SamplerSettings(Validated):
    """Settings of a posterior.

    Attributes
    ----------
    method : "emcee", "importance" or "auto"
        Ensembles of walkers, which begin at weighted draws where these could be the answer, and
        give way to draws from the prior where frames of an object at rest tell two numbers;
        Laplace with Student-t importance sampling, refused above a Pareto k-hat of 0.5; or such
        weighted draws themselves, where their weights, and points that came from the prior, say
        that they are good enough, ensembles otherwise.
    ensembles : int
        Independent ensembles; fewer than four cannot show much disagreement.
    target_ess : int
        Effective sample size wanted for every parameter.
    max_seconds : float
        Processor time [s], compiling apart, after which no chunk begins and an unfinished run is
        summarised as it is: the sum over all ensembles, in whatever process they run. What has
        begun is ended first: a chunk of about a second, of every ensemble or population, or of
        rounds of importance draws; the draws of `importance`, ten seconds at most; or the search
        for starting points, which takes a second for 100 frames and half a minute for the most
        frames and nine unknowns, and several times as long with a discrepancy.
    seed : int, optional
        Left out: drawn, and returned with the answer.
    """

    method: Literal["emcee", "importance", "auto"] = "emcee"
    ensembles: Annotated[int, pydantic.Field(ge=2, le=32)] = 4
    target_ess: Annotated[int, pydantic.Field(ge=10, le=1_000_000)] = 400
    max_seconds: Annotated[float, pydantic.Field(gt=0, le=86_400)] = 120.0
    seed: Annotated[int, pydantic.Field(ge=0, lt=2**63)] | None = None
