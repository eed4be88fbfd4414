"""A simulation as clients see it."""

import math
import secrets
from typing import Any

import numpy as np

from service.checks import system
from service.schemas import SimulationRequest
from simulator.errors import RefusedError
from simulator.simulate import simulate

__all__ = ["simulation_of"]


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
        With pointers into the request.
    RefusedError
        Where readings of this scene are beyond what a number can hold.
    """
    sensor, scene = system(request.sensor, request.scene)
    seed = secrets.randbelow(2**53) if request.seed is None else request.seed
    # what overflows is refused below, all of it at once
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        simulation = simulate(sensor, scene, request.trajectory, seed)
    times = () if simulation.frames.time_s is None else simulation.frames.time_s
    drawn = list(simulation.parameters.values())
    if not all(np.isfinite(part).all() for part in (simulation.frames.readings, times, drawn)):
        message = "the readings of this scene overflow; bring gain, ranges and noise nearer to 1"
        raise RefusedError(message)
    ranges = [None if math.isnan(value) else value for value in simulation.range_m.tolist()]
    return {
        "frames": simulation.frames.to_columns(sensor),
        "truth": {"range_m": ranges, "parameters": simulation.parameters},
        "seed": seed,
    }
