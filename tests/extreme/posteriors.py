"""Posteriors with one or two unknowns, held to quadrature over all of their prior."""

import dataclasses
import math
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import collapsed_density
from inference.posterior.answer.posterior import ParameterSummary, Posterior
from inference.posterior.infer import infer
from inference.posterior.sampling.diagnostics import effective_sample_size
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import PulsedSensor, Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.extreme.nested import Reference, reference_of
from tests.extreme.wall_curve import wall_curve
from tests.extreme.wall_turns import reference_of_turns

__all__ = ["PosteriorCase", "Verdict", "errors_of", "held", "quadrature_of", "random_case"]

Array = NDArray[np.float64]

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
SIGNAL_AT_1M = 7.72e-3
KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}
WALL: dict[str, Any] = {"strength": 0.0177, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}


@dataclasses.dataclass(frozen=True)
class PosteriorCase:
    """A posterior to be drawn."""

    name: str
    sensor: Sensor
    scene: Scene
    frames: Frames
    method: Literal["emcee", "importance"]
    seed: int


@dataclasses.dataclass(frozen=True)
class Verdict:
    """What came of it.

    Attributes
    ----------
    outcome : str
        held, widened (by what it owes to the law of the ranges: its log densities are held),
        wrong, flagged, refused, or without reference.
    precision : float
        Largest variance of the prior over that of the posterior, in prior's coordinates.
    worst : float
        Largest error of a number in units of its own Monte Carlo error; nan where nothing was
        drawn.
    what : str
        The unknown and which of its numbers, or the reason.
    """

    outcome: str
    precision: float
    worst: float
    what: str


def random_case(seed: int) -> PosteriorCase:
    """Draw a posterior: one or two unknowns, 1 to 8 frames, noise over 8 decades, hard edges."""
    rng = np.random.default_rng([15, seed])
    kind = str(rng.choice(list(KINDS)))
    truth: dict[str, Any] = {"object": OBJECT}
    which = str(rng.choice(["c2", "c0 and c2", "one crosstalk", "crosstalk", "strength", "wall"]))
    document: dict[str, Any] = {"object": dict(OBJECT), "discrepancy": 0}
    edge = bool(rng.random() < 0.3)

    def prior(value: float) -> dict[str, Any]:
        if edge:  # the truth at an end
            return {"prior": "uniform", "low": value, "high": value * 10 ** rng.uniform(0.1, 3)}
        return {"prior": "lognormal", "median": value * math.exp(rng.normal()), "sigma": 1.0}

    if which in ("c2", "c0 and c2"):
        for name in which.split(" and "):
            document["object"][name] = prior(OBJECT[name])
    elif "crosstalk" in which:
        truth["crosstalk"] = [0.002, 0.01]
        vague = {"prior": "normal", "mean": 0.0, "sd": 10 ** rng.uniform(-3, 0)}
        document["crosstalk"] = [vague, 0.01 if which == "one crosstalk" else vague]
    else:
        truth["background"] = WALL
        document["background"] = {**WALL, "strength": prior(WALL["strength"])}
        if which == "wall":
            document["background"]["distance_m"] = prior(WALL["distance_m"])
    if rng.random() < 0.5:
        document["range_m"] = {"prior": "loguniform", "low": 0.02, "high": 10.0}
    snr = 10 ** rng.uniform(-1, 7)
    frames = int(rng.integers(1, 9))
    read = SIGNAL_AT_1M / snr
    sensor = parse_sensor({**KINDS[kind], "noise": {"read": [read, read]}})
    path = SampledTrajectory(range_m=np.exp(rng.uniform(np.log(0.2), np.log(2), frames)).tolist())
    simulation = simulate(sensor, parse_scene(truth), path, int(rng.integers(1 << 30)))
    method: Literal["emcee", "importance"] = "importance" if rng.random() < 0.3 else "emcee"
    name = f"{kind}, {which}{', edge' if edge else ''}, SNR {snr:.2g}, {frames} frames"
    return PosteriorCase(name, sensor, parse_scene(document), simulation.frames, method, seed)


def quadrature_of(case: PosteriorCase) -> Reference | None:
    """Integrate a posterior, without any sampler; None where two quadratures differ."""
    density = collapsed_density(case.sensor, case.scene, case.frames)
    wall = case.scene.background
    sine = not isinstance(case.sensor, PulsedSensor)
    if wall is not None and sine and not isinstance(wall.distance_m, float | int):
        law = wall.distance_m.distribution().truncated(low=0.0)
        found = reference_of_turns(density, case.sensor, law)
        curve = wall_curve(density) if found is None else None
        return found if curve is None else curve.reference()
    return reference_of(density, density.parameters.natural, len(density.parameters.names))


