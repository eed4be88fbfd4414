"""Frames near a fold are named, and no others."""

import math
from typing import Any

import numpy as np
import pytest

from inference.posterior.answer.folds import near_fold
from inference.posterior.fold import prepare
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import example

SETTINGS = SamplerSettings(seed=1)
STRENGTH = 1 / (50 * math.pi)
WALL: dict[str, Any] = {
    "strength": {"prior": "lognormal", "median": STRENGTH, "sigma": 0.3},
    "distance_m": 5.0,
    "shadow": {"c0": 0.0596, "c1": 0.0132},
}
# the top of what an unknown strength leaves of the readings, beyond half a turn
HUMP = 1.66038086880


def waves(r: float, read: float, known: bool = False, scale: float = 1.0) -> bool:
    """Whether a sine wave before a wall is near a fold, its readings made at range r."""
    sensor = parse_sensor(
        {
            "kind": "sine_wave",
            "frequency_hz": 20e6,
            "gain": scale,
            "noise": {"read": [scale * read, scale * read]},
        }
    )
    prior = WALL["strength"] | {"median": scale * STRENGTH}
    wall = WALL | {"strength": scale * STRENGTH if known else prior}
    scene = parse_scene({"object": {"c0": 0.0817, "c1": 0.0574, "c2": 0.103}, "background": wall})
    job = prepare(sensor, scene, Frames(np.zeros((1, 2))), SETTINGS)
    density = job.density()
    # the prior's median is the truth
    z = np.zeros((4, len(density.parameters)))
    return bool(near_fold(job, density, z, np.full((4, 1), math.log(r)))[0])


@pytest.mark.parametrize("read", [1e-5, 1e-7, 1e-9])
def test_the_top_of_a_hump_is_a_fold(read: float) -> None:
    """The background's strength unknown, a frame tells one number: a hump over the range. With
    sensor noise s its top is a fold for ranges within about sqrt(3 s / curvature)."""
    assert waves(HUMP, read)
    near = 0.1 * math.sqrt(read / 1e-5)  # the hump falls by 3.5e-4 on its way to the far end
    assert waves(HUMP * (1 - 0.1 * near), read)
    assert not waves(HUMP * (1 - 5 * near), read)


def test_with_the_strength_known_there_is_none() -> None:
    assert not waves(HUMP, 1e-7, known=True)


@pytest.mark.parametrize("scale", [2.0**-40, 1e12])
def test_units_change_nothing(scale: float) -> None:
    assert waves(HUMP, 1e-6, scale=scale)
    assert not waves(2.5, 1e-6, scale=scale)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("crosstalk", [False, True])
def test_ordinary_frames_are_far_from_any(kind: str, crosstalk: bool) -> None:
    sensor, scene, frames = example(kind, crosstalk)
    job = prepare(sensor, scene, frames, SETTINGS)
    density = job.density()
    z = 0.1 * np.random.default_rng(210).standard_normal((8, len(density.parameters)))
    ranges = np.log(np.tile(np.geomspace(0.1, 2.0, 20), (8, 1)))
    assert not near_fold(job, density, z, ranges).any()


def test_an_object_whose_intensity_turns_back() -> None:
    """c1 near its limit: with the late window all noise, the flux's minimum and maximum are folds
    (intensity has three roots between them)."""
    c0, c1 = 0.1, -0.6164414
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [100.0, 1e-3]}}
    )
    scene = parse_scene({"object": {"c0": c0, "c1": c1, "c2": 0.1}})
    ranges = np.array([0.172535328441, 0.289795721559, 0.12, 0.23, 0.5])
    job = prepare(sensor, scene, Frames(np.ones((5, 2))), SETTINGS)
    found = near_fold(job, job.density(), np.empty((1, 0)), np.log(ranges)[None])
    assert found.tolist() == [True, True, False, False, False]


def test_saturated_and_empty_frames_have_none() -> None:
    """And what is said of a frame stands in the place of that frame."""
    noise = {"read": [1e-7, 1e-7]}
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 20e6, "noise": noise, "full_scale": [1.0, 1.0]}
    )
    scene = parse_scene({"object": {"c0": 0.0817, "c1": 0.0574, "c2": 0.103}, "background": WALL})
    saturated, dark = [1.0, 1.0], [0.0, 0.0]
    for readings, present, log_r, wanted in (
        # an empty frame would tell the strength, and with it there is no fold
        ([saturated, saturated, dark], [True] * 3, [math.log(HUMP)], [False, False, True]),
        ([saturated, dark, dark], [True, False, True], [math.nan, math.log(HUMP)], [False] * 3),
    ):
        frames = Frames(np.array(readings), object_present=np.array(present))
        job = prepare(sensor, scene, frames, SETTINGS)
        density = job.density()
        z = np.zeros((4, len(density.parameters)))
        found = near_fold(job, density, z, np.repeat([log_r], 4, axis=0))
        assert found.tolist() == wanted
