"""What an answer owes to the prior of the ranges: draws weighted to one that says nothing of them.

Where every range is an independent draw of `range_m`, how the ranges lie tells something of
everything else: of crosstalk, say, that it must be such that they spread like that. An object on
its way is no independent draw. Weighted to the reference prior, which takes nothing from how ranges
are spread, an answer that the readings themselves give stays where it is.
"""

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.static import StaticDensity
from inference.identifiability.status import Identifiability
from simulator.priors import UniformDistribution
from simulator.scene import Reference, Stroke

__all__ = ["PriorSensitivity", "leaning", "mark_sensitive", "prior_sensitivity"]

Array = NDArray[np.float64]

_DRAWS = 400
_EVALUATIONS = 60_000  # of frames, above which fewer draws do
_LEAST_DRAWS = 100
_FEWEST_LEFT = 100.0  # effective draws under the weights: their mean errs by a tenth of a sd
_MOVED = 1.0  # own standard deviations
_WORDS = (
    "under a law that takes nothing from how the ranges are spread it would move by {:.1f} "
    "standard deviations of what was drawn, by which its interval is widened: it holds if every "
    "range is an independent draw of range_m, which those of an object on its way are not; where "
    "they are not, "
    'leave range_m out or state {{"prior": "reference"}}'
)
_LOWEST = 1e-6  # of the highest range: a prior that begins at zero has next to nothing below


@dataclasses.dataclass(frozen=True)
class PriorSensitivity:
    """By how much means would move.

    Attributes
    ----------
    parameters : ndarray, shape (d,)
        Of every unknown, in standard deviations of the posterior.
    scale : float
        Of the mean of log r over the frames, likewise; 0 where none holds an object.
    of_z : ndarray, shape (d,)
        Of the coordinates in which every prior is standard normal.
    of_log_r : ndarray, shape (frames,)
        Of log r; 0 for a frame without object.
    words : str
        What to say of it, with a place for the number of standard deviations.
    """

    parameters: Array
    scale: float
    of_z: Array
    of_log_r: Array
    words: str = _WORDS


def prior_sensitivity(density: CollapsedDensity, z: Array, log_r: Array) -> PriorSensitivity | None:
    """Weight draws to the reference prior of the ranges.

    Parameters
    ----------
    z : ndarray, shape (n, d)
        Draws of equal weight.
    log_r : ndarray, shape (n, frames)
        Their ranges; nan for a frame without object.

    Returns
    -------
    PriorSensitivity or None
        None where there is nothing to compare: no unknowns, one range for all frames, a reference
        prior, or a prior that is narrow on purpose (normal, log-normal).

    Notes
    -----
    A mean moves by the covariance of its quantity with the log of the weights, to first order in
    them (and exactly for a normal posterior and a log weight that is linear). Where the reference
    prior would put the answer beyond all draws, this sees farther than a mean of weighted draws,
    which stays among them: it is taken where the weights leave few.
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
    d, scale = len(parameters), np.zeros(len(z))
    ranges = np.where(present, log_r, 0.0)
    if present.any():
        scale = log_r[:, present].mean(axis=1)
    columns = np.column_stack([z, scale, ranges])
    weights = scipy.special.softmax(gain)
    moved, sd = weights @ columns - columns.mean(axis=0), columns.std(axis=0)
    if np.square(weights).sum() * _FEWEST_LEFT > 1.0:
        finite = np.isfinite(gain)
        linear = gain[finite] - gain[finite].mean()
        moved = linear @ (columns[finite] - columns[finite].mean(axis=0)) / finite.sum()
    shift = np.divide(moved, sd, out=np.zeros_like(moved), where=sd > 0)
    return PriorSensitivity(shift[:d], float(shift[d]), moved[:d], moved[d + 1 :])


def leaning(sensitivity: PriorSensitivity | None) -> PriorSensitivity | None:
    """Return the shifts of an answer that rests on the law of the ranges; None of any other.

    What is weak must not be narrow: its draws are moved by a random part of these shifts, standard
    normal, so that intervals reach where the reference prior would put them.
    """
    if sensitivity is None:
        return None
    moved = max(np.abs(sensitivity.parameters).max(initial=0.0), abs(sensitivity.scale))
    return sensitivity if moved > _MOVED else None


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
        if moved > _MOVED and not of_prior:
            reason = f"{row.reason}; but {sensitivity.words.format(moved)}"
            status = "weak" if row.status == "identified" else row.status
            judged.append(dataclasses.replace(row, status=status, reason=reason))
        else:
            judged.append(row)
    return tuple(judged)
