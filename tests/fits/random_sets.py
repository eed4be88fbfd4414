"""Random data sets of five kinds of scenes, and whether a fit that got no guess found its way."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.fits.answer.determined import LIMIT
from inference.fits.answer.inflation import inflation
from inference.fits.likelihood.erring import erring_maxima
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.maximum import Maximum, maximum_from
from inference.fits.likelihood.prior_maxima import prior_maxima
from inference.fits.likelihood.problem import FitProblem, fit_problem
from simulator.constants import SPEED_OF_LIGHT
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import Simulation, simulate
from simulator.trajectories import SampledTrajectory
from tests.fits.scenes import values_of

Array = NDArray[np.float64]

CLASSES = ("object", "crosstalk", "known background", "free shadow", "everything")
_NOISE = {"free shadow": (3.0, 5.0), "everything": (4.0, 6.0)}  # decades of SNR, else 2 to 4
_SAME = 0.1


@dataclasses.dataclass(frozen=True, eq=False)
class RandomSet:
    """One data set.

    Attributes
    ----------
    sensor : Sensor
    scene : Scene
        What the fit is told.
    truth : dict
        The scene with all its numbers.
    simulation : Simulation
        Frames and true ranges.
    """

    sensor: Sensor
    scene: Scene
    truth: dict[str, Any]
    simulation: Simulation


def random_set(
    name: str,
    kind: str,
    seed: int,
    discrepancy: object = 0,
    errors: object = 0,
    decades: tuple[float, float] | None = None,
) -> RandomSet:
    """Draw a data set: object, ranges, noise, and what stands before and behind.

    Parameters
    ----------
    name : str
        One of `CLASSES`. "known background": strength, distance and shadow known, object not;
        "free shadow": strength and distance known; "everything": crosstalk, object, strength,
        distance and shadow unknown, half of the sets with empty scenes.
    kind : str
        Of the sensor.
    seed : int
        Of all that is random.
    discrepancy : object
        What the scene says of its model's error.
    errors : object
        Those of the readings, as a scene states them.
    decades : (float, float), optional
        Between which the signal over the noise lies; left out: what the class is used with.
    """
    rng = np.random.default_rng(seed)
    c0 = math.exp(rng.normal(math.log(0.08), 0.8))
    c1 = 2 * math.sqrt(c0) * math.expm1(rng.normal(0.0, 0.25))
    c2 = math.exp(rng.normal(math.log(0.1), 0.5))
    count = int(rng.integers(12, 41))
    near = math.exp(rng.uniform(math.log(0.08), math.log(0.2)))
    far = min(near * math.exp(rng.uniform(math.log(4), math.log(20))), 2.4)
    ranges = np.exp(rng.uniform(math.log(near), math.log(far), count))
    middle = near * far
    signal = c0 * c2 / middle / (middle + c1 * math.sqrt(middle) + c0)
    read = signal / 10 ** rng.uniform(*(decades or _NOISE.get(name, (2.0, 4.0))))
    timing = {"pulse_width_s": 1e-7} if kind == "pulsed" else {"frequency_hz": 1e7}
    sensor = parse_sensor({"kind": kind, **timing, "noise": {"read": [read, read]}})
    truth: dict[str, Any] = {"object": {"c0": c0, "c1": c1, "c2": c2}}
    scene: dict[str, Any] = {
        "range_m": {"prior": "loguniform", "low": 0.02, "high": 7.0},
        "discrepancy": discrepancy,
    }
    if name in ("crosstalk", "everything"):
        truth["crosstalk"] = (rng.normal(0.0, 1.0, 2) * signal).tolist()
        scene["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": 3 * signal}] * 2
    if name in ("known background", "free shadow", "everything"):
        distance = float(rng.uniform(2.6, 7.0))
        wall: dict[str, Any] = {
            "strength": math.exp(rng.normal(0.0, 0.7)) / (2 * math.pi * distance**2),
            "distance_m": distance,
            "shadow": {
                "c0": c0 * math.exp(rng.normal(math.log(0.75), 0.3)),
                "c1": math.sqrt(c0) * abs(rng.normal(0.0, 0.2)),
            },
        }
        truth["background"] = wall
        scene["background"] = dict(wall)
        if name != "known background":
            del scene["background"]["shadow"]
        if name == "everything":
            scene["background"]["strength"] = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}
            scene["background"]["distance_m"] = {"prior": "uniform", "low": 2.5, "high": 7.4}
    present = np.ones(count, dtype=bool)
    if name == "everything" and rng.random() < 0.5:
        present[-3:] = False
    trajectory = SampledTrajectory(range_m=ranges.tolist(), object_present=present.tolist())
    simulation = simulate(sensor, parse_scene({**truth, "discrepancy": errors}), trajectory, seed)
    return RandomSet(sensor, parse_scene(scene), truth, simulation)


def far_set(kind: str, seed: int) -> RandomSet:
    """Draw a data set whose far frames are dark, behind crosstalk that is known to 3 %.

    Its object may be anywhere up to the sensor's reach, and is unknown, as is how well the model
    holds.

    Parameters
    ----------
    kind : str
        Of the sensor.
    seed : int
        Of all that is random.
    """
    rng = np.random.default_rng(seed)
    c0 = 0.1 * math.exp(rng.normal())
    c1 = 2 * math.sqrt(c0) * math.expm1(rng.normal(0.0, 0.3))
    c2 = 0.1 * math.exp(rng.normal(0.0, 0.7))
    signal = c0 * c2 / (1.0 + c1 + c0)  # at 1 m
    read = signal / 10 ** rng.uniform(1.0, 3.5)
    light = signal * 10 ** rng.uniform(-1.5, 1.0)
    if kind == "pulsed":
        crosstalk = light * np.array([0.3, 1.0])
        width = float(rng.choice([3e-8, 1e-7]))
        timing, reach = {"pulse_width_s": width}, 0.5 * SPEED_OF_LIGHT * width
    else:
        turn = rng.uniform(0.0, 2 * math.pi)
        crosstalk = light * np.array([math.cos(turn), math.sin(turn)])
        frequency = float(rng.choice([5e6, 1e7, 2e7]))
        timing, reach = {"frequency_hz": frequency}, 0.5 * SPEED_OF_LIGHT / frequency
    sd = 0.03 * light
    told = crosstalk + sd * rng.standard_normal(2)
    sensor = parse_sensor({"kind": kind, **timing, "noise": {"read": [read, read]}})
    truth = {"object": {"c0": c0, "c1": c1, "c2": c2}, "crosstalk": crosstalk.tolist()}
    scene = {"crosstalk": [{"prior": "normal", "mean": float(m), "sd": sd} for m in told]}
    ranges = np.exp(rng.uniform(math.log(0.05), math.log(0.95 * reach), 25))
    trajectory = SampledTrajectory(range_m=ranges.tolist())
    simulation = simulate(sensor, parse_scene({**truth, "discrepancy": 0}), trajectory, seed)
    return RandomSet(sensor, parse_scene(scene), truth, simulation)


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What became of one data set.

    Attributes
    ----------
    excess : float
        Deviance of the best optimum above that of a start at the truth; nan where the fit was
        refused.
    refused : bool
        Whether the fit was refused.
    shared : float
        Common relative standard deviation of the ranges: the larger one of the Cramer-Rao bound
        at the truth and of what a fit that starts there finds.
    misses : tuple of float
        (log r - truth) / standard deviation of every range that is unique.
    seconds : float
        Run time as the result states it.
    by_priors : bool
        Whether the priors of the unknowns count.
    """

    excess: float
    refused: bool
    shared: float
    misses: tuple[float, ...]
    seconds: float
    by_priors: bool = False

    @property
    def right(self) -> bool:
        """Same optimum (or a better one) as from the truth, or refused where the truth is open.

        Half the limit at the truth still counts as open: the bound at an optimum scatters.
        """
        return self.shared > LIMIT / 2 if self.refused else self.excess <= _SAME


