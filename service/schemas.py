"""Shapes of requests, by which they are validated, and of responses, for OpenAPI."""

from typing import Annotated, Any, Literal

import pydantic

from inference.posterior.settings import SamplerSettings
from inference.tracking.settings import TrackingSettings
from simulator.frames import FrameColumns
from simulator.scene import Scene
from simulator.sensor import Sensor
from simulator.trajectories import Trajectory
from simulator.validated import Validated

__all__ = [
    "EstimateRequest",
    "EstimatesResponse",
    "FrameEstimate",
    "IdentifiabilityRequest",
    "IdentifiabilityResponse",
    "LeftOutTechnique",
    "PosteriorPage",
    "PosteriorRequest",
    "PosteriorResponse",
    "SimulationRequest",
    "SimulationResponse",
    "SystemDescription",
    "TechniqueDescription",
    "TechniqueEstimates",
    "TechniquesResponse",
    "TrackedSystem",
]

AnySensor = Annotated[Sensor, pydantic.Field(discriminator="kind")]
# the largest integer that every JSON reader keeps exactly
Seed = Annotated[int, pydantic.Field(ge=0, le=2**53 - 1)]
Name = Annotated[str, pydantic.Field(max_length=64)]
Positive = Annotated[float, pydantic.Field(gt=0)]
_PLANNED = pydantic.Field(min_length=1, max_length=10_000, fail_fast=True)


class SystemDescription(Validated):
    """A sensor and the scene before it: what every request and every scene file holds."""

    sensor: AnySensor
    scene: Scene


class TrackedSystem(SystemDescription):
    """A sensor, the scene before it, and how its objects move."""

    tracking: TrackingSettings = TrackingSettings()


class EstimateRequest(SystemDescription):
    """Body of ``POST /v1/estimates``."""

    frames: FrameColumns
    techniques: Annotated[list[Name], pydantic.Field(min_length=1, max_length=64)] | None = None


class PosteriorRequest(SystemDescription):
    """Body of ``POST /v1/posteriors``."""

    frames: FrameColumns
    sampler: SamplerSettings = SamplerSettings()


class SimulationRequest(SystemDescription):
    """Body of ``POST /v1/simulations``; a seed that is left out is drawn and returned."""

    trajectory: Trajectory
    seed: Seed | None = None


class IdentifiabilityRequest(SystemDescription):
    """Body of ``POST /v1/identifiability``: frames before they are taken.

    Attributes
    ----------
    ranges_m : list of float
        Range of the object in every frame [m].
    object_present : list of bool, optional
        False for a frame without the object.
    at : dict of str to float, optional
        Values of unknowns by scene path at which the bounds are computed; the others are at the
        medians of their priors.
    """

    ranges_m: Annotated[list[Positive], _PLANNED]
    object_present: Annotated[list[bool], _PLANNED] | None = None
    at: Annotated[dict[Name, float], pydantic.Field(max_length=64)] | None = None


class FrameEstimate(pydantic.BaseModel):
    """One technique's answer for one frame."""

    status: Literal["unique", "ambiguous", "none", "saturated"]
    range_m: float | None
    sd_m: float | None
    roots_m: list[float]
    roots_sd_m: list[float | None]
    near_fold: bool
    reason: str | None = None
    range_bounds_m: tuple[float, float] | None = None
    power_law: float | None = None
    zeta: float | None = None


class FittedParameter(pydantic.BaseModel):
    """An unknown that a technique of many frames found; sd is the bound times `widening`."""

    value: float | None
    sd: float | None
    status: Literal["identified", "weak", "not_identified"]
    reason: str | None = None


class FittedOptimum(pydantic.BaseModel):
    """One of the distinct optima of a fit; the deviance is -2 log likelihood."""

    excess_deviance: float
    parameters: dict[str, float | None]


class TechniqueFit(pydantic.BaseModel):
    """How well a technique of many frames explains them."""

    chi_square: float
    deviance: float | None = None
    degrees_of_freedom: int
    p_value: float
    misfit: bool
    rank: int
    widening: float | None = None
    optima: list[FittedOptimum]


class TechniqueEstimates(pydantic.BaseModel):
    """One technique's answer."""

    technique: str
    frames: list[FrameEstimate]
    parameters: dict[str, FittedParameter] | None
    fit: TechniqueFit | None = None
    runtime_s: float


class LeftOutTechnique(pydantic.BaseModel):
    """A technique that was not used, and why."""

    technique: str
    reason: str


class EstimatesResponse(pydantic.BaseModel):
    """Answer of ``POST /v1/estimates``."""

    chosen: str | None
    results: list[TechniqueEstimates]
    left_out: list[LeftOutTechnique]


class _Progress(pydantic.BaseModel):
    steps: int
    target: int
    ess: float | None
    rhat: float | None
    eta_s: float | None


class _Verdict(pydantic.BaseModel):
    converged: bool
    reasons: list[str]


class _ModeShape(pydantic.BaseModel):
    weight: float
    weight_error: float | None
    sd: float
    q05: float
    q95: float


class _ParameterMode(_ModeShape):
    value: float


class _RangeMode(_ModeShape):
    range_m: float


class _JointMode(pydantic.BaseModel):
    parameters: dict[str, float]
    log_density: float
    weight: float | None
    weight_error: float | None


class _Parameter(pydantic.BaseModel):
    """Mean, sd and mcse_mean are null where there are several modes: ``modes`` has their own."""

    mean: float | None
    sd: float | None
    q05: float
    q50: float
    q95: float
    ess_bulk: float | None
    ess_tail: float | None
    rhat: float | None
    mcse_mean: float | None
    modes: list[_ParameterMode]


