"""A status and a reason for every unknown, from how far it spreads."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.expected_posterior import (
    ExpectedPosterior,
    log_range_spread,
)
from inference.identifiability.left_open import left_open
from inference.identifiability.reasons import Diagnosis
from inference.identifiability.status import Identifiability, contraction_of, status_of
from simulator.scene import Reference

__all__ = ["Spread", "statuses_of"]

Array = NDArray[np.float64]

_WIDER = 3.0  # than the curvature predicts: more than one solution, or a curved valley
_NARROWER = 3.0  # than it predicts: told by the law of the ranges, not by the readings
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


def statuses_of(
    diagnosis: Diagnosis, spread: Spread, expected: ExpectedPosterior | None
) -> tuple[Identifiability, ...]:
    """Say of every unknown and of the common scale of the ranges whether it is identified.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of the experiment at which the reasons are computed.
    spread : Spread
        Of the posterior, or as it is predicted.
    expected : ExpectedPosterior or None
        At the experiment, to tell a curved or divided posterior by; None where its derivatives
        are beyond what a number can hold, and no cause can be computed.

    Returns
    -------
    tuple of Identifiability
        In the order of the unknowns, "range_m" last.
    """
    experiment = diagnosis.experiment
    names = experiment.parameters.names
    wide = log_range_spread(experiment.parameters)
    linear_sd = np.full(len(names) + 1, np.nan)
    if expected is not None:
        linear_sd = np.append(expected.sd, expected.scale_sd)
    independent = not isinstance(experiment.parameters.range_prior, Reference)
    rows = []
    for (name, value, unit), linear in zip(
        [
            *((name, float(sd), 1.0) for name, sd in zip(names, spread.parameters, strict=True)),
            ("range_m", spread.scale, wide),
        ],
        linear_sd.tolist(),
        strict=True,
    ):
        status = status_of(name, value)
        alike = None
        if name == "range_m" and status == "weak":
            alike = left_open(experiment, spread.scale, expected)
            status = "weak" if alike is None else "not_identified"
        text = _headline(name, status, value)
        if alike is not None:
            text += alike
        elif independent and linear > _NARROWER * value and not name.startswith("range_m."):
            # the law is an assumption: what it alone tells is not identified by the data
            alone = status_of(name, linear)
            status = "weak" if alone == "identified" else alone
            text += _LEANING.format(linear)
        elif status != "identified" and expected is not None:
            text += ": " + _cause(diagnosis, name, value, linear)
        # a law so narrow that it has no width leaves nothing to contract
        contraction = contraction_of(value / unit) if unit > 0 else 0.0
        rows.append(Identifiability(name, status, contraction, text))
    return tuple(rows)


def _cause(diagnosis: Diagnosis, name: str, spread: float, linear: float) -> str:
    if name.startswith("range_m."):
        few = "one range says" if diagnosis.distinct == 1 else f"{diagnosis.distinct} ranges say"
        return f"{few} no more of the law that they were drawn from"
    text = diagnosis.explain(name)
    if spread > _WIDER * linear:
        text += (
            f"; it spreads {spread / linear:.2g} times wider than the curvature at one draw "
            "says: there are several solutions, or one valley that bends"
        )
    return text
