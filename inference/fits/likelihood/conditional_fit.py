"""A fit with one of its unknowns held."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.coordinates import KNOWN, SAME
from inference.fits.likelihood.problem import FitProblem

__all__ = ["held", "released"]

Array = NDArray[np.float64]


def held(problem: FitProblem, j: int, x: Array) -> tuple[FitProblem, Array]:
    """Return the problem with one unknown held, and the coordinates of the others.

    Parameters
    ----------
    problem : FitProblem
        The problem, of at least two unknowns.
    j : int
        The coordinate; its physical value is held.
    x : ndarray, shape (d,)
        Where.

    Returns
    -------
    (FitProblem, ndarray)
        Of d - 1 unknowns.
    """
    values = problem.values(x)
    index, known = problem.layout[0].copy(), problem.layout[1].copy()
    slot = int(problem.slots[j])
    index[index > j] -= 1
    index[slot] = KNOWN
    known[slot] = values[slot]
    if problem.layout[0][7] == SAME:
        index[7:] = SAME
    keep = np.arange(x.size) != j
    smaller = dataclasses.replace(
        problem,
        names=tuple(name for name, kept in zip(problem.names, keep, strict=True) if kept),
        slots=problem.slots[keep],
        layout=(index, known, *problem.layout[2:]),
    )
    return smaller, x[keep]


def released(problem: FitProblem, smaller: FitProblem, x: Array) -> Array:
    """Return the coordinates of the whole problem for those with one unknown held.

    Parameters
    ----------
    problem, smaller : FitProblem
        The whole problem, and that of `held`.
    x : ndarray, shape (d - 1,)
        Coordinates of the smaller one.

    Returns
    -------
    ndarray, shape (d,)
    """
    natural = smaller.values(x)[problem.slots] * problem.units
    return np.asarray(problem.coordinates(natural[None])[0])
