"""How objects move, come and go, and how many hypotheses are worth their time."""

from typing import Annotated, Literal

import pydantic

from simulator.validated import NonNegative, Positive, Validated

__all__ = ["Observables", "TrackingSettings"]

Share = Annotated[float, pydantic.Field(gt=0, lt=1)]
Observables = Literal["readings", "w1", "w2", "derivatives"]


class TrackingSettings(Validated):
    """Settings of a tracker.

    Attributes
    ----------
    observables : str
        "readings": both readings. "w1", "w2": one window of a pulse alone. "derivatives": the
        sensor's derivative columns, which neither crosstalk nor anything else that is still enters.
    rate_sd : float
        Standard deviation of d log r / dt [1/s]: 1 is a speed of r a second. While crosstalk is
        learnt, and not yet known, the law is up to three times as wide.
    rate_time_s : float
        Time over which that rate forgets itself [s].
    visit_s, absence_s : float
        Mean time that an object stays, and that none is there [s].
    outlier : float
        Probability that a frame's readings have nothing to do with the scene; as likely, where the
        crosstalk is known or the light steps, an object has moved as none of its motion does. As
        many in a row as are less likely than `false_alarm`, two at least, are a misfit.
    crosstalk_drift : (float, float), optional
        Standard deviation by which the crosstalk drifts in one second [reading units], in the order
        of the readings; it grows as the root of time. The crosstalk is then learnt on line. Left
        out: it does not drift, and is learnt only where the scene gives a prior for it and no
        posterior is at hand.
    hypotheses : int
        Most hypotheses that are kept.
    negligible : float
        Weight, relative to the heaviest, below which a hypothesis is dropped.
    unique_above : float
        Weight, given that an object is there, above which one range is the answer.
    window : int
        Frames over which the running surprise averages.
    false_alarm : float
        Probability, for a frame, of reporting a misfit of a model that fits.
    """

    observables: Observables = "readings"
    rate_sd: Positive = 1.0
    rate_time_s: Positive = 1.0
    visit_s: Positive = 10.0
    absence_s: Positive = 10.0
    outlier: Share = 1e-3
    crosstalk_drift: Annotated[tuple[NonNegative, NonNegative], pydantic.Strict(False)] | None = (
        None
    )
    hypotheses: Annotated[int, pydantic.Field(ge=1, le=64)] = 12
    negligible: Share = 1e-4
    unique_above: Annotated[float, pydantic.Field(ge=0.5, lt=1)] = 0.95
    window: Annotated[int, pydantic.Field(ge=2, le=100_000)] = 30
    false_alarm: Share = 1e-6
