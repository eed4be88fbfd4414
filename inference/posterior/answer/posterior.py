"""The answer: what is known of every parameter and every range, and whether to believe it."""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.status import Identifiability
from inference.posterior.answer.draws import Draws
from inference.posterior.answer.error_parts import ErrorParts, ParameterErrorParts
from inference.posterior.answer.fit import Fit
from inference.posterior.answer.inference_data import inference_data
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.selection.selection import SelectionSummary

__all__ = [
    "RANGE_COLUMNS",
    "JointMode",
    "LeftOutTerm",
    "ParameterMode",
    "ParameterSummary",
    "Posterior",
    "RangeMode",
    "RangeSummary",
    "Runtime",
]

Array = NDArray[np.float64]


def _plain(value: Any) -> Any:
    """Turn a value into plain JSON: nothing non-finite, no numpy types."""
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, np.ndarray):
        return [_plain(item) for item in value.tolist()]
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return value


@dataclasses.dataclass(frozen=True)
class ParameterSummary:
    """One parameter, in SI units; without numbers where nothing was drawn.

    Attributes
    ----------
    mean, sd : float
        Of its draws; nan where they have several separate modes.
    sd_parts : ParameterErrorParts
        What ``sd`` is made of; nan with it.
    q05, q50, q95 : float
        Quantiles of its draws, whatever their modes.
    ess_bulk, ess_tail : float
        Effective sample sizes of the mean, and the lesser one of the shares below the quantiles of
        5 and 95 %; with importance sampling by the weights of the draws.
    rhat : float or None
        None with importance sampling.
    mcse_mean : float
        Monte Carlo standard error of the mean; nan with the mean.
    modes : tuple of ParameterMode
        By ascending value.
    """

    mean: float
    sd: float
    sd_parts: ParameterErrorParts
    q05: float
    q50: float
    q95: float
    ess_bulk: float
    ess_tail: float
    rhat: float | None
    mcse_mean: float
    modes: tuple["ParameterMode", ...]


@dataclasses.dataclass(frozen=True)
class ParameterMode:
    """One of the separate modes of a parameter.

    Attributes
    ----------
    value, sd, q05, q95 : float
        Median, standard deviation and quantiles of the draws in this mode.
    weight : float
        Its share of the posterior.
    weight_error : float or None
        Standard error of the weight; None where no walker went from mode to mode.
    """

    value: float
    weight: float
    weight_error: float | None
    sd: float
    q05: float
    q95: float


@dataclasses.dataclass(frozen=True)
class RangeMode:
    """One of the separate modes of a range.

    Attributes
    ----------
    range_m, sd, q05, q95 : float
        Median, standard deviation and quantiles of the draws in this mode [m].
    weight : float
        Its share of the posterior.
    weight_error : float or None
        Standard error of the weight; None where no walker went from mode to mode.
    """

    range_m: float
    weight: float
    weight_error: float | None
    sd: float
    q05: float
    q95: float


@dataclasses.dataclass(frozen=True)
class JointMode:
    """One optimum of all parameters together.

    Attributes
    ----------
    parameters : dict of str to float
        In SI units.
    log_density : float
        Log posterior density there, in the prior's normal coordinates, ranges integrated out, up to
        a constant that the modes share.
    weight : float or None
        Share of the posterior nearer to this optimum than to any other; None where nothing was
        drawn yet.
    weight_error : float or None
        Standard error of the weight; None where no walker went from mode to mode.
    """

    parameters: dict[str, float]
    log_density: float
    weight: float | None
    weight_error: float | None


@dataclasses.dataclass(frozen=True, eq=False)
class RangeSummary:
    """Ranges of all frames [m]; nan where a frame holds no object, is saturated, or nothing drawn.

    Attributes
    ----------
    q05, q50, q95 : ndarray, shape (frames,)
        Quantiles of the draws, whatever their modes.
    mean, sd : ndarray, shape (frames,)
        Of the draws; nan where they have several separate modes.
    mcse_mean, mcse_q05, mcse_q50, mcse_q95 : ndarray, shape (frames,)
        Monte Carlo standard errors: by how much another seed would move what they are of.
    sd_parts : ErrorParts, shape (frames,)
        What ``sd`` is made of; nan with it.
    near_fold : ndarray of bool, shape (frames,)
        Whether noise like that of the frame makes two modes out of one, or one out of two.
    modes : tuple of tuple of RangeMode
        By ascending range, for every frame.
    """

    q05: Array
    q50: Array
    q95: Array
    mean: Array
    sd: Array
    mcse_mean: Array
    mcse_q05: Array
    mcse_q50: Array
    mcse_q95: Array
    sd_parts: ErrorParts
    near_fold: NDArray[np.bool_]
    modes: tuple[tuple[RangeMode, ...], ...]


