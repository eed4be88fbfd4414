"""Optima that fit as well as what was drawn, and hold next to none of it.

A posterior is where the mass is, and a narrow branch may be the densest of all and hold little of
it. How much it holds rests on the priors, and on how exactly the model is meant: what a parameter
has there is no value to be sure against.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.identifiability.status import Identifiability, weak_at_best

__all__ = ["Stated", "mark_other_optima"]

Array = NDArray[np.float64]

_FAR = 3.0  # standard deviations of what is stated


@dataclasses.dataclass(frozen=True, eq=False)
class Stated:
    """What an answer states, in its own coordinates.

    Attributes
    ----------
    z : ndarray, shape (n, d)
        Draws of equal weight.
    log_density : ndarray, shape (m,)
        Log densities of draws.
    log_r : ndarray, shape (n, frames)
        Ranges; nan for a frame without object.
    sd : ndarray, shape (d,)
        Standard deviations of every unknown's own coordinate (`Parameters.marginal`), with the
        errors of the model.
    scale_sd : float
        Of the mean of log r over the frames, likewise; nan where none has an object.
    """

    z: Array
    log_density: Array
    log_r: Array
    sd: Array
    scale_sd: float


def mark_other_optima(
    density: CollapsedDensity, rows: tuple[Identifiability, ...], centres: Array, stated: Stated
) -> tuple[Identifiability, ...]:
    """Mark as weak at best what lies elsewhere at an optimum that fits as well.

    Parameters
    ----------
    density : CollapsedDensity
        Of the frames.
    rows : tuple of Identifiability
        As judged by the spread of the draws.
    centres : ndarray, shape (k, d)
        Optima that were found.
    stated : Stated
        What the answer states.

    Returns
    -------
    tuple of Identifiability
        Of an optimum that is denser than half of the draws, unknowns and the scale of the ranges
        more than three standard deviations from their means are no longer identified.
    """
    if not (len(centres) and len(stated.z)):
        return rows
    dense = density(centres) > np.median(stated.log_density)
    if not dense.any():
        return rows
    own = density.parameters.marginal
    apart = own(centres[dense]) - own(stated.z).mean(axis=0)
    far = np.max(np.abs(apart) / np.where(stated.sd > 0, stated.sd, np.inf), axis=0)
    by_name = dict(zip(density.parameters.names, far.tolist(), strict=True))
    present = np.isfinite(stated.log_r[0])
    if present.any() and stated.scale_sd > 0:
        there = density.best_ranges(centres[dense])[:, present, 0].mean(axis=1)
        middle = float(stated.log_r[:, present].mean())
        by_name["range_m"] = float(np.max(np.abs(there - middle))) / stated.scale_sd
    return tuple(
        weak_at_best([row], _reason(by_name[row.parameter]))[0]
        if by_name.get(row.parameter, 0.0) > _FAR
        else row
        for row in rows
    )


def _reason(far: float) -> str:
    return (
        f"but an optimum {far:.1f} standard deviations away is denser than half of what was drawn, "
        "and holds little of it (`modes`): priors and the model's errors decide how much"
    )
