"""The answer: what is known of every parameter and every range, and whether to believe it."""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.status import Identifiability
from inference.posterior.selection import SelectionSummary
from inference.posterior.verdict import Verdict

__all__ = [
    "Draws",
    "Fit",
    "LeftOutTerm",
    "Mode",
    "ParameterSummary",
    "Posterior",
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
    """One parameter, in SI units.

    Attributes
    ----------
    mean, sd, q05, q50, q95 : float
        Of its draws.
    ess_bulk, ess_tail : float
        Effective sample sizes; importance sample sizes with importance sampling.
    rhat : float or None
        None with importance sampling.
    mcse_mean : float
        Monte Carlo standard error of the mean.
    """

    mean: float
    sd: float
    q05: float
    q50: float
    q95: float
    ess_bulk: float
    ess_tail: float
    rhat: float | None
    mcse_mean: float


@dataclasses.dataclass(frozen=True)
class Mode:
    """One mode of a range."""

    range_m: float
    weight: float


@dataclasses.dataclass(frozen=True, eq=False)
class RangeSummary:
    """Ranges of all frames [m]; nan where a frame holds no object or is saturated.

    Attributes
    ----------
    q05, q50, q95, mean, sd : ndarray, shape (frames,)
        Of the draws.
    modes : tuple of tuple of Mode
        By ascending range, for every frame.
    """

    q05: Array
    q50: Array
    q95: Array
    mean: Array
    sd: Array
    modes: tuple[tuple[Mode, ...], ...]


@dataclasses.dataclass(frozen=True)
class Fit:
    """Posterior predictive check: is the model able to make such readings at all."""

    p_value: float
    misfit: bool


@dataclasses.dataclass(frozen=True)
class LeftOutTerm:
    """A term that is in no model of this scene, and why."""

    term: str
    reason: str


@dataclasses.dataclass(frozen=True)
class Runtime:
    """What the answer cost."""

    wall_s: float
    cpu_s: float
    likelihood_calls: int
    k_hat: float | None


@dataclasses.dataclass(frozen=True, eq=False)
class Draws:
    """Draws behind the summary.

    Attributes
    ----------
    names : tuple of str
        Parameters.
    parameters : ndarray, shape (ensembles, walkers, steps, d)
        In SI units; with importance sampling one ensemble of one walker, resampled by weight.
    log_density : ndarray, shape (ensembles, walkers, steps)
        Collapsed log density.
    range_m : ndarray, shape (m, frames)
        Draws of the ranges [m] for an even subset of the parameter draws.
    """

    names: tuple[str, ...]
    parameters: Array
    log_density: Array
    range_m: Array


@dataclasses.dataclass(frozen=True, eq=False)
class Posterior:
    """A posterior: summaries, verdict, ambiguity, identifiability, fit.

    Attributes
    ----------
    method : str
        "emcee" or "importance".
    seed : int
        The seed; the same seed gives the same draws.
    selection : SelectionSummary, optional
        With optional terms in the scene: the models that were compared, and what was decided.
    """

    method: str
    seed: int
    verdict: Verdict
    parameters: dict[str, ParameterSummary]
    range_m: RangeSummary
    identifiability: tuple[Identifiability, ...]
    fit: Fit
    left_out: tuple[LeftOutTerm, ...]
    runtime: Runtime
    draws: Draws
    selection: SelectionSummary | None = None

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON data in the shape of the contract; non-finite values become null."""
        document: dict[str, Any] = {
            "method": self.method,
            "seed": self.seed,
            "verdict": dataclasses.asdict(self.verdict),
            "parameters": {k: dataclasses.asdict(v) for k, v in self.parameters.items()},
            "range_m": {
                field.name: getattr(self.range_m, field.name)
                for field in dataclasses.fields(RangeSummary)
                if field.name != "modes"
            },
            "identifiability": [dataclasses.asdict(row) for row in self.identifiability],
            "fit": dataclasses.asdict(self.fit),
            "left_out": [dataclasses.asdict(row) for row in self.left_out],
            "selection": None if self.selection is None else dataclasses.asdict(self.selection),
            "runtime": dataclasses.asdict(self.runtime),
        }
        document["range_m"]["modes"] = [
            [dataclasses.asdict(mode) for mode in modes] for modes in self.range_m.modes
        ]
        plain: dict[str, Any] = _plain(document)
        return plain
