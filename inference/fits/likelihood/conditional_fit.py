"""A fit with one of its unknowns held."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.coordinates import KNOWN
from inference.fits.likelihood.problem import FitProblem

__all__ = ["conditional", "unconditional"]

Array = NDArray[np.float64]


def conditional(problem: FitProblem, j: int, x: Array) -> tuple[FitProblem, Array]:
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
    layout, slot = problem.layout, int(problem.slots[j])
    index, known = layout.coordinate.copy(), layout.known.copy()
    index[index > j] -= 1
    index[slot] = KNOWN
    known[slot] = problem.values(x)[slot]
    keep = np.arange(x.size) != j
    smaller = dataclasses.replace(
        problem,
        names=tuple(name for name, kept in zip(problem.names, keep, strict=True) if kept),
        slots=problem.slots[keep],
        layout=layout._replace(coordinate=index, known=known),
    )
    return smaller, x[keep]


def unconditional(problem: FitProblem, smaller: FitProblem, x: Array) -> Array:
    """Return the coordinates of the whole problem for those with one unknown held.

    Parameters
    ----------
    problem, smaller : FitProblem
        The whole problem, and that of `conditional`.
    x : ndarray, shape (d - 1,)
        Coordinates of the smaller one.

    Returns
    -------
    ndarray, shape (d,)
    """
    natural = smaller.values(x)[problem.slots] * problem.units
    return np.asarray(problem.coordinates(natural[None])[0])
