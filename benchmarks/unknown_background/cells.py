"""The cells of the table, and what is computed in one."""

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from benchmarks.resumable import Row
from inference.identifiability.expected_posterior import expected_posterior
from inference.identifiability.experiment import Experiment, information
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["CELLS", "COLUMNS", "R_NAME", "SNRS", "SPANS", "Cell", "Foreseen", "prior_sd", "row_of"]

Array = NDArray[np.float64]

R_NAME = "background.distance_m"
FRAMES = 40
SPANS = ((0.2, 2.0), (0.5, 1.0), (1.0, 2.0))
SNRS = (1e2, 1e3, 1e4, 1e5, 1e6)
C0, C1, C2 = 0.0769, -0.123, 0.0957
# what is known beforehand: the order of magnitude
DISTANCE = {"prior": "lognormal", "median": 5.0, "sigma": 0.7}
STRENGTH = {"prior": "lognormal", "median": 0.01, "sigma": 1.5}
SUPPORT = {"low": 0.02, "high": 15.0}


@dataclasses.dataclass(frozen=True)
class Foreseen:
    """Standard deviations of log R, at the truth."""

    bound: float
    predicted: float


@dataclasses.dataclass(frozen=True)
class Cell:
    """One scene, one noise, one data set."""

    case: str
    distance: float
    span: tuple[float, float]
    snr: float
    repeat: int

    @property
    def ranges(self) -> Array:
        """An object at constant speed: what no law of independent draws expects."""
        return np.linspace(*self.span, FRAMES)

    @property
    def strength(self) -> float:
        """That of a diffuse sphere of unit albedo."""
        return 1 / (2 * math.pi * self.distance**2)

    @property
    def truth(self) -> dict[str, float]:
        return {
            "object.c0": C0,
            "object.c1": C1,
            "object.c2": C2,
            "background.strength": self.strength,
            R_NAME: self.distance,
            "background.shadow.c0": 0.73 * C0,
            "background.shadow.c1": 0.23 * abs(C1),
        }

    @property
    def scene(self) -> Scene:
        """What the posterior is told."""
        background: dict[str, Any] = {"strength": STRENGTH, "distance_m": DISTANCE}
        if self.case != "B":
            background["shadow"] = "object"
        law = "loguniform" if self.case == "W" else "reference"
        return parse_scene({"background": background, "range_m": {"prior": law, **SUPPORT}})

    @property
    def made_of(self) -> Scene:
        """What the frames are made of."""
        shadow: Any = {name: self.truth[f"background.shadow.{name}"] for name in ("c0", "c1")}
        background = {
            "strength": self.strength,
            "distance_m": self.distance,
            "shadow": shadow if self.case == "B" else "object",
        }
        return parse_scene({"object": {"c0": C0, "c1": C1, "c2": C2}, "background": background})

    def experiment(self, sensor: Sensor, log_r: Array) -> Experiment:
        parameters = parameters_of(sensor, self.scene)
        values = np.array([[self.truth[name] for name in parameters.names]])
        return Experiment(sensor, parameters, parameters.standard(values)[0], log_r)

    @property
    def sensor(self) -> Sensor:
        def with_noise(sd: float) -> Sensor:
            return parse_sensor(
                {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [sd, sd]}}
            )

        middle = self.experiment(with_noise(1.0), np.array([np.log(self.ranges).mean()]))
        return with_noise(float(middle.readings.mean[0, 1]) / self.snr)

    def foreseen(self) -> Foreseen:
        experiment = self.experiment(self.sensor, np.log(self.ranges))
        bounds, prediction = information(experiment), expected_posterior(experiment)
        j = bounds.names.index(R_NAME)
        step = 1e-5 * np.eye(experiment.z.size)[j]
        ends = experiment.parameters.natural(experiment.z + np.outer([1, -1], step))[:, j]
        slope = float(np.log(ends[0] / ends[1])) / 2e-5  # of log R along its z: the prior is cut
        predicted = float(prediction.sd[j]) * slope
        return Foreseen(float(bounds.sd[j]), predicted)


def prior_sd() -> float:
    """Standard deviation of log R under its prior, which the sensor's r0 cuts."""
    cell = Cell("A", 3.0, SPANS[0], 1.0, 0)
    parameters = parameters_of(cell.sensor, cell.scene)
    j = parameters.names.index(R_NAME)
    z = np.zeros((4001, len(parameters)))
    z[:, j] = special.ndtri((np.arange(4001) + 0.5) / 4001)
    return float(np.log(parameters.natural(z)[:, j]).std())


def _cells() -> list[Cell]:
    first = [
        Cell("A", distance, span, snr, 0)
        for distance, span, snr in itertools.product((3.0, 10.0), SPANS, SNRS)
    ]
    second = [
        Cell("B", distance, span, snr, 0)
        for distance, span, snr in itertools.product((3.0, 10.0), SPANS, SNRS[::2])
    ]
    wide = [Cell("W", 3.0, SPANS[0], snr, 0) for snr in SNRS]
    return first + wide + second


CELLS = _cells()
"""A cell's place is its number in the table: new ones come at the end."""

COLUMNS = (
    *("set", "case", "distance_m", "from_m", "to_m", "snr", "repeat"),
    *(
        "bound",
        "predicted",
        "sd",
        "median_m",
        "error",
    ),
    *("status", "converged", "method", "ess", "rhat", "k_hat", "cpu_s", "version"),
)


def row_of(number: int, version: str, seconds: float) -> Row:
    """Infer one posterior and compare it with what was foreseen."""
    cell = CELLS[number]
    rng = np.random.default_rng([11, number])
    trajectory = SampledTrajectory(range_m=cell.ranges.tolist())
    frames = simulate(cell.sensor, cell.made_of, trajectory, rng).frames
    settings = SamplerSettings(method="auto", seed=number, max_seconds=seconds)
    found = infer(cell.sensor, cell.scene, frames, settings)
    names = found.draws.names
    distances = np.log(found.draws.parameters[..., names.index(R_NAME)])
    status = next(row.status for row in found.identifiability if row.parameter == R_NAME)
    summary = found.parameters[R_NAME]
    foreseen = cell.foreseen()
    return {
        "case": cell.case,
        "distance_m": cell.distance,
        "from_m": cell.span[0],
        "to_m": cell.span[1],
        "snr": cell.snr,
        "repeat": cell.repeat,
        "bound": foreseen.bound,
        "predicted": foreseen.predicted,
        "sd": float(distances.std()),
        "median_m": summary.q50,
        "error": math.log(summary.q50 / cell.distance) / float(distances.std()),
        "status": status,
        "converged": int(found.verdict.converged),
        "method": found.method,
        "ess": min(s.ess_bulk for s in found.parameters.values()),
        "rhat": max((s.rhat or 1.0) for s in found.parameters.values()),
        "k_hat": "" if found.runtime.k_hat is None else found.runtime.k_hat,
        "cpu_s": found.runtime.cpu_s,
        "version": version,
    }
