"""A truth drawn from the priors of a scene, ranges included, and the readings it makes."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.priors import Distribution, NormalDistribution, UniformDistribution
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["Truth", "draw_truth", "with_known"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Truth:
    """What was drawn.

    Attributes
    ----------
    z : ndarray, shape (d,)
        Unknowns in the coordinates in which their prior is the standard normal.
    natural : ndarray, shape (d,)
        The same in SI units.
    range_m : ndarray, shape (n,)
        Ranges [m].
    frames : Frames
        The readings.
    """

    z: Array
    natural: Array
    range_m: Array
    frames: Frames


def with_known(scene: Scene, values: dict[str, float]) -> Scene:
    """Return a scene in which unknowns, by scene path, are known numbers."""
    plain: dict[str, Any] = scene.model_dump(mode="json", exclude_none=True)
    for path, value in values.items():
        *parents, last = path.split(".")
        if parents == ["crosstalk"]:
            term = plain["crosstalk"]
            pair = term["values"] if isinstance(term, dict) else term
            pair[0 if last in ("w1", "i") else 1] = value
        elif parents != ["range_m"]:  # ranges are drawn, and no scene knows them
            here = plain
            for parent in parents:
                here = here.setdefault(parent, {})
            here[last] = value
    return parse_scene(plain)


def _draw_ranges(law: Array, n: int, rng: np.random.Generator) -> Array:
    """Draw n ranges from the law of `Terms.ranges`, one row."""
    in_log = bool(law[1] == -1.0)
    inverse = float(law[5] if in_log else law[3])
    loc = float(law[4] if in_log else law[2])
    low, high = float(law[6]), float(law[7])
    prior: Distribution = UniformDistribution(log=in_log, low=low, high=high)
    if inverse > 0:
        prior = NormalDistribution(log=in_log, loc=loc, scale=1.0 / inverse, low=low, high=high)
    return prior.from_normal(rng.standard_normal(n))


def draw_truth(sensor: Sensor, scene: Scene, frames: int, rng: np.random.Generator) -> Truth:
    """Draw unknowns, ranges and readings from exactly the model that inference has.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        Sensor and scene of the inference.
    frames : int
        Number of frames.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    Truth
    """
    parameters = parameters_of(sensor, scene)
    law = np.array([0.0])
    while not law[-1] > law[0]:  # a shadow that leaves no range is outside the joint prior
        z = parameters.sample(rng, 1)
        row = parameters.terms(z).ranges[0]
        law = row[6:]
    natural = parameters.natural(z)[0]
    ranges = _draw_ranges(row, frames, rng)
    known = with_known(scene, dict(zip(parameters.names, natural.tolist(), strict=True)))
    made = simulate(sensor, known, SampledTrajectory(range_m=ranges.tolist()), rng)
    return Truth(z[0], natural, ranges, made.frames)
