"""Candidate models: the scene with some of its optional terms, and how each is assessed."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.start import Optimum
from inference.posterior.selection.consequence import Reported, reported
from inference.posterior.selection.cross_validation import cross_validate
from inference.posterior.selection.evidence import weigh
from simulator.scene import Crosstalk, Scene

__all__ = ["Candidate", "assess", "candidate_terms", "reduced"]

Array = NDArray[np.float64]


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
    reported : Reported or None
        What it says of unknowns and ranges; None where no parameters explain the frames.
    """

    terms: tuple[str, ...]
    log_evidence: float
    log_evidence_error: float
    evidence_k_hat: float | None
    log_predictive: Array
    predictive_k_hat: float
    calls: int
    reported: Reported | None


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
    found: Sequence[Optimum] | None = None,
) -> Candidate:
    """Assess one candidate.

    Parameters
    ----------
    terms : tuple of str
        Which optional terms it keeps.
    density : CollapsedDensity
        Of the scene that `reduced` makes with them.
    found : sequence of Optimum or None
        Maxima of the density; None: they are looked for.
    """
    weighed = weigh(density, rng, found)
    predicted, calls = cross_validate(density, weighed, rng)
    return Candidate(
        terms,
        weighed.evidence.log_evidence,
        weighed.evidence.error,
        weighed.evidence.k_hat,
        predicted.log_predictive,
        predicted.worst_k_hat,
        weighed.calls + calls,
        reported(density, weighed, rng),
    )