# columns of numbers, nan where there is none
RANGE_COLUMNS = tuple(
    field.name
    for field in dataclasses.fields(RangeSummary)
    if field.name not in ("sd_parts", "near_fold", "modes")
)


@dataclasses.dataclass(frozen=True)
class LeftOutTerm:
    """A term that is in no model of this scene, and why."""

    term: str
    reason: str


@dataclasses.dataclass(frozen=True)
class Runtime:
    """What the answer cost.

    Attributes
    ----------
    wall_s, cpu_s : float
        Time, and processor time without that of compiling [s]; of `infer` and the service with what
        making the answer took.
    likelihood_calls : int
        Evaluations of the likelihood.
    k_hat : float or None
        Pareto k-hat of importance weights; None where there were none.
    """

    wall_s: float
    cpu_s: float
    likelihood_calls: int
    k_hat: float | None


@dataclasses.dataclass(frozen=True, eq=False)
class Posterior:
    """A posterior: summaries, verdict, ambiguity, identifiability, fit.

    Attributes
    ----------
    method : str
        "emcee" or "importance".
    seed : int
        The seed; the same seed gives the same draws.
    drawn : bool
        Whether anything was drawn, or nothing but ranges is unknown. Where not, there are no
        intervals, and `identifiability` is what is foreseen.
    modes : tuple of JointMode
        All optima that were found, numbered as in the verdict.
    selection : SelectionSummary, optional
        With optional terms in the scene: the models that were compared, and what was decided.
    assumptions : tuple of str
        What the answer supposes without a check, and what looks like a mistake
        (`inference.assumptions`).
    """

    method: str
    seed: int
    drawn: bool
    verdict: Verdict
    parameters: dict[str, ParameterSummary]
    modes: tuple[JointMode, ...]
    range_m: RangeSummary
    identifiability: tuple[Identifiability, ...]
    fit: Fit
    left_out: tuple[LeftOutTerm, ...]
    runtime: Runtime
    draws: Draws
    selection: SelectionSummary | None = None
    assumptions: tuple[str, ...] = ()

    def to_arviz(self) -> Any:
        """Return the draws for ArviZ: ``InferenceData``, from ArviZ 1 on an xarray ``DataTree``.

        Returns
        -------
        arviz.InferenceData or xarray.DataTree
            A chain for every walker, with the coordinates ``ensemble`` and ``walker``, so that its
            draws are steps in time; of weighted draws one chain, resampled by weight. Groups
            ``posterior`` (parameters, and ``range_m`` along ``frame``), ``sample_stats``,
            ``posterior_predictive`` (both readings drawn anew), ``log_likelihood``, at the steps
            that have ranges, and ``every_step`` with the parameters at all steps.

        Raises
        ------
        ModuleNotFoundError
            Without ArviZ.
        """
        return inference_data(self.draws, self.method, self.seed)

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON data (docs/http.md, posteriors); non-finite values become null."""
        document: dict[str, Any] = {
            "method": self.method,
            "seed": self.seed,
            "drawn": self.drawn,
            "verdict": dataclasses.asdict(self.verdict),
            "parameters": {k: dataclasses.asdict(v) for k, v in self.parameters.items()},
            "modes": [dataclasses.asdict(mode) for mode in self.modes],
            "range_m": {
                field.name: getattr(self.range_m, field.name)
                for field in dataclasses.fields(RangeSummary)
                if field.name not in ("modes", "sd_parts")
            },
            "identifiability": [dataclasses.asdict(row) for row in self.identifiability],
            "fit": dataclasses.asdict(self.fit),
            "left_out": [dataclasses.asdict(row) for row in self.left_out],
            "selection": None if self.selection is None else dataclasses.asdict(self.selection),
            "assumptions": self.assumptions,
            "runtime": dataclasses.asdict(self.runtime),
        }
        document["range_m"]["sd_parts"] = dataclasses.asdict(self.range_m.sd_parts)
        document["range_m"]["modes"] = [
            [dataclasses.asdict(mode) for mode in modes] for modes in self.range_m.modes
        ]
        plain: dict[str, Any] = _plain(document)
        return plain
