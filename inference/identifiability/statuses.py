"""A status and a reason for every unknown, from how far it spreads."""

from inference.identifiability.expected_posterior import (
    ExpectedPosterior,
    log_range_spread,
)
from inference.identifiability.judged import Spread, judged, linear_spreads
from inference.identifiability.reasons import Diagnosis
from inference.identifiability.status import Identifiability, contraction_of

__all__ = ["statuses_of"]

_WIDER = 3.0  # than the curvature predicts: more than one solution, or a curved valley


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
    wide = log_range_spread(experiment.parameters)
    sizes = [*((size, 1.0) for size in spread.parameters.tolist()), (spread.scale, wide)]
    rows = []
    for (name, status, text, explained), (size, unit), linear in zip(
        judged(experiment, spread, expected),
        sizes,
        linear_spreads(experiment, expected),
        strict=True,
    ):
        if not explained and status != "identified" and expected is not None:
            text += ": " + _cause(diagnosis, name, size, linear)
        # a law so narrow that it has no width leaves nothing to contract
        contraction = contraction_of(size / unit) if unit > 0 else 0.0
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
