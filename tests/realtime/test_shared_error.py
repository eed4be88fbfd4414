"""What single frames owe to a scene that is known by a joint law."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import LeftOut, TechniqueResult
from inference.plan import plan
from inference.realtime.registry import TECHNIQUES
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import Simulation, simulate
from simulator.trajectories import RadialTrajectory

NOISE = {"read": [1e-12, 1e-12], "derivative": [1e-12, 1e-12]}
PULSED = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": NOISE})
SINE = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": NOISE})
VAGUE = {"prior": "normal", "mean": 0.003, "sd": 0.05}
WALL = {
    "strength": {"prior": "lognormal", "median": 0.0177, "sigma": 1.0},
    "distance_m": {"prior": "lognormal", "median": 4.0, "sigma": 0.5},
}
UNKNOWN: dict[str, dict[str, Any]] = {
    "crosstalk": {"crosstalk": [VAGUE, VAGUE]},
    "wall": {"crosstalk": [VAGUE, VAGUE], "background": WALL},
}
SD = 1e-3  # of a prior: so narrow that roots follow linearly


def law_of(sensor: Sensor, stated: dict[str, Any], sd: float = SD) -> Scene:
    """A joint law of all unknowns, strongly correlated, about the medians of their priors."""
    names = parameters_of(sensor, parse_scene(stated)).names
    rng, d = np.random.default_rng(5), len(names)
    root = sd * np.tril(rng.normal(size=(d, d)) + np.eye(d))
    mode = {"mean": [0.0] * len(names), "covariance": (root @ root.T).tolist()}
    joint = {"unknowns": list(names), "modes": [mode]}
    return parse_scene(stated | {"joint": joint, "discrepancy": 0})


def numbers(sensor: Sensor, scene: Scene, count: int, seed: int) -> Iterator[Scene]:
    """Scenes of known numbers, drawn from the law of a scene."""
    parameters = parameters_of(sensor, scene)
    for row in parameters.natural(parameters.sample(np.random.default_rng(seed), count)):
        of = dict(zip(parameters.names, row.tolist(), strict=True))
        first, second = sensor.columns
        document: dict[str, Any] = {
            "object": {name: of[f"object.{name}"] for name in ("c0", "c1", "c2")},
            "crosstalk": [of[f"crosstalk.{first}"], of[f"crosstalk.{second}"]],
            "discrepancy": 0,
        }
        if scene.background is not None:
            path = "background."
            document["background"] = {
                "strength": of[f"{path}strength"],
                "distance_m": of[f"{path}distance_m"],
                "shadow": {name: of[f"{path}shadow.{name}"] for name in ("c0", "c1")},
            }
        yield parse_scene(document)


def readings(sensor: Sensor, scene: Scene) -> Simulation:
    (known,) = numbers(sensor, scene, 1, 9)
    return simulate(sensor, known, RadialTrajectory(from_m=0.5, to_m=1.2, frames=12), 1)


def solved(sensor: Sensor, scene: Scene, made: Simulation, name: str) -> TechniqueResult | LeftOut:
    found = estimate(sensor, scene, made.frames, [name])
    return found.results[0] if found.results else found.left_out[-1]


@pytest.mark.parametrize("sensor", [PULSED, SINE], ids=["pulsed", "sine_wave"])
@pytest.mark.parametrize("terms", UNKNOWN)
def test_the_scenes_part_is_how_roots_follow_draws_of_the_law(sensor: Sensor, terms: str) -> None:
    """Standard deviations of 300 draws, within five standard errors: false alarms below 1e-5."""
    scene, count, served = law_of(sensor, UNKNOWN[terms]), 300, []
    made = readings(sensor, scene)
    for name in TECHNIQUES:
        found = solved(sensor, scene, made, name)
        if isinstance(found, LeftOut):
            continue
        served.append(name)
        drawn = []
        for known in numbers(sensor, scene, count, 2):
            each = solved(sensor, known, made, name)
            assert isinstance(each, TechniqueResult)
            drawn.append(each.roots_m[:, 0])
        sd = np.std(drawn, axis=0)
        assert found.sd_parts_m is not None
        shared = found.sd_parts_m.scene[:, 0]
        inner = np.isfinite(found.roots_sd_m[:, 0]) & np.isfinite(sd)
        assert inner.sum() >= 6
        tolerance = 5 / math.sqrt(2 * count) + 20 * SD
        assert np.allclose(shared[inner], sd[inner], rtol=tolerance, atol=1e-12), name
        whole = np.sqrt(sum(np.square(part[:, 0]) for part in found.sd_parts_m))
        assert np.allclose(found.roots_sd_m[inner, 0], whole[inner])
    chosen = plan(sensor, scene).chosen
    assert chosen in served
    assert len(served) >= 2
    if terms == "crosstalk":
        assert {"conventional", "intensity"} <= set(served)


def test_a_root_that_a_standard_deviation_of_the_scene_removes_has_none() -> None:
    """Crosstalk as large as the reading: on one side nothing is left of the object."""
    crosstalk = [0.0, {"prior": "normal", "mean": 0.0, "sd": 1.0}]
    joint = {"unknowns": ["crosstalk.w2"], "modes": [{"mean": [0.0], "covariance": [[1.0]]}]}
    known = {"object": {"c0": 0.08, "c1": 0.0, "c2": 0.1}, "discrepancy": 0}
    scene = parse_scene(known | {"crosstalk": crosstalk, "joint": joint})
    path = RadialTrajectory(from_m=0.9, to_m=1.2, frames=2)
    frames = simulate(PULSED, parse_scene(known), path, 1).frames
    found = estimate(PULSED, scene, frames, ["intensity"]).results[0]
    assert np.isfinite(found.range_m).all()
    assert found.near_fold.all()
    assert np.isnan(found.sd_m).all()


def test_what_the_law_does_not_name_stays_unknown() -> None:
    joint = {"unknowns": ["crosstalk.w1"], "modes": [{"mean": [0.0], "covariance": [[1e-6]]}]}
    scene = parse_scene(UNKNOWN["crosstalk"] | {"joint": joint})
    reasons = {each.name: each.reason for each in plan(PULSED, scene).left_out}
    assert "crosstalk, and the scene's is unknown" in reasons["conventional"]
