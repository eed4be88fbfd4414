"""Other maxima that a fit whose model errs may not decide against."""

import dataclasses
from collections.abc import Sequence

from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_point import standard
from inference.fits.likelihood.problem import FitProblem

__all__ = ["rivals_of"]


def rivals_of(problem: FitProblem, found: Sequence[Erring], decided: float) -> list[Erring]:
    """Return the maxima beside the first that are not decided against.

    One whose squares are no larger than the first's is as good as that, whatever its deviance: only
    the size that errors are stated to have, by log determinants, speaks against it. Sizes that are
    too large ask for values of the unknowns that leave next to no light to err.

    Parameters
    ----------
    problem : FitProblem
        The problem, whose model errs.
    found : sequence of Erring
        Its maxima, the most probable first.
    decided : float
        Deviance from which on one is decided against.

    Returns
    -------
    list of Erring
        What is as good as the first has its deviance.
    """
    first, *others = found
    least = _squares(problem, first)
    as_good = (
        dataclasses.replace(one, deviance=min(one.deviance, first.deviance))
        if _squares(problem, one) <= least
        else one
        for one in others
    )
    return [one for one in as_good if one.deviance <= decided]


def _squares(problem: FitProblem, end: Erring) -> float:
    """Return the squares of what is left of readings, of errors and of unknowns."""
    z = standard(dataclasses.replace(problem, mode=end.clean.mode), end.x[None])[0]
    return end.chi_square + float(z @ z)
