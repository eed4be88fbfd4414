"""Optional terms: which of them the data demand.

Every combination of kept and left-out terms is a candidate model. Two criteria judge it: its
evidence, and the cross-validated log predictive density of the frames. The evidence alone would
leave a real term out for the width of its prior (Lindley 1957), the predictive density alone
ignores what the prior says of the term; a term is left out only where neither demands it.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.start import Optimum
from inference.posterior.selection.cross_validation import cross_validate
from inference.posterior.selection.evidence import weigh
from inference.posterior.selection.leave_one_out import MAX_K_HAT, standard_error
from simulator.scene import Crosstalk, Scene

__all__ = [
    "EVIDENCE_MARGIN",
    "PREDICTIVE_MARGIN",
    "Candidate",
    "CandidateSummary",
    "Decision",
    "Selection",
    "SelectionSummary",
    "assess",
    "candidate_terms",
    "decide",
    "reduced",
    "selection_summary",
]

Array = NDArray[np.float64]

# the odds that count as strong (Kass and Raftery 1995): with even odds beforehand and the term
# absent, evidence this strong for it has a probability of 1/20 at most, whatever the model
EVIDENCE_MARGIN = math.log(20.0)
# what k superfluous parameters gain is about chi-square(k) / 2 - k (Stone 1977): more than 4 nats
# with a probability of 0.3 % for any k up to 6
PREDICTIVE_MARGIN = 4.0


@dataclasses.dataclass(frozen=True, eq=False)
class Candidate:
    """A model with some of the optional terms, assessed.

    Attributes
    ----------
    terms : tuple of str
        Optional terms that it keeps.
    log_evidence, log_evidence_error : float
        Log evidence [nat] and its standard error.
    evidence_k_hat : float or None
        Of the importance weights behind the evidence; None with bridge sampling.
    log_predictive : ndarray, shape (usable frames,)
        log p(y_j | the other frames).
    predictive_k_hat : float
        The largest Pareto shape of all frames.
    calls : int
        Density evaluations.
    """

    terms: tuple[str, ...]
    log_evidence: float
    log_evidence_error: float
    evidence_k_hat: float | None
    log_predictive: Array
    predictive_k_hat: float
    calls: int


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
        In the order of `candidate_terms`, as far as they have been assessed.
    decisions : tuple of Decision
        One for each optional term; empty until all candidates have been assessed.
    """

    candidates: tuple[Candidate, ...]
    decisions: tuple[Decision, ...]

    @property
    def decided(self) -> bool:
        """Whether there is a choice."""
        return bool(self.decisions)

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


def candidate_terms(scene: Scene) -> tuple[tuple[str, ...], ...]:
    """Return the combinations of optional terms, the simplest first.

    Parameters
    ----------
    scene : Scene
        With at most two optional terms.
    """
    terms = scene.optional_terms
    singles = tuple((term,) for term in terms)
    return ((), *singles, terms) if len(terms) > 1 else ((), *singles)


def reduced(scene: Scene, terms: Sequence[str]) -> Scene:
    """Return the scene with some of its optional terms, and without the others.

    Parameters
    ----------
    scene : Scene
        A scene.
    terms : sequence of str
        Optional terms that stay; they are not optional any more.

    Returns
    -------
    Scene
        Equal to the one that states only what stays.
    """
    changes: dict[str, object] = {}
    if isinstance(scene.crosstalk, Crosstalk) and scene.crosstalk.optional:
        changes["crosstalk"] = scene.crosstalk.values if "crosstalk" in terms else None
    if scene.background is not None and scene.background.optional:
        kept = scene.background.model_copy(update={"optional": False})
        changes["background"] = kept if "background" in terms else None
    return scene.model_copy(update=changes)


def assess(
    terms: tuple[str, ...],
    density: CollapsedDensity,
    rng: np.random.Generator,
    fitted: Sequence[Optimum] = (),
) -> Candidate:
    """Assess one candidate.

    Parameters
    ----------
    terms : tuple of str
        Which optional terms it keeps.
    density : CollapsedDensity
        Of the scene that `reduced` makes with them.
    rng : numpy.random.Generator
        Source of randomness.
    fitted : sequence of Optimum
        Maxima of the density that are known beforehand.

    Returns
    -------
    Candidate
    """
    weighed = weigh(density, rng, fitted)
    predicted, calls = cross_validate(density, weighed, rng)
    return Candidate(
        terms,
        weighed.evidence.log_evidence,
        weighed.evidence.error,
        weighed.evidence.k_hat,
        predicted.log_predictive,
        predicted.worst_k_hat,
        weighed.calls + calls,
    )


