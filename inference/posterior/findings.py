"""What an answer says of unknowns, ranges and model, whether or not anything was drawn."""

import dataclasses

from inference.identifiability.status import Identifiability
from inference.posterior.answer.fit import Fit
from inference.posterior.answer.posterior import ParameterSummary, RangeSummary

__all__ = ["Findings"]


@dataclasses.dataclass(frozen=True, eq=False)
class Findings:
    """Parts of an answer.

    Attributes
    ----------
    reasons : tuple of str
        Why not to believe the draws.
    k_hat : float or None
        Pareto shape of the importance weights that were looked at; None where there were none.
    parameters : dict of str to ParameterSummary
        By scene path.
    range_m : RangeSummary
        Of all frames.
    identifiability : tuple of Identifiability
        A row for every unknown and one for "range_m".
    fit : Fit
        Of the model.
    """

    reasons: tuple[str, ...]
    k_hat: float | None
    parameters: dict[str, ParameterSummary]
    range_m: RangeSummary
    identifiability: tuple[Identifiability, ...]
    fit: Fit
