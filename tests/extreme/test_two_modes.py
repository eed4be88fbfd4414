"""Two modes of weights 0.999 and 0.001: both are found, with their weights.

A sine wave does not tell a wall from one that is half a wavelength farther; its prior does. Of two
in a normal prior a search meets both. In a lognormal one, of a longer wave, each is a hundred
thousandth as wide as the prior, and the rare one lies in its tail.
"""

import math
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

WALL_M = 3.0
RARE = 1e-3


def _normal(half_m: float) -> dict[str, Any]:
    """Return a prior of 2 m, a thousand times as dense at the nearer wall."""
    mean = WALL_M + half_m / 2 + 4 * math.log(RARE) / half_m
    return {"prior": "normal", "mean": mean, "sd": 2.0}


def _lognormal(half_m: float) -> dict[str, Any]:
    """Return a prior over a factor of e either way, of the same kind."""
    near, far = math.log(WALL_M), math.log(WALL_M + half_m)
    # log of the ratio of densities: near - far - ((far - m)^2 - (near - m)^2) / 2
    middle = (near + far) / 2 + (math.log(RARE) + far - near) / (far - near)
    return {"prior": "lognormal", "median": math.exp(middle), "sigma": 1.0}


@pytest.mark.parametrize(
    ("frequency_hz", "read", "law"), [(2e7, 1e-5, _normal), (5e6, 1e-7, _lognormal)]
)
@pytest.mark.parametrize("method", ["importance", "emcee"])
def test_a_rare_mode_is_found_and_weighed(
    method: Literal["importance", "emcee"],
    frequency_hz: float,
    read: float,
    law: Callable[[float], dict[str, Any]],
) -> None:
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": frequency_hz, "noise": {"read": [read, read]}}
    )
    half = 299792458 / frequency_hz / 2  # wavelength [m]
    wall = {"strength": 0.0177, "distance_m": WALL_M, "shadow": {"c0": 0.056, "c1": 0.013}}
    bare = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}, "discrepancy": 0}
    near = {"range_m": {"prior": "loguniform", "low": 0.05, "high": 2.5}}
    scene = parse_scene({**bare, **near, "background": {**wall, "distance_m": law(half)}})
    path = SampledTrajectory(range_m=np.geomspace(0.3, 1.5, 6).tolist())
    frames = simulate(sensor, parse_scene({**bare, "background": wall}), path, 1).frames

    density = collapsed_density(sensor, scene, frames)
    about = np.linspace(-5e3, 5e3, 4001) * read
    centres = WALL_M + half * np.arange(3)
    z = density.parameters.standard((centres[:, None] + about).reshape(-1, 1))
    height = density(z).reshape(3, -1)
    steps = np.gradient(z.reshape(3, -1), axis=1)
    mass = (np.exp(height - height.max()) * steps).sum(axis=1)
    weights = mass / mass.sum()
    assert weights[1] == pytest.approx(RARE, rel=0.01)
    assert weights[2] < 1e-4

    settings = SamplerSettings(method=method, seed=2, target_ess=100)
    posterior = infer(sensor, scene, frames, settings)
    assert posterior.verdict.converged, posterior.verdict.reasons
    modes = posterior.parameters["background.distance_m"].modes
    assert len(modes) >= 2  # the third has a few draws, or none
    for mode, centre, weight in zip(modes, centres, weights, strict=False):
        assert mode.value == pytest.approx(centre, abs=0.01)
        assert mode.weight_error is not None
        # counts of some twenty have tails: with these errors a false alarm once in 1e4 seeds
        assert abs(mode.weight - weight) <= 5 * mode.weight_error