@dataclasses.dataclass(frozen=True)
class _Comparison:
    """What a larger candidate gains over a smaller one [nat]."""

    evidence: float
    evidence_error: float
    predictive: float
    predictive_error: float
    predictive_trusted: bool

    @property
    def by_evidence(self) -> bool:
        # where the evidence is not known well enough to leave the term out, it stays
        return not self.evidence + 2.0 * self.evidence_error < EVIDENCE_MARGIN

    @property
    def by_prediction(self) -> bool:
        return self.predictive_trusted and not self.predictive < PREDICTIVE_MARGIN

    @property
    def words(self) -> str:
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


def _compare(larger: Candidate, smaller: Candidate) -> _Comparison:
    if not math.isfinite(smaller.log_evidence):
        # without the term no parameters explain the frames; without both nothing is demanded
        gain = 0.0 if not math.isfinite(larger.log_evidence) else math.inf
        return _Comparison(gain, 0.0, gain, 0.0, True)
    if not math.isfinite(larger.log_evidence):
        return _Comparison(-math.inf, 0.0, -math.inf, 0.0, True)
    with np.errstate(invalid="ignore"):
        gains = larger.log_predictive - smaller.log_predictive
    total = float(gains.sum())
    # draws that miss where a frame's weights are large make its density look too large: a gain
    # over such a model is a lower bound, a gain of such a model an upper one
    doubtful = larger if total > PREDICTIVE_MARGIN else smaller
    return _Comparison(
        larger.log_evidence - smaller.log_evidence,
        math.hypot(larger.log_evidence_error, smaller.log_evidence_error),
        total,
        standard_error(gains),
        bool(doubtful.predictive_k_hat < MAX_K_HAT and math.isfinite(total)),
    )


def _acceptable(candidate: Candidate, candidates: Sequence[Candidate]) -> bool:
    """Tell whether no model with more terms is demanded by either criterion."""
    for other in candidates:
        if set(other.terms) > set(candidate.terms):
            gain = _compare(other, candidate)
            if gain.by_evidence or gain.by_prediction:
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
    gain = _compare(first, second)
    clear = gain.evidence - 2.0 * gain.evidence_error > EVIDENCE_MARGIN
    if clear and not (gain.predictive_trusted and gain.predictive < 0.0):
        return first
    return max(candidates, key=lambda candidate: len(candidate.terms))


def decide(scene: Scene, candidates: Sequence[Candidate]) -> tuple[Decision, ...]:
    """Decide which optional terms stay.

    The simplest candidate is chosen over which no larger one is demanded. A larger one is demanded
    by its evidence, above `EVIDENCE_MARGIN` within two standard errors, or by its predictive
    density, above `PREDICTIVE_MARGIN`. Where crosstalk alone and a background alone would both do,
    and the data do not tell them apart, both stay.

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
        pair = (chosen, by_terms[flipped]) if kept else (by_terms[flipped], chosen)
        gain = _compare(*pair)
        agree = gain.predictive_trusted and gain.by_evidence == gain.by_prediction == kept
        decisions.append(Decision(term, kept, agree, _reason(kept, gain)))
    return tuple(decisions)


def _reason(kept: bool, gain: _Comparison) -> str:
    if not kept:
        return f"the data do not demand it: {gain.words}"
    if gain.by_evidence and gain.by_prediction:
        return f"the data demand it: {gain.words}"
    if gain.by_evidence or gain.by_prediction:
        one = "evidence" if gain.by_evidence else "predictive density"
        other = "the other criterion does not: the wider answer is the safer one"
        if not gain.predictive_trusted:
            other = "the predictive density cannot be known"
        return f"kept because the {one} demands it, though {other}; {gain.words}"
    return f"kept because the data demand one of the terms and do not tell which: {gain.words}"


def _undecided(scene: Scene) -> tuple[Decision, ...]:
    """Return what holds where there was no time to decide: every optional term stays."""
    reason = "kept: there was no time to decide whether the data demand it"
    return tuple(Decision(term, True, False, reason) for term in scene.optional_terms)


def selection_summary(scene: Scene, selection: Selection) -> SelectionSummary:
    """Summarise a selection.

    Parameters
    ----------
    scene : Scene
        With its optional terms.
    selection : Selection
        Decided or not.

    Returns
    -------
    SelectionSummary
    """
    decisions = selection.decisions or _undecided(scene)
    chosen = tuple(decision.term for decision in decisions if decision.kept)
    rows = []
    for candidate in selection.candidates:
        with np.errstate(invalid="ignore"):
            error = standard_error(candidate.log_predictive)
        rows.append(
            CandidateSummary(
                candidate.terms,
                candidate.terms == chosen,
                candidate.log_evidence,
                candidate.log_evidence_error,
                candidate.evidence_k_hat,
                float(candidate.log_predictive.sum()),
                error,
                candidate.predictive_k_hat,
            )
        )
    return SelectionSummary(tuple(rows), decisions)
