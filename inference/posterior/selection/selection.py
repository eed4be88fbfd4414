"""Optional terms: which of them the data demand.

Every combination of kept and left-out terms is a candidate model. Two criteria judge it: its
evidence, and the cross-validated log predictive density of the frames. The evidence alone would
leave a real term out for the width of its prior (Lindley 1957), the predictive density alone
ignores what the prior says of the term. A term is left out only where neither demands it, and where
leaving it out changes nothing that is reported: what neither demands may still be there, and be
felt at the far end of the ranges.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from inference.posterior.selection.comparison import EVIDENCE_MARGIN, Comparison, compare
from inference.posterior.selection.consequence import Consequence, consequence
from inference.posterior.selection.leave_one_out import standard_error
from inference.posterior.selection.models import Candidate
from simulator.scene import Scene

__all__ = [
    "CandidateSummary",
    "Decision",
    "Selection",
    "SelectionSummary",
    "decide",
    "selection_summary",
]


@dataclasses.dataclass(frozen=True)
class Decision:
    """Whether one optional term stays.

    Attributes
    ----------
    term : str
        Its name.
    kept : bool
        Whether it stays.
    agree : bool
        Whether both criteria say so.
    reason : str
        With the numbers.
    """

    term: str
    kept: bool
    agree: bool
    reason: str


@dataclasses.dataclass(frozen=True, eq=False)
class Selection:
    """The candidates of a scene, and which was chosen.

    Attributes
    ----------
    candidates : tuple of Candidate
        In the order of `candidate_terms`.
    decisions : tuple of Decision
        One for each optional term.
    """

    candidates: tuple[Candidate, ...]
    decisions: tuple[Decision, ...]

    @property
    def chosen(self) -> tuple[str, ...]:
        """Optional terms that stay."""
        return tuple(decision.term for decision in self.decisions if decision.kept)


@dataclasses.dataclass(frozen=True)
class CandidateSummary:
    """A candidate as the answer shows it: log evidence and log predictive density [nat]."""

    terms: tuple[str, ...]
    chosen: bool
    log_evidence: float
    log_evidence_error: float
    evidence_k_hat: float | None
    log_predictive: float
    log_predictive_error: float
    predictive_k_hat: float


@dataclasses.dataclass(frozen=True)
class SelectionSummary:
    """The selection as the answer shows it."""

    candidates: tuple[CandidateSummary, ...]
    decisions: tuple[Decision, ...]


def _acceptable(candidate: Candidate, candidates: Sequence[Candidate]) -> bool:
    """Tell whether no model with more terms is demanded, or says something else."""
    for other in candidates:
        if set(other.terms) > set(candidate.terms):
            gain = compare(other, candidate)
            change = consequence(other.reported, candidate.reported)
            if gain.by_evidence or gain.by_prediction:
                return False
            if change is not None and not change.harmless:
                return False
    return True


def _choose(candidates: Sequence[Candidate]) -> Candidate:
    """Return the simplest acceptable candidate; the largest where equals cannot be told apart."""
    able = [candidate for candidate in candidates if _acceptable(candidate, candidates)]
    fewest = min(len(candidate.terms) for candidate in able)
    equals = [candidate for candidate in able if len(candidate.terms) == fewest]
    if len(equals) == 1:
        return equals[0]
    first, second = sorted(equals, key=lambda candidate: -candidate.log_evidence)
    gain = compare(first, second)
    clear = gain.evidence - 2.0 * gain.evidence_error > EVIDENCE_MARGIN
    if clear and not (gain.predictive_trusted and gain.predictive < 0.0):
        return first
    return max(candidates, key=lambda candidate: len(candidate.terms))


def decide(scene: Scene, candidates: Sequence[Candidate]) -> tuple[Decision, ...]:
    """Decide which optional terms stay.

    The simplest candidate is chosen over which no larger one is demanded, and that no larger one
    contradicts. A larger one is demanded by its evidence, above `EVIDENCE_MARGIN` within two
    standard errors, or by its predictive density, above `PREDICTIVE_MARGIN`; it contradicts where
    a mean or an interval is another one (`consequence`). Where crosstalk alone and a background
    alone would both do, and the data do not tell them apart, both stay.

    Parameters
    ----------
    scene : Scene
        With optional terms.
    candidates : sequence of Candidate
        All that `candidate_terms` names, in its order.

    Returns
    -------
    tuple of Decision
        One for each optional term.
    """
    chosen = _choose(candidates)
    by_terms = {candidate.terms: candidate for candidate in candidates}
    decisions = []
    for term in scene.optional_terms:
        kept = term in chosen.terms
        flipped = tuple(
            other for other in scene.optional_terms if (other in chosen.terms) != (other == term)
        )
        larger, smaller = (chosen, by_terms[flipped]) if kept else (by_terms[flipped], chosen)
        gain = compare(larger, smaller)
        change = consequence(larger.reported, smaller.reported)
        agree = gain.predictive_trusted and gain.by_evidence == gain.by_prediction == kept
        decisions.append(Decision(term, kept, agree, _reason(kept, gain, change)))
    return tuple(decisions)


def _reason(kept: bool, gain: Comparison, change: Consequence | None) -> str:
    if not kept:
        nothing = (
            "" if change is None else f", and nothing changes that is reported: {change.words}"
        )
        return f"the data do not demand it{nothing}; {gain.words}"
    if gain.by_evidence and gain.by_prediction:
        return f"the data demand it: {gain.words}"
    if gain.by_evidence or gain.by_prediction:
        one = "evidence" if gain.by_evidence else "predictive density"
        other = "the other criterion does not: the wider answer is the safer one"
        if not gain.predictive_trusted:
            other = "the predictive density cannot be known"
        return f"kept because the {one} demands it, though {other}; {gain.words}"
    if change is not None and not change.harmless:
        return f"kept because the answer hangs on it: {change.words}; {gain.words}"
    return f"kept because the data demand one of the terms and do not tell which: {gain.words}"


def _undecided(scene: Scene) -> tuple[Decision, ...]:
    """Return what holds where there was no time to decide: every optional term stays."""
    reason = "kept: there was no time to decide whether the data demand it"
    return tuple(Decision(term, True, False, reason) for term in scene.optional_terms)


def selection_summary(scene: Scene, selection: Selection | None) -> SelectionSummary | None:
    """Summarise a selection.

    Parameters
    ----------
    scene : Scene
        As stated.
    selection : Selection or None
        None where there was no time to decide.

    Returns
    -------
    SelectionSummary or None
        None where the scene has no optional terms.
    """
    if not scene.optional_terms:
        return None
    if selection is None:
        return SelectionSummary((), _undecided(scene))
    rows = []
    for candidate in selection.candidates:
        with np.errstate(invalid="ignore"):
            error = standard_error(candidate.log_predictive)
        rows.append(
            CandidateSummary(
                candidate.terms,
                candidate.terms == selection.chosen,
                candidate.log_evidence,
                candidate.log_evidence_error,
                candidate.evidence_k_hat,
                float(candidate.log_predictive.sum()),
                error,
                candidate.predictive_k_hat,
            )
        )
    return SelectionSummary(tuple(rows), selection.decisions)