def held(case: PosteriorCase, target_ess: int = 200, max_seconds: float = 60.0) -> Verdict:
    """Draw a posterior and hold it to quadrature: within 6 errors, or not converged."""
    exact = quadrature_of(case)
    if exact is None:
        return Verdict("without reference", math.nan, math.nan, "two quadratures differ")
    precision = exact.precision
    settings = SamplerSettings(
        method=case.method, seed=case.seed, target_ess=target_ess, max_seconds=max_seconds
    )
    try:
        posterior = infer(case.sensor, case.scene, case.frames, settings)
    except RefusedError as error:
        return Verdict("refused", precision, math.nan, str(error))
    if not posterior.verdict.converged:
        return Verdict("flagged", precision, math.nan, "; ".join(posterior.verdict.reasons))
    if posterior.draws.widened:
        return _widened(case, exact, posterior)
    off = {
        f"{name}, {what}": error
        for k, (name, summary) in enumerate(posterior.parameters.items())
        for what, error in errors_of(exact, k, summary, posterior.draws.parameters[..., k]).items()
    }
    what, worst = max(off.items(), key=lambda pair: pair[1])
    return Verdict("held" if worst <= 6 else "wrong", precision, worst, what)


def _widened(case: PosteriorCase, exact: Reference, posterior: Posterior) -> Verdict:
    """Hold an answer that owes to the law of the ranges, by which it is widened and says so.

    Its log densities are those of the posterior that was drawn.
    """
    density = collapsed_density(case.sensor, case.scene, case.frames)
    drawn, heights = posterior.draws.log_density, density(exact.z)
    heights = np.where(np.isfinite(heights), heights, 0.0)  # of no weight
    mean = exact.weights @ heights
    spread = math.sqrt(exact.weights @ (heights - mean) ** 2)
    off = abs(float(drawn.mean()) - float(mean)) / spread
    single = drawn.shape[0] == 1
    size = next(iter(posterior.parameters.values())).ess_bulk
    off *= math.sqrt(size if single else effective_sample_size(drawn))
    return Verdict("widened" if off <= 6 else "wrong", exact.precision, off, "log density")


def errors_of(
    exact: Reference, k: int, summary: ParameterSummary, draws: Array
) -> dict[str, float]:
    """Return how many of its Monte Carlo errors each number of a parameter is off.

    Parameters
    ----------
    exact : Reference
        The posterior.
    k : int
        Which unknown.
    summary : ParameterSummary
        What is reported of it; mean and standard deviation are nan where it has several modes.
    draws : ndarray, shape (ensembles, walkers, steps)
        Its draws; with importance sampling drawn once more by weight.

    Returns
    -------
    dict of str to float
        By name of the number; place and width are means of tanh((x - mean) / sd) and its square.
    """
    mean, sd = float(exact.mean[k]), float(exact.sd[k])

    def many(values: Array) -> float:
        if summary.rhat is not None:
            return effective_sample_size(values)
        return 1 / (1 / summary.ess_bulk + 1 / draws.size)  # weighted, then drawn by weight

    def bounded(values: Array) -> Array:
        return np.tanh((values - mean) / sd)

    off = {}
    if not math.isnan(summary.mean):  # of several modes none is reported
        off["mean"] = abs(summary.mean - mean) / summary.mcse_mean
        # a variance is a mean of squares: its error is theirs, with as many draws as are effective
        # for squares, and with the posterior's own fourth moment, which few draws of a heavy tail
        # have: of a lognormal law of width 1 it makes the error seven times that of a normal one
        spread = math.sqrt(max(float(exact.moment(4)[k]) - sd**4, 0.0))
        off["sd"] = abs(summary.sd**2 - sd**2) / spread * math.sqrt(many((draws - mean) ** 2))
    # what no tail can move says more of the rest
    inner = bounded(exact.values[:, k])
    for name, seen, drawn in (
        ("place", inner, bounded(draws)),
        ("width", inner**2, bounded(draws) ** 2),
    ):
        centre = exact.weights @ seen
        error = math.sqrt(exact.weights @ (seen - centre) ** 2 / many(drawn))
        off[name] = abs(float(drawn.mean()) - float(centre)) / error
    return off
