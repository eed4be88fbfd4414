"""Estimates as clients see them, a row a frame or column by column (`service.answers.encoding`)."""

from typing import Literal

import pydantic

__all__ = [
    "ColumnarEstimatesResponse",
    "EstimateColumns",
    "EstimatesResponse",
    "FrameEstimate",
    "LeftOutTechnique",
    "TechniqueColumns",
    "TechniqueEstimates",
]

StatusName = Literal["unique", "ambiguous", "none", "saturated"]


class ErrorBudget(pydantic.BaseModel):
    """Parts of a standard deviation; the sum of their squares is its square."""

    noise: float | None
    scene: float | None
    model: float | None


class FrameEstimate(pydantic.BaseModel):
    """One technique's answer for one frame; standard deviations are the whole."""

    status: StatusName
    range_m: float | None
    sd_m: float | None
    roots_m: list[float]
    roots_sd_m: list[float | None]
    sd_parts_m: ErrorBudget | None = None
    near_fold: bool
    reason: str | None = None
    range_bounds_m: tuple[float, float] | None = None
    power_law: float | None = None
    power_law_sd: float | None = None
    zeta: float | None = None
    zeta_sd: float | None = None


class ErrorBudgets(pydantic.BaseModel):
    """`ErrorBudget` of every frame; null where there is none."""

    noise: list[float | None]
    scene: list[float | None]
    model: list[float | None]


class EstimateColumns(pydantic.BaseModel):
    """The members of `FrameEstimate`, each for every frame; null where a frame lacks it."""

    status: list[StatusName]
    range_m: list[float | None]
    sd_m: list[float | None]
    roots_m: list[list[float]]
    roots_sd_m: list[list[float | None]]
    near_fold: list[bool]
    reason: list[str | None]
    sd_parts_m: ErrorBudgets | None = None
    range_bounds_m: list[tuple[float, float] | None] | None = None
    power_law: list[float | None] | None = None
    power_law_sd: list[float | None] | None = None
    zeta: list[float | None] | None = None
    zeta_sd: list[float | None] | None = None


class FittedParameter(pydantic.BaseModel):
    """An unknown that a technique of many frames found; sd is the whole."""

    value: float | None
    sd: float | None
    status: Literal["identified", "weak", "not_identified"]
    sd_parts: ErrorBudget | None = None
    reason: str | None = None


class FittedOptimum(pydantic.BaseModel):
    """One of the distinct optima of a fit; the deviance is -2 log likelihood.

    Where the model errs it is that of how probable they are (docs/model.md, fit-evidence).
    """

    excess_deviance: float
    parameters: dict[str, float | None]


class TechniqueFit(pydantic.BaseModel):
    """How well a technique of many frames explains them."""

    chi_square: float
    deviance: float | None = None
    degrees_of_freedom: int
    p_value: float
    misfit: bool
    reasons: list[str] = []
    checks: dict[str, float] = {}
    by_priors: bool = False
    rank: int
    widening: float | None = None
    optima: list[FittedOptimum]


class _TechniqueAnswer(pydantic.BaseModel):
    technique: str
    parameters: dict[str, FittedParameter] | None
    fit: TechniqueFit | None = None
    runtime_s: float


class TechniqueEstimates(_TechniqueAnswer):
    """One technique's answer."""

    frames: list[FrameEstimate]


class TechniqueColumns(_TechniqueAnswer):
    """One technique's answer, column by column."""

    frames: EstimateColumns


class LeftOutTechnique(pydantic.BaseModel):
    """A technique that was not used, and why."""

    technique: str
    reason: str


class _Answer(pydantic.BaseModel):
    chosen: str | None
    left_out: list[LeftOutTechnique]
    assumptions: list[str]
    do_first: str | None = None


class EstimatesResponse(_Answer):
    """Answer of ``POST /v1/estimates``."""

    results: list[TechniqueEstimates]


class ColumnarEstimatesResponse(_Answer):
    """Answer of ``POST /v1/estimates?shape=columns``."""

    results: list[TechniqueColumns]
