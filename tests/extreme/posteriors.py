"""Posteriors with one or two unknowns, held to quadrature over all of their prior."""

import dataclasses
import math
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import collapsed_density
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["PosteriorCase", "Verdict", "exact_moments", "held", "random_case"]

Array = NDArray[np.float64]

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
SIGNAL_AT_1M = 7.72e-3
KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}
WALL: dict[str, Any] = {"strength": 0.0177, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}
_POINTS = {1: 2001, 2: 81}
_SPAN = 9.0  # standard deviations


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
        held, wrong, flagged, refused, or without reference.
    precision : float
        Largest variance of the prior over that of the posterior, in prior's coordinates.
    worst : float
        Largest error of a mean in units of its MCSE; nan where nothing was drawn.
    what : str
        The unknown, or the reason.
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


def exact_moments(case: PosteriorCase) -> tuple[Array, Array, float] | None:
    """Integrate a posterior on a grid that is carried from the prior to it.

    Returns
    -------
    (ndarray, ndarray, float) or None
        Means and standard deviations of the unknowns, and the prior's largest variance over the
        posterior's; None where the grid does not hold it (several narrow modes).
    """
    density = collapsed_density(case.sensor, case.scene, case.frames)
    d = len(density.parameters.names)
    line = np.linspace(-1, 1, _POINTS[d])
    unit = np.stack(np.meshgrid(*[line] * d, indexing="ij"), axis=-1).reshape(-1, d)
    edge = (np.abs(unit) == 1).any(axis=1)
    centre, axes = np.zeros(d), np.eye(d) * 8.5
    for _ in range(80):
        z = centre + unit @ axes.T
        height = np.concatenate([density(part) for part in np.array_split(z, 8)])
        height = np.where(np.isfinite(height), height, -np.inf)
        height -= height.max()
        hot = _temperature(height, 12.0**d)
        weights = np.exp(height / hot)
        weights /= weights.sum()
        if hot == 1.0 and weights[edge].sum() < 1e-6 and np.square(weights).sum() * 12**d < 1:
            values = density.parameters.natural(z)
            mean = weights @ values
            sd = np.sqrt(weights @ (values - mean) ** 2)
            narrow = np.sqrt(weights @ (z - weights @ z) ** 2)
            return mean, sd, float(1 / narrow.min() ** 2)
        centre = weights @ z
        spread = np.atleast_2d(np.cov(z.T, aweights=weights, ddof=0))
        values, vectors = np.linalg.eigh(spread)
        axes = vectors * np.sqrt(np.maximum(values, 1e-30)) * _SPAN
    return None


def _temperature(height: Array, points: float) -> float:
    """Return the least temperature, at least 1, at which so many points count."""

    def count(hot: float) -> float:
        w = np.exp(height / hot)
        return float(w.sum() ** 2 / np.square(w).sum())

    if count(1.0) >= points:
        return 1.0
    low, high = 0.0, 60.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if count(math.exp(middle)) >= points else (middle, high)
    return math.exp(high)


def held(case: PosteriorCase, target_ess: int = 200, max_seconds: float = 60.0) -> Verdict:
    """Draw a posterior and hold its means to quadrature: within 6 MCSE, or not converged."""
    exact = exact_moments(case)
    if exact is None:
        return Verdict("without reference", math.nan, math.nan, "")
    mean, sd, precision = exact
    settings = SamplerSettings(
        method=case.method, seed=case.seed, target_ess=target_ess, max_seconds=max_seconds
    )
    try:
        posterior = infer(case.sensor, case.scene, case.frames, settings)
    except RefusedError as error:
        return Verdict("refused", precision, math.nan, str(error))
    if not posterior.verdict.converged:
        return Verdict("flagged", precision, math.nan, "; ".join(posterior.verdict.reasons))
    worst, what = 0.0, ""
    for k, (name, summary) in enumerate(posterior.parameters.items()):
        off = abs(summary.mean - mean[k]) / summary.mcse_mean
        # the error of a standard deviation is sd / sqrt(2 ESS) for a normal law, more with tails
        wide = abs(math.log(summary.sd / sd[k])) * math.sqrt(2 * summary.ess_bulk) / 1.5
        if max(off, wide) > worst:
            worst, what = max(off, wide), f"{name}{' sd' if wide > off else ''}"
    return Verdict("held" if worst <= 6 else "wrong", precision, worst, what)
