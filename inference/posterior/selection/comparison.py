"""What one candidate gains over another, by its evidence and by its predictive density."""

import dataclasses
import math

import numpy as np

from inference.posterior.selection.leave_one_out import MAX_K_HAT, standard_error
from inference.posterior.selection.models import Candidate

__all__ = ["EVIDENCE_MARGIN", "PREDICTIVE_MARGIN", "Comparison", "compare"]

# the odds that count as strong (Kass and Raftery 1995): with even odds beforehand and the term
# absent, evidence this strong for it has a probability of 1/20 at most, whatever the model
EVIDENCE_MARGIN = math.log(20.0)
# what k superfluous parameters gain is about chi-square(k) / 2 - k (Stone 1977): more than 4 nats
# with a probability of 0.3 % for any k up to 6
PREDICTIVE_MARGIN = 4.0


@dataclasses.dataclass(frozen=True)
class Comparison:
    """What a larger candidate gains over a smaller one.

    Attributes
    ----------
    evidence, evidence_error : float
        Gain in log evidence and its standard error [nat].
    predictive, predictive_error : float
        Gain in cross-validated log predictive density and its standard error [nat].
    predictive_trusted : bool
        Whether the importance weights behind the latter can be trusted.
    """

    evidence: float
    evidence_error: float
    predictive: float
    predictive_error: float
    predictive_trusted: bool

    @property
    def by_evidence(self) -> bool:
        """Whether its evidence demands the larger one."""
        # where the evidence is not known well enough to leave the term out, it stays
        return not self.evidence + 2.0 * self.evidence_error < EVIDENCE_MARGIN

    @property
    def by_prediction(self) -> bool:
        """Whether its predictive density demands the larger one."""
        return self.predictive_trusted and not self.predictive < PREDICTIVE_MARGIN

    @property
    def words(self) -> str:
        """The gains in words."""
        if not math.isfinite(self.evidence):
            with_or_not = "without" if self.evidence > 0 else "with"
            return f"{with_or_not} it no parameters within their priors explain the frames"
        spread = "" if math.isnan(self.predictive_error) else f" +- {self.predictive_error:.1f}"
        text = (
            f"with it the log evidence changes by {self.evidence:+.1f} +- {self.evidence_error:.1f}"
            f" (demanded above {EVIDENCE_MARGIN:.1f})"
        )
        if not math.isfinite(self.predictive):
            return text + ", and the cross-validated log predictive density is not known"
        text += (
            f" and the cross-validated log predictive "
            f"density by {self.predictive:+.1f}{spread} (demanded above {PREDICTIVE_MARGIN:.0f})"
        )
        if not self.predictive_trusted:
            text += f"; the latter is not trusted, since a frame's k-hat is above {MAX_K_HAT}"
        return text


def compare(larger: Candidate, smaller: Candidate) -> Comparison:
    """Compare two candidates.

    Parameters
    ----------
    larger, smaller : Candidate
        With more and with fewer terms.
    """
    if not math.isfinite(smaller.log_evidence):
        # without the term no parameters explain the frames; without both nothing is demanded
        gain = 0.0 if not math.isfinite(larger.log_evidence) else math.inf
        return Comparison(gain, 0.0, gain, 0.0, True)
    if not math.isfinite(larger.log_evidence):
        return Comparison(-math.inf, 0.0, -math.inf, 0.0, True)
    with np.errstate(invalid="ignore"):
        gains = larger.log_predictive - smaller.log_predictive
    total = float(gains.sum())
    # draws that miss where a frame's weights are large make its density look too large: a gain
    # over such a model is a lower bound, a gain of such a model an upper one
    doubtful = larger if total > PREDICTIVE_MARGIN else smaller
    return Comparison(
        larger.log_evidence - smaller.log_evidence,
        math.hypot(larger.log_evidence_error, smaller.log_evidence_error),
        total,
        standard_error(gains),
        bool(doubtful.predictive_k_hat < MAX_K_HAT and math.isfinite(total)),
    )
