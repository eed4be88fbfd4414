"""Statuses of an experiment's unknowns, without causes."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.expected_posterior import ExpectedPosterior
from inference.identifiability.experiment import Experiment
from inference.identifiability.left_open import left_open
from inference.identifiability.status import status_of
from simulator.scene import Reference

__all__ = ["Judgement", "Spread", "judged", "linear_spreads"]

Array = NDArray[np.float64]

_NARROWER = 3.0  # than the curvature predicts: told by the law of the ranges, not by the readings
_LEANING = (
    ". The readings by themselves would tell it only to {:.2g}: the rest is taken from how range_m "
    'says that ranges are spread. Where that is not known, {{"prior": "reference"}} takes nothing '
    "from it"
)


@dataclasses.dataclass(frozen=True, eq=False)
class Spread:
    """How far a posterior spreads.

    Attributes
    ----------
    parameters : ndarray, shape (d,)
        Standard deviations of each unknown's own coordinate (`Parameters.marginal`), where those of
        the prior are one.
    scale : float
        Of the mean of log r over the frames; nan where none has an object.
    """

    parameters: Array
    scale: float


class Judgement(NamedTuple):
    """A parameter's status, what is said of it, and whether that has its cause already."""

    name: str
    status: str
    text: str
    explained: bool


def _headline(parameter: str, status: str, spread: float) -> str:
    if parameter == "range_m":
        return {
            "identified": f"the common scale of the ranges is known to {spread:.2g} of itself",
            "weak": f"the common scale of the ranges is known only to {spread:.0%} of itself",
            "not_identified": "the common scale of the ranges stays open",
        }[status]
    return {
        "identified": f"the data narrow the prior to {spread:.2g} of its width",
        "weak": f"the data narrow the prior only to {spread:.0%} of its width",
        "not_identified": "the answer is little more than the prior",
    }[status]


def judged(
    experiment: Experiment, spread: Spread, expected: ExpectedPosterior | None
) -> tuple[Judgement, ...]:
    """Return the statuses, and what is said of them but for causes.

    Parameters
    ----------
    experiment : Experiment
        Whose unknowns are judged.
    spread : Spread
        Of the posterior, or as it is predicted.
    expected : ExpectedPosterior or None
        See `inference.identifiability.statuses.statuses_of`.

    Returns
    -------
    tuple of Judgement
        In the order of the unknowns, "range_m" last.
    """
    independent = not isinstance(experiment.parameters.range_prior, Reference)
    names = [*experiment.parameters.names, "range_m"]
    rows = []
    for name, size, linear in zip(
        names,
        [*spread.parameters.tolist(), spread.scale],
        linear_spreads(experiment, expected),
        strict=True,
    ):
        status, alike, leaning = status_of(name, size), None, ""
        if name == "range_m" and status == "weak":
            alike = left_open(experiment, spread.scale, expected)
            status = "weak" if alike is None else "not_identified"
        text = _headline(name, status, size)
        of_law = independent and linear > _NARROWER * size and not name.startswith("range_m.")
        if alike is None and of_law:
            # the law is an assumption: what it alone tells is not identified by the data
            alone = status_of(name, linear)
            status = "weak" if alone == "identified" else alone
            leaning = _LEANING.format(linear)
        more = alike or leaning
        rows.append(Judgement(name, status, text + more, bool(more)))
    return tuple(rows)


def linear_spreads(experiment: Experiment, expected: ExpectedPosterior | None) -> list[float]:
    """Return the spreads that the curvature says, of "range_m" last; nan where there is none."""
    if expected is None:
        return [math.nan] * (len(experiment.parameters.names) + 1)
    return [*expected.sd.tolist(), expected.scale_sd]
