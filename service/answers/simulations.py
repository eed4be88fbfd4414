"""A simulation as clients see it."""

import math
import secrets
from typing import Any

import pydantic

from service.requests import SimulationRequest
from simulator.simulate import simulate

__all__ = ["SimulationResponse", "simulation_of"]


class SimulationResponse(pydantic.BaseModel):
    """Answer of ``POST /v1/simulations``."""

    frames: dict[str, list[float] | list[bool] | list[float | None]]
    truth: dict[str, Any]
    seed: int


def simulation_of(request: SimulationRequest) -> dict[str, Any]:
    """Simulate.

    Parameters
    ----------
    request : SimulationRequest
        Sensor, scene, trajectory and seed.

    Returns
    -------
    dict
        ``frames`` (columns), ``truth`` (``range_m``, null where the scene is empty, and
        ``parameters``, the values of the unknowns that were drawn) and ``seed``.

    Raises
    ------
    InvalidInputError
        With pointers into the request, also where a reading is beyond what a number can hold.
    RefusedError
        Where the priors of the scene all but exclude one another.
    """
    seed = secrets.randbelow(2**53) if request.seed is None else request.seed
    simulation = simulate(request.sensor, request.scene, request.trajectory, seed)
    ranges = [None if math.isnan(value) else value for value in simulation.range_m.tolist()]
    return {
        "frames": simulation.frames.to_columns(request.sensor),
        "truth": {"range_m": ranges, "parameters": simulation.parameters},
        "seed": seed,
    }
