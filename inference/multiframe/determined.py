"""Whether frames determine what is unknown, told after the fit with the reason and the remedy."""

import math
from collections.abc import Sequence

import numpy as np
from scipy import special

from inference.identifiability.information import Information
from inference.multiframe.information import residuals_and_information
from inference.multiframe.multistart import Optimum
from inference.multiframe.problem import FitProblem
from inference.multiframe.ranges import WITHIN
from inference.multiframe.report import FALSE_ALARM, describe
from simulator.errors import RefusedError, listed

__all__ = ["LIMIT", "refuse_if_open"]

LIMIT = 0.1  # relative standard deviation of the ranges that the unknowns share out


def _still(problem: FitProblem) -> bool:
    """Tell whether all frames with an object read the same but for noise."""
    shown = problem.frames[problem.present]
    if np.ptp(shown[:, 2]) > 0:
        return False
    read, shot, relative = np.asarray(problem.instrument[2]), *problem.instrument[3:]
    middle = shown[:, :2].mean(axis=0)
    variance = read**2 + (shot or 0.0) * np.abs(middle) + ((relative or 0.0) * middle) ** 2
    spread = float((((shown[:, :2] - middle) ** 2) / variance).sum())
    return bool(spread < special.chdtri(2 * max(len(shown) - 1, 1), FALSE_ALARM))


def refuse_if_open(
    problem: FitProblem,
    top: Optimum,
    facts: Information,
    wider: float,
    others: Sequence[tuple[float, Optimum]] = (),
) -> None:
    """Refuse what the frames do not determine.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    top : Optimum
        Its best optimum.
    facts : Information
        There.
    wider : float
        Factor on all standard deviations (`widening`).
    others : sequence of (float, Optimum)
        Optima that are nearly as good, with their deviance above the best.

    Raises
    ------
    RefusedError
        Where the Jacobian has not full rank, or the ranges share a relative standard deviation
        above `LIMIT`, there or at another optimum as far as the intervals of 95 % reach.
    """
    present = problem.present & np.isfinite(top.positions)
    still = _still(problem)
    if facts.rank < len(problem):
        weights = np.abs(facts.null_space).max(axis=1)
        names = [name for name, w in zip(problem.names, weights, strict=True) if w > 0.05]
        cause = (
            "the object does not move: all frames read the same but for noise"
            if still
            else "the frames do not tell them apart"
        )
        raise RefusedError(
            f"{listed(names or list(problem.names))} cannot be determined (rank {facts.rank} of "
            f"{len(problem)}): {cause}; move the object nearer and farther, add frames of the "
            "empty scene (object_present false), or state one of them as known"
        )
    shared = facts.sd_of(facts.response[present])
    typical = wider * float(np.median(shared)) if shared.size else math.inf
    if not typical <= LIMIT:
        open_ones = [
            name
            for name, item in describe(problem, top.x, facts, wider).items()
            if item["status"] != "identified"
        ]
        cause = (
            "the object does not move: all frames read the same but for noise"
            if still
            else (f"{listed(open_ones or list(problem.names))} are too uncertain")
        )
        raise RefusedError(
            f"the ranges would have a common relative standard deviation of {typical:.2g}, more "
            f"than {LIMIT:g}: {cause}; move the object nearer and farther, add frames of the "
            "empty scene (object_present false), lower the noise, state a number as known, or use "
            "a posterior with priors"
        )
    for excess, other in others:
        if not excess < WITHIN:
            continue
        _, there = residuals_and_information(problem, other.x, other.positions)
        shared = there.sd_of(there.response[problem.present & np.isfinite(other.positions)])
        typical = float(np.median(shared)) * math.sqrt(1.0 - excess / WITHIN)
        if not typical <= LIMIT:
            raise RefusedError(
                f"other values of the unknowns explain the frames nearly as well (chi-square "
                f"{excess:.2g} higher), and with them the ranges would have a common relative "
                f"standard deviation of {typical:.2g}, more than {LIMIT:g}; move the object nearer "
                "and farther, add frames of the empty scene (object_present false), lower the "
                "noise, state a number as known, or use a posterior with priors"
            )
