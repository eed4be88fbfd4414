"""What an operator allows a request to ask for."""

from inference.posterior.settings import SamplerSettings
from service.service_settings import ServiceSettings
from simulator.errors import InvalidInputError, Problem
from simulator.trajectories import SampledTrajectory, Trajectory

__all__ = ["capped", "frames_within"]

_CAPPED = ("ensembles", "target_ess", "max_seconds")


def capped(settings: ServiceSettings, asked: SamplerSettings) -> SamplerSettings:
    """Hold a posterior to the caps.

    Parameters
    ----------
    settings : ServiceSettings
        With the caps.
    asked : SamplerSettings
        What a client asks for.

    Returns
    -------
    SamplerSettings
        The same; what the client left out is lowered to its cap.

    Raises
    ------
    InvalidInputError
        With a pointer to each member that was asked for and is above its cap.
    """
    problems, lowered = [], {}
    for name in _CAPPED:
        cap = getattr(settings, name if name.startswith("max_") else f"max_{name}")
        if getattr(asked, name) > cap:
            lowered[name] = cap
            if name in asked.model_fields_set:
                message = f"must be at most {cap:g} on this service"
                problems.append(Problem(f"/sampler/{name}", message))
    if problems:
        raise InvalidInputError(*problems)
    return asked.model_copy(update=lowered)


def frames_within(settings: ServiceSettings, trajectory: Trajectory) -> int:
    """Return how many frames a trajectory has, no more than an operator allows.

    Raises
    ------
    InvalidInputError
        With a pointer to what says how many there are.
    """
    if isinstance(trajectory, SampledTrajectory):
        member, count = "range_m", len(trajectory.range_m)
    else:
        member, count = "frames", trajectory.frames
    if count > settings.max_trajectory:
        message = f"must be at most {settings.max_trajectory} frames on this service"
        raise InvalidInputError.at(f"/trajectory/{member}", message)
    return count
