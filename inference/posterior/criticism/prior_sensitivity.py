"""What an answer owes to the prior of the ranges: draws weighted to one that says nothing of them.

Where every range is an independent draw of `range_m`, how the ranges lie tells something of
everything else: of crosstalk, say, that it must be such that they spread like that. An object on
its way is no independent draw. Weighted to the reference prior, which takes nothing from how ranges
are spread, an answer that the readings themselves give stays where it is.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.density.collapsed import CollapsedDensity
from inference.density.static import StaticDensity
from inference.identifiability.status import Identifiability
from simulator.priors import UniformDistribution
from simulator.scene import Reference, Stroke

__all__ = ["PriorSensitivity", "mark_sensitive", "prior_sensitivity"]

Array = NDArray[np.float64]

_DRAWS = 400
_EVALUATIONS = 60_000  # of frames, above which fewer draws do
_LEAST_DRAWS = 100
_MOVED = 1.0  # own standard deviations
_LOWEST = 1e-6  # of the highest range: a prior that begins at zero has next to nothing below


@dataclasses.dataclass(frozen=True)
class PriorSensitivity:
    """By how much means would move, in standard deviations of the posterior.

    Attributes
    ----------
    parameters : ndarray, shape (d,)
        Of every unknown, in the coordinates whose prior is standard normal.
    scale : float
        Of the mean of log r over the frames; 0 where none holds an object.
    """

    parameters: Array
    scale: float


def prior_sensitivity(density: CollapsedDensity, z: Array, log_r: Array) -> PriorSensitivity | None:
    """Weight draws to the reference prior of the ranges.

    Parameters
    ----------
    density : CollapsedDensity
        The density.
    z : ndarray, shape (n, d)
        Draws of equal weight.
    log_r : ndarray, shape (n, frames)
        Their ranges; nan for a frame without object.

    Returns
    -------
    PriorSensitivity or None
        None where there is nothing to compare: no unknowns, one range for all frames, a reference
        prior, or a prior that is narrow on purpose (normal, log-normal). Where the reference prior
        would put the answer beyond all draws, the shifts are too small, never too large.
    """
    parameters = density.parameters
    stated = parameters.range_prior
    if len(parameters) == 0 or isinstance(density, StaticDensity) or isinstance(stated, Reference):
        return None
    if not isinstance(stated, Stroke | UniformDistribution):
        return None
    count = int(np.clip(_EVALUATIONS // max(len(density.frames), 1), _LEAST_DRAWS, _DRAWS))
    chosen = np.linspace(0, len(z) - 1, min(count, len(z))).astype(int)
    z, log_r = z[chosen], log_r[chosen]
    other = dataclasses.replace(
        density,
        parameters=dataclasses.replace(
            parameters,
            range_prior=Reference(low=max(stated.low, _LOWEST * stated.high), high=stated.high),
        ),
    )
    gain = other.log_likelihood(z) - density.log_likelihood(z)
    gain = np.where(np.isfinite(gain), gain, -np.inf)
    present = np.isfinite(log_r[0]) if len(log_r) else np.zeros(0, dtype=bool)
    if not np.isfinite(gain).any():
        return None
    weights = special.softmax(gain)
    columns = z
    if present.any():
        columns = np.column_stack([z, log_r[:, present].mean(axis=1)])
    moved, sd = weights @ columns - columns.mean(axis=0), columns.std(axis=0)
    shift = np.divide(moved, sd, out=np.zeros_like(moved), where=sd > 0)
    d = len(parameters)
    return PriorSensitivity(shift[:d], float(shift[d]) if present.any() else 0.0)


def mark_sensitive(
    names: tuple[str, ...], rows: tuple[Identifiability, ...], sensitivity: PriorSensitivity | None
) -> tuple[Identifiability, ...]:
    """Mark as weak at best what rests on the prior of the ranges.

    Parameters
    ----------
    names : tuple of str
        The unknowns.
    rows : tuple of Identifiability
        As judged by the spread of the draws.
    sensitivity : PriorSensitivity or None
        From `prior_sensitivity`.

    Returns
    -------
    tuple of Identifiability
    """
    if sensitivity is None:
        return rows
    by_name = dict(zip(names, sensitivity.parameters.tolist(), strict=True)) | {
        "range_m": sensitivity.scale
    }
    judged = []
    for row in rows:
        moved = abs(by_name[row.parameter])
        of_prior = row.parameter.startswith("range_m.")
        if row.status == "identified" and moved > _MOVED and not of_prior:
            reason = (
                f"{row.reason}, but under a law that takes nothing from how the ranges are spread "
                f"it would move by {moved:.1f} or more of its standard deviations: it holds if "
                "every range is an independent draw of range_m, which those of an object on its "
                'way are not; where they are not, state {"prior": "reference"}'
            )
            judged.append(dataclasses.replace(row, status="weak", reason=reason))
        else:
            judged.append(row)
    return tuple(judged)
