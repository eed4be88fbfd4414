"""Whether frames determine what is unknown, told after the fit with the reason and the remedy."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.fits.answer.counts import ranges_needed
from inference.fits.answer.motion_seen import numbers_shown
from inference.fits.answer.ranges import WITHIN
from inference.fits.answer.report import describe
from inference.fits.likelihood.arguments import CROSSTALK
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.maximum import DECIDED, Maximum
from inference.fits.likelihood.problem import FitProblem
from inference.frame.sensitivity import Value
from inference.identifiability.information import Information
from simulator.errors import RefusedError, listed

__all__ = [
    "LIMIT",
    "LeftOpenError",
    "noise_may_be_followed",
    "off_the_top",
    "refuse_if_noise_was_followed",
    "refuse_if_open",
    "refuse_if_undetermined",
    "tells_nothing",
]


class LeftOpenError(RefusedError):
    """Frames alone leave open how large the ranges are; what is known of the scene may tell it."""


_SEEN_WITHOUT_OBJECT = (*CROSSTALK, Value.STRENGTH, Value.DISTANCE)

_SHOWN = {
    1.0: "the object does not move: all frames read the same but for noise",
    2.0: "the object moves too little for this noise: all frames read along a straight line",
}

_WIDEST = 1.0  # variance of log r beyond which a frame tells nothing of its range
_REMAINING = 1.0  # chi-square that a step may still gain: a standard deviation, and it widens all
# relative standard deviation of the ranges that the unknowns share out: a factor of e. Intervals
# are as wide as the likelihood, honest however wide they are; beyond it nothing is told
LIMIT = 1.0


def _other_frames(problem: FitProblem) -> str:
    """Say which other frames would tell more: empty ones, where there are none and they tell."""
    told = problem.present.all() and np.isin(problem.slots, _SEEN_WITHOUT_OBJECT).any()
    empty = ", add frames of the empty scene (object_present false)" if told else ""
    return f"move the object nearer and farther{empty}"


def _remedy(problem: FitProblem, numbers: int) -> str:
    """Say what would help where so many numbers are missing."""
    count = "one" if numbers == 1 else str(numbers)
    return f"{_other_frames(problem)}, or state {count} of them as known"


def _less_noise(problem: FitProblem) -> str:
    """Say what would help where noise hides what is unknown."""
    return (
        f"{_other_frames(problem)}, lower the noise, state a number as known, or use a posterior "
        "with priors"
    )


def off_the_top(top: Maximum, unlike: bool = False) -> float:
    """Return how many standard deviations an end point of the search is off its optimum.

    Parameters
    ----------
    top : Maximum
        The best end point.
    unlike : bool
        Whether the readings are unlike the model whatever a last step gains.

    Raises
    ------
    RefusedError
        Where the search ended so far below the top that what is left says nothing of it: a
        LeftOpenError unless ``unlike``, which no prior of the scene mends.
    """
    if not top.remaining <= _REMAINING:
        kind = RefusedError if unlike else LeftOpenError
        raise kind(
            "the search stopped before the best values were reached (a step would still take "
            f"{top.remaining:.2g} off chi-square); state a number as known, or use a posterior"
        )
    return math.sqrt(max(top.remaining, 0.0))


def refuse_if_undetermined(problem: FitProblem, top: Maximum, facts: Information) -> None:
    """Refuse where frames tell fewer numbers than are unknown.

    Raises
    ------
    RefusedError
        Where the Jacobian has not full rank, or the readings do not show enough motion.
    """
    shown = numbers_shown(problem, top)
    present = problem.present & np.isfinite(top.positions)
    # an unknown that no reading and no range depends on is nothing that the ranges need
    told = np.isfinite(facts.sd_of(facts.response[present])).all()
    if facts.rank < len(problem) and not told:
        weights = np.abs(facts.null_space).max(axis=1)
        names = [name for name, w in zip(problem.names, weights, strict=True) if w > 0.05]
        cause = _SHOWN.get(shown, "the frames do not tell them apart")
        raise RefusedError(
            f"{listed(names or list(problem.names))} cannot be determined (rank {facts.rank} of "
            f"{len(problem)}): {cause}; {_remedy(problem, len(problem) - facts.rank)}"
        )
    kind = "pulsed" if problem.instrument.wave is None else "sine_wave"
    needed = ranges_needed(kind, problem.names, not problem.present.all())
    if shown == 1.0 and shown < needed:
        raise RefusedError(
            f"{listed(list(problem.names))} cannot be determined: {_SHOWN[shown]}, and that tells "
            f"one of the {needed} numbers that are missing; {_remedy(problem, needed - 1)}"
        )


def _integrated(problem: FitProblem, point: Maximum) -> float:
    """Return -2 log of the likelihood with every range integrated out, to first order."""
    present = problem.present & np.isfinite(point.positions)
    _, facts = residuals_and_information(problem, point.x, point.positions)
    own = np.minimum(facts.own_variance[present], _WIDEST)
    return point.deviance - float(np.log(own).sum())


def noise_may_be_followed(problem: FitProblem, top: Maximum) -> bool:
    """Tell whether the readings lie along a line within their noise, or at a point."""
    return math.isfinite(numbers_shown(problem, top))


def refuse_if_noise_was_followed(
    problem: FitProblem, top: Maximum, points: Sequence[Maximum]
) -> None:
    """Refuse an optimum that is one only because every frame has a range of its own.

    To be asked where `noise_may_be_followed`: where the readings lie along a line within their
    noise, an object with a pole among the ranges lets each frame follow its own noise. It explains
    them better than the truth does, and is sure of itself. With the ranges integrated out it is
    worse than other values by far.

    Parameters
    ----------
    points : sequence of Maximum
        Other values (`profile_scan`).

    Raises
    ------
    RefusedError
        Where other values are better by 3 standard deviations once the ranges are integrated out.
    """
    best = min((_integrated(problem, point) for point in points), default=math.inf)
    if best < _integrated(problem, top) - DECIDED:
        raise RefusedError(
            f"{listed(list(problem.names))} cannot be determined: {_SHOWN[2.0]}, and the best "
            f"values follow the noise of each frame; {_less_noise(problem)}"
        )


def refuse_if_open(
    problem: FitProblem,
    top: Maximum,
    facts: Information,
    wider: float,
    others: Sequence[tuple[float, Maximum]] = (),
    whole: Information | None = None,
) -> None:
    """Refuse what the frames determine too badly.

    Parameters
    ----------
    wider : float
        Factor on all standard deviations (`inflation`).
    others : sequence of (float, Maximum)
        Optima that are nearly as good, with their deviance above the best.
    whole : Information, optional
        What is told if the errors of the model are unknown; left out: it has none.

    Raises
    ------
    LeftOpenError
        Where the ranges share a relative standard deviation above `LIMIT`, there or at another
        optimum as far as the intervals of 95 % reach.
    """
    present = problem.present & np.isfinite(top.positions)
    shared = facts.sd_of(facts.response[present])
    of_noise = wider * float(np.median(shared)) if shared.size else math.inf
    typical = of_noise
    if whole is not None and shared.size:
        all_errors = whole.sd_of(whole.response[present], whole.error_response[present])
        typical = max(wider * float(np.median(all_errors)), of_noise)
    if not typical <= LIMIT:
        open_ones = [
            name
            for name, item in describe(problem, top, facts, wider, whole=whole).items()
            if item["status"] != "identified"
        ]
        if of_noise <= LIMIT:
            raise LeftOpenError(
                f"errors of the model (discrepancy) leave the ranges a common relative standard "
                f"deviation of {typical:.2g}, more than {LIMIT:g}: "
                f"{listed(open_ones or list(problem.names))} are too uncertain; state a number as "
                "known, a smaller discrepancy if the object is nearer to the model, or use a "
                "posterior with priors"
            )
        raise LeftOpenError(
            f"the ranges would have a common relative standard deviation of {typical:.2g}, more "
            f"than {LIMIT:g}: {listed(open_ones or list(problem.names))} are too uncertain; "
            f"{_less_noise(problem)}"
        )
    for excess, other in others:
        if not excess < WITHIN:
            continue
        _, there = residuals_and_information(problem, other.x, other.positions)
        shared = there.sd_of(there.response[problem.present & np.isfinite(other.positions)])
        typical = float(np.median(shared)) * math.sqrt(1.0 - excess / WITHIN)
        if not typical <= LIMIT:
            raise LeftOpenError(
                f"other values of the unknowns explain the frames nearly as well (chi-square "
                f"{excess:.2g} higher), and with them the ranges would have a common relative "
                f"standard deviation of {typical:.2g}, more than {LIMIT:g}; {_less_noise(problem)}"
            )


def tells_nothing(answer: TechniqueResult, state: NDArray[np.uint8]) -> bool:
    """Tell whether an answer leaves most ranges more open than by a factor of e.

    Parameters
    ----------
    answer : TechniqueResult
        Of a fit; one that says misfit tells that.
    state : ndarray of uint8, shape (n,)
        What rules frames out, 0 where nothing does.
    """
    if answer.fit is None or answer.fit["misfit"]:
        return False
    spread = (answer.sd_m / answer.range_m)[state == 0]
    return not np.median(np.where(np.isfinite(spread), spread, np.inf)) <= LIMIT
