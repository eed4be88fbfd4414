"""Whether a parameter is identified: the one definition, for posteriors, fits and before any data.

What decides is the *spread*: the standard deviation that the data leave, over that of the prior,
both in the coordinate in which the prior of the unknown is standard normal.

    identified       spread below 0.2
    weak             spread from 0.2 to below 0.7
    not_identified   spread 0.7 or more

A posterior has its spread in its draws, an experiment that is only planned in the linearised
posterior. A fit uses no priors: its spread is that of the prior times the normal law that the
fit's value and standard deviation stand for (`spread_of_fit`).

The common scale of the ranges has no prior of its own (``range_m`` is that of each range, however
many there are). Its spread is the standard deviation of the mean of log r, a relative error:
identified below 0.05, not identified from 0.3 on.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping

import numpy as np

from simulator.parameters import Parameters

__all__ = [
    "NARROW_SCALE",
    "NARROW_SPREAD",
    "STATUSES",
    "WIDE_SCALE",
    "WIDE_SPREAD",
    "Identifiability",
    "contraction_of",
    "is_positive",
    "spread_of_fit",
    "status_of",
    "weak_at_best",
]


# Of normal laws, spread^2 is the share that the prior has in the answer: by so much of the distance
# between prior and data the prior moves the answer, and so much of the precision is its own.
NARROW_SPREAD = 0.2  # the prior's share is 4 %: its choice hardly matters
WIDE_SPREAD = 0.7  # its share is one half: the prior says as much as the data
# Of the ranges' scale, what its user can do with it.
NARROW_SCALE = 0.05  # all ranges are right within a tenth at 95 %
WIDE_SCALE = 0.3  # at 95 % a range may be half or twice what is said: no scale is known

STATUSES = ("identified", "weak", "not_identified")
"""The best first."""

# coordinates of the quadrature that `spread_of_fit` uses; what falls between two of them is
# narrower than a hundredth of the prior and identified all the same
_NODES = np.linspace(-8.0, 8.0, 1601)


@dataclasses.dataclass(frozen=True)
class Identifiability:
    """Whether the data tell a parameter.

    Attributes
    ----------
    parameter : str
        Scene path, or "range_m" for the common scale of the ranges.
    status : "identified", "weak" or "not_identified"
        By how much the data narrow the prior; for the ranges' scale by its relative error.
    contraction : float
        1 - variance of the posterior over that of the prior.
    reason : str
        Why, and what would help, in plain words.
    """

    parameter: str
    status: str
    contraction: float
    reason: str


def status_of(parameter: str, spread: float) -> str:
    """Return the status of a parameter.

    Parameters
    ----------
    parameter : str
        Scene path, or "range_m".
    spread : float
        Standard deviation that the data leave, over the prior's, where the prior is standard
        normal; for "range_m" that of the mean of log r. nan where the data leave no number.

    Returns
    -------
    str
        "identified", "weak" or "not_identified".
    """
    scale = parameter == "range_m"
    if spread < (NARROW_SCALE if scale else NARROW_SPREAD):
        return "identified"
    return "weak" if spread < (WIDE_SCALE if scale else WIDE_SPREAD) else "not_identified"


def weak_at_best(rows: Iterable[Identifiability], because: str) -> tuple[Identifiability, ...]:
    """Return rows of which none is `identified`: those that were are `weak`, and say why."""
    return tuple(
        dataclasses.replace(row, status="weak", reason=f"{row.reason}, {because}")
        if row.status == "identified"
        else row
        for row in rows
    )


def contraction_of(spread: float) -> float:
    """Return 1 - spread^2, by how much the data shrink the prior's variance; 0 without a number."""
    return 1 - spread**2 if math.isfinite(spread) else 0.0


def is_positive(name: str) -> bool:
    """Tell whether an unknown of a scene path can only be positive; its logarithm is judged."""
    return not name.startswith(("crosstalk", "odometry")) and not name.endswith(".c1")


def spread_of_fit(
    parameters: Parameters, name: str, values: Mapping[str, float], sd: float
) -> float:
    """Return the spread of an unknown of which a fit states a value and a standard deviation.

    The fit stands for a normal law, of the logarithm where an unknown can only be positive. Its
    product with the prior is integrated in the prior's standard normal coordinate, so that the
    answer holds also near the ends of the prior's support and beyond them.

    Parameters
    ----------
    parameters : Parameters
        The scene's unknowns with their priors.
    name : str
        Scene path of the unknown.
    values : mapping of str to float
        The fit's values by scene path [SI or reading units], this one's among them. A prior that
        depends on another unknown (c1's on c0) is taken at the fit's value of it, or at the median
        where the fit has none.
    sd : float
        The fit's standard deviation of this one, in its unit.

    Returns
    -------
    float
        From 0 to 1 or little more; 1, the prior as it was, where value or sd are no numbers.

    Raises
    ------
    ValueError
        Where ``name`` is not an unknown of the scene.
    """
    unknown = parameters.unknowns[parameters.names.index(name)]
    positive = is_positive(name)
    value = values[name]
    if not (math.isfinite(value) and 0.0 < sd < math.inf) or (positive and not value > 0.0):
        return 1.0
    others = {**parameters.known, **values}
    if not set(parameters.names) <= others.keys():
        medians = parameters.natural(np.zeros((1, len(parameters))))[0].tolist()
        others = dict(zip(parameters.names, medians, strict=True)) | others
    held = {path: np.full(_NODES.size, other) for path, other in others.items()}
    with np.errstate(all="ignore"):
        x = unknown.from_normal(_NODES, held)
        away = value / sd * np.log(x / value) if positive else (x - value) / sd
        density = -0.5 * (np.square(_NODES) + np.square(away))
        weight = np.exp(density - np.nanmax(density, initial=-np.inf))
    weight = np.where(np.isfinite(weight), weight, 0.0)
    if not weight.any():  # so narrow that no node is near
        return 0.0
    mean = np.average(_NODES, weights=weight)
    return math.sqrt(float(np.average(np.square(_NODES - mean), weights=weight)))