def outcome_of(one: RandomSet) -> Outcome:
    """Fit without and with a start at the truth.

    Parameters
    ----------
    one : RandomSet
        The data set.
    """
    frames = one.simulation.frames
    problem = fit_problem(one.sensor, one.scene, frames)
    known = values_of(one.sensor, one.truth)
    truth = problem.coordinates(np.array([[known[name] for name in problem.names]]))[0]
    _, facts = residuals_and_information(problem, truth, np.log(one.simulation.range_m))
    shared = float(np.median(facts.sd_of(facts.response[problem.present])))
    reference = maximum_from(problem, truth)
    _, there = residuals_and_information(problem, reference.x, reference.positions)
    if there.rank == len(problem):
        wider, _, _ = inflation(problem, reference, there)
        own = float(np.median(there.sd_of(there.response[problem.present])))
        shared = max(shared, wider * own)
    found = estimate(one.sensor, one.scene, frames, ["joint_fit"])
    if not found.results:
        return Outcome(math.nan, True, shared, (), math.nan)
    (result,) = found.results
    assert result.fit is not None
    excess = best_of(result.fit) - reference.deviance
    if result.fit["by_priors"]:
        excess = best_of(result.fit) - best_with_priors(one, problem, truth)
    miss = np.log(result.range_m / one.simulation.range_m) / (result.sd_m / result.range_m)
    misses = tuple(miss[np.isfinite(miss)].tolist())
    by_priors = bool(result.fit["by_priors"])
    return Outcome(float(excess), False, shared, misses, result.runtime_s, by_priors)


def best_of(fit: Mapping[str, Any]) -> float:
    """Return the least deviance that a fit has found."""
    return float(fit["deviance"] + min(one["excess_deviance"] for one in fit["optima"]))


def best_with_priors(one: RandomSet, problem: FitProblem, truth: Array) -> float:
    """Return the deviance of a climb from the truth where the priors count, or the model errs."""
    start = Maximum(truth, 0.0, math.inf, np.log(one.simulation.range_m))
    if problem.erring:
        return erring_maxima(problem, [start])[0].deviance
    return prior_maxima(dataclasses.replace(problem, priors=True), [start])[0].deviance
