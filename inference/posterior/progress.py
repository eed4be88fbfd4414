"""How far a posterior is."""

import dataclasses
from typing import Literal

__all__ = ["Phase", "Progress"]

Phase = Literal["starting", "tempering", "sampling", "summarising"]


@dataclasses.dataclass(frozen=True)
class Progress:
    """How far a job is.

    Attributes
    ----------
    phase : str
        What is being done.
    steps : int
        Steps of each ensemble.
    target : int or None
        How many may be needed; None where that cannot be told yet.
    ess, rhat : float or None
        Least effective sample size and largest R-hat.
    finished : bool
        Whether only the summary is left.
    eta_s : float or None
        Seconds until the target, which whoever holds a clock adds (`inference.posterior.pace`);
        None where unknown.
    """

    phase: Phase
    steps: int
    target: int | None
    ess: float | None
    rhat: float | None
    finished: bool
    eta_s: float | None = None
