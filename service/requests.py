"""What clients send: the types by which it is validated."""

from typing import Annotated, Literal

import pydantic

from inference.posterior.settings import SamplerSettings
from inference.tracking.settings import TrackingSettings
from service.system_description import SystemDescription
from simulator.frames import FrameColumns
from simulator.trajectories import Trajectory

__all__ = [
    "EstimateRequest",
    "IdentifiabilityRequest",
    "PosteriorRequest",
    "SimulationRequest",
    "StreamRequest",
    "TrackedSystem",
]

# the largest integer that every JSON reader keeps exactly
Seed = Annotated[int, pydantic.Field(ge=0, le=2**53 - 1)]
Name = Annotated[str, pydantic.Field(max_length=64)]
Positive = Annotated[float, pydantic.Field(gt=0)]
_PLANNED = pydantic.Field(min_length=1, max_length=10_000, fail_fast=True)


class TrackedSystem(SystemDescription):
    """A sensor, the scene before it, and how its objects move."""

    tracking: TrackingSettings = TrackingSettings()


class StreamRequest(TrackedSystem):
    """Body of ``POST /v1/streams``.

    Attributes
    ----------
    policy : str
        "all": no line is dropped, a client that sends faster than it is answered has to wait.
        "latest": a line that has waited too long for its turn is dropped for a newer one.
    calibrate : bool
        Whether the stream learns its scene from its own frames, and anew where it has changed.
    seed : int, optional
        Of its calibrations; left out: drawn, and told.
    """

    policy: Literal["all", "latest"] = "all"
    calibrate: bool = False
    seed: Seed | None = None


class EstimateRequest(SystemDescription):
    """Body of ``POST /v1/estimates``."""

    frames: FrameColumns
    techniques: Annotated[list[Name], pydantic.Field(min_length=1, max_length=64)] | None = None


class PosteriorRequest(SystemDescription):
    """Body of ``POST /v1/posteriors``."""

    frames: FrameColumns
    sampler: SamplerSettings = SamplerSettings()


class SimulationRequest(SystemDescription):
    """Body of ``POST /v1/simulations``; a seed that is left out is drawn and returned."""

    trajectory: Trajectory
    seed: Seed | None = None


class IdentifiabilityRequest(SystemDescription):
    """Body of ``POST /v1/identifiability``: frames before they are taken.

    Attributes
    ----------
    ranges_m : list of float
        Range of the object in every frame [m].
    object_present : list of bool, optional
        False for a frame without the object.
    at : dict of str to float, optional
        Values of unknowns by scene path at which the bounds are computed; the others are at the
        medians of their priors.
    known_range_sd_m : list of float or null, optional
        To how much a ruler or a robot tells the range of each frame [m]; null where nothing does.
    displacement_sd_m : list of float or null, optional
        The same of odometry, which tells ranges up to one offset that all frames share.
    temperature_k : list of float, optional
        Temperature of a sensor that has temperature coefficients in every frame [K]; left out: that
        at which it was calibrated.
    """

    ranges_m: Annotated[list[Positive], _PLANNED]
    known_range_sd_m: Annotated[list[Positive | None], _PLANNED] | None = None
    displacement_sd_m: Annotated[list[Positive | None], _PLANNED] | None = None
    object_present: Annotated[list[bool], _PLANNED] | None = None
    temperature_k: Annotated[list[Positive], _PLANNED] | None = None
    at: Annotated[dict[Name, float], pydantic.Field(max_length=64)] | None = None