class _Ranges(pydantic.BaseModel):
    """A frame of several modes has neither mean nor sd; one without range has nulls throughout."""

    q05: list[float | None]
    q50: list[float | None]
    q95: list[float | None]
    mean: list[float | None]
    sd: list[float | None]
    near_fold: list[bool]
    modes: list[list[_RangeMode]]


class _Identifiability(pydantic.BaseModel):
    parameter: str
    status: Literal["identified", "weak", "not_identified"]
    contraction: float | None
    reason: str


class _FitCheck(pydantic.BaseModel):
    name: Literal["total", "worst_frame", "neighbours", "wander"]
    statistic: float
    expected: float
    p_value: float


class _Fit(pydantic.BaseModel):
    p_value: float | None
    misfit: bool
    reasons: list[str]
    chi_square: float | None
    degrees_of_freedom: float | None
    checks: list[_FitCheck]
    outliers: list[int]


class _LeftOutTerm(pydantic.BaseModel):
    term: str
    reason: str


class _Candidate(pydantic.BaseModel):
    terms: list[str]
    chosen: bool
    log_evidence: float | None
    log_evidence_error: float | None
    evidence_k_hat: float | None
    log_predictive: float | None
    log_predictive_error: float | None
    predictive_k_hat: float | None


class _Decision(pydantic.BaseModel):
    term: str
    kept: bool
    agree: bool
    reason: str


class _Selection(pydantic.BaseModel):
    candidates: list[_Candidate]
    decisions: list[_Decision]


class _Runtime(pydantic.BaseModel):
    wall_s: float
    cpu_s: float
    likelihood_calls: int
    k_hat: float | None


class _Posterior(pydantic.BaseModel):
    id: str
    status: Literal["queued", "running", "done", "cancelled", "failed"]
    method: str
    seed: int
    progress: _Progress | None


class PosteriorResponse(_Posterior):
    """Answer of ``GET /v1/posteriors/{id}``; what is not known yet is null."""

    verdict: _Verdict | None
    parameters: dict[str, _Parameter] | None
    modes: list[_JointMode] | None
    range_m: _Ranges | None
    identifiability: list[_Identifiability] | None
    fit: _Fit | None
    left_out: list[_LeftOutTerm] | None
    selection: _Selection | None
    runtime: _Runtime | None
    problem: dict[str, Any] | None = None


class PosteriorPage(pydantic.BaseModel):
    """Answer of ``GET /v1/posteriors``: the newest first."""

    items: list[_Posterior]
    next_cursor: str | None


class _Bound(pydantic.BaseModel):
    value: float | None
    cramer_rao_sd: float | None
    posterior_sd: float | None


class _RangeBounds(pydantic.BaseModel):
    value: list[float | None]
    cramer_rao_sd: list[float | None]
    posterior_sd: list[float | None]
    scale_cramer_rao_sd: float | None
    scale_posterior_sd: float | None


class _Direction(pydantic.BaseModel):
    cramer_rao_sd: float | None
    parameters: dict[str, float]


class IdentifiabilityResponse(pydantic.BaseModel):
    """Answer of ``POST /v1/identifiability``.

    Attributes
    ----------
    rank : int
        Directions of the unknowns that noise-free readings tell, the ranges being unknown too.
    unknowns : int
        Number of unknowns that the readings depend on; identifiable are all where rank equals it.
    singular_values : list of float
        Of the whitened Jacobian, ranges eliminated, along log c0, c1 / sqrt(c0), log c2, crosstalk
        in units of the scene's light, log B, log R, log c0' and c1' / sqrt(c0').
    resolution : float
        Singular value, relative to a Jacobian scaled to unit rows and columns, below which rounding
        does not tell it from zero.
    directions : list
        Directions along the same coordinates that the readings do not tell (null), then the worst
        of the others with its bound: weights of the unknowns that make each up.
    distinct_ranges, needed_ranges : int
        Distinct ranges that there are, and that the unknowns need at least.
    parameters : dict
        Every unknown in SI units: value at which the bounds hold, Cramer-Rao bound of the readings
        alone (null: not identifiable, or a parameter of the ranges' prior), predicted posterior
        standard deviation, prior included.
    range_m : object
        The same for every range [m], null for a frame without object, and for the common scale of
        the ranges (the mean of log r).
    identifiability : list
        A status and a reason for every unknown and for ``range_m``.
    """

    rank: int
    unknowns: int
    singular_values: list[float]
    resolution: float
    directions: list[_Direction]
    distinct_ranges: int
    needed_ranges: int
    parameters: dict[str, _Bound]
    range_m: _RangeBounds
    identifiability: list[_Identifiability]


class SimulationResponse(pydantic.BaseModel):
    """Answer of ``POST /v1/simulations``."""

    frames: dict[str, list[float] | list[bool]]
    truth: dict[str, Any]
    seed: int


class TechniqueDescription(pydantic.BaseModel):
    """What a technique needs, what it is immune to, what it costs.

    Attributes
    ----------
    name : str
        Its name in requests.
    kinds : list of str
        Sensors that it serves.
    observables : str
        What it uses of a frame.
    needs : list of str
        Paths of the scene that must be known numbers.
    immune_to : list of str
        Terms that may be present without being known.
    uses_background : bool
        Whether the scene must have a background.
    differential : bool
        Whether it uses derivatives in time.
    cost : float
        Time a frame relative to ``conventional``.
    equations : str
        Where it comes from.
    roots : str
        How many roots it has, and when.
    """

    name: str
    kinds: list[str]
    observables: str
    needs: list[str]
    immune_to: list[str]
    uses_background: bool
    differential: bool
    cost: float
    equations: str
    roots: str


class TechniquesResponse(pydantic.BaseModel):
    """Answer of ``GET /v1/techniques``."""

    techniques: list[TechniqueDescription]
