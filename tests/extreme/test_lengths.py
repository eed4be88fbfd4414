"""What must hold of lengths, of small angles, and of terms of no width."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.density.collapsed import collapsed_density
from inference.estimate import estimate
from inference.estimates import TechniqueResult
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import track
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
WALL: dict[str, Any] = {"strength": 0.0177, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}
PATH = np.linspace(0.3, 2.5, 9)
NOISE = 1e-6


def lengths(scene: dict[str, Any], unit: float) -> dict[str, Any]:
    """State a scene in another unit of length."""
    power = {"c0": 2, "c1": 1, "distance_m": 1, "low": 1, "high": 1}

    def scaled(part: dict[str, Any]) -> dict[str, Any]:
        return {
            key: scaled(value)
            if isinstance(value, dict)
            else value * unit ** power[key]
            if key in power
            else value
            for key, value in part.items()
        }

    return scaled(scene)


def sensor(kind: str, unit: float) -> dict[str, Any]:
    own: dict[str, Any] = {"kind": "pulsed", "pulse_width_s": 1e-7 * unit}
    if kind == "sine_wave":
        own = {"kind": "sine_wave", "frequency_hz": 5e6 / unit, "phase_offset_rad": 0.3}
    noise = {"read": [NOISE, NOISE], "shot": 1e-9, "derivative": [NOISE, NOISE]}
    return {**own, "gain": unit**2, "noise": noise}


SCENES: dict[str, tuple[dict[str, Any], list[str]]] = {
    "object": ({}, ["conventional", "intensity", "differential"]),
    "wall": (
        {"background": WALL},
        ["background_cancelling", "background_intensity", "background_cancelling_differential"],
    ),
}
DOCUMENTS = {
    name: {
        "object": OBJECT,
        **terms,
        "discrepancy": {"flux": 0.02, "range_m": 0.0},
        "range_m": {"prior": "loguniform", "low": 0.1, "high": 14.0},
    }
    for name, (terms, _) in SCENES.items()
}


def frames_of(kind: str, name: str) -> Frames:
    """Noisy readings, and derivatives of an object at 1 m/s that have next to no noise."""
    scene = parse_scene({**DOCUMENTS[name], "discrepancy": 0})
    time_s = (0.05 * np.arange(PATH.size)).tolist()

    def read(ranges: NDArray[np.float64], noise: float) -> Frames:
        document = {**sensor(kind, 1.0), "noise": {"read": [noise, noise]}}
        at = SampledTrajectory(range_m=ranges.tolist(), time_s=time_s)
        return simulate(parse_sensor(document), scene, at, 3).frames

    step = 1e-4
    before, after = (read(PATH + way * step, 1e-30).readings for way in (-1, 1))
    return dataclasses.replace(read(PATH, NOISE), derivatives=(after - before) / (2 * step))


@pytest.mark.parametrize("unit", [2.0**-24, 2.0**18])
@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("name", SCENES)
def test_no_technique_depends_on_the_unit_of_length(name: str, kind: str, unit: float) -> None:
    """A power of two: but for logarithms nothing is rounded differently."""
    frames, techniques = frames_of(kind, name), SCENES[name][1]

    def answers(u: float) -> tuple[TechniqueResult, ...]:
        scene = parse_scene(lengths(DOCUMENTS[name], u))
        return estimate(parse_sensor(sensor(kind, u)), scene, frames, techniques).results

    for one, other in zip(answers(1.0), answers(unit), strict=True):
        assert one.root_count.sum() >= PATH.size - 1, one.technique
        assert np.array_equal(one.status, other.status)
        np.testing.assert_allclose(other.roots_m / unit, one.roots_m, rtol=1e-13)
        np.testing.assert_allclose(other.roots_sd_m / unit, one.roots_sd_m, rtol=1e-9)


@pytest.mark.parametrize("technique", [t for _, names in SCENES.values() for t in names])
def test_at_small_angles_a_sine_wave_is_a_pulse(technique: str) -> None:
    """(i, q) = (w2, k r0 w1) to second order in the angle of R."""
    name = "wall" if technique.startswith("background") else "object"
    scene = parse_scene({**DOCUMENTS[name], "discrepancy": 0})
    pulsed = parse_sensor(sensor("pulsed", 1.0))
    frames = frames_of("pulsed", name)
    factor = 4 * np.pi * 100.0 / 299792458.0 * pulsed.max_range_m
    noise = {"read": [NOISE, NOISE * factor], "derivative": [NOISE, NOISE * factor]}
    wave = parse_sensor({"kind": "sine_wave", "frequency_hz": 100.0, "noise": noise})
    assert frames.derivatives is not None
    shown = Frames(
        frames.readings[:, ::-1] * [1.0, factor],
        time_s=frames.time_s,
        derivatives=frames.derivatives[:, ::-1] * [1.0, factor],
    )
    (one,) = estimate(pulsed, scene, frames, [technique]).results
    (other,) = estimate(wave, scene, shown, [technique]).results
    assert one.root_count.sum() >= PATH.size - 1
    both = min(one.roots_m.shape[1], other.roots_m.shape[1])
    # k R is 1.3e-5, its square 1.6e-10; by the fold of a pair an error grows by its root
    assert np.array_equal(one.root_count, other.root_count)
    np.testing.assert_allclose(other.roots_m[:, :both], one.roots_m[:, :both], rtol=1e-8)


TERMS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "crosstalk": ({}, {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 1e-12}] * 2}),
    "wall": (
        {},
        {"background": {**WALL, "strength": {"prior": "halfnormal", "sd": 1e-12}}},
    ),
}


@pytest.mark.parametrize("name", TERMS)
def test_a_term_of_no_width_is_none(name: str) -> None:
    """For the collapsed density and, of crosstalk, for the tracker that learns it."""
    without, beside = TERMS[name]
    stated = parse_sensor({**sensor("pulsed", 1.0), "noise": {"read": [NOISE, NOISE]}})
    base = {**DOCUMENTS["object"], "discrepancy": 0}
    base["range_m"] = {"prior": "loguniform", "low": 0.1, "high": 2.9}
    frames = frames_of("pulsed", "object")
    one, other = parse_scene({**base, **without}), parse_scene({**base, **beside})
    a = collapsed_density(stated, one, frames).log_likelihood(np.zeros((1, 0)))
    unknowns = collapsed_density(stated, other, frames)
    z = np.zeros((1, len(unknowns.parameters.names)))
    assert unknowns.log_likelihood(z) == pytest.approx(a, abs=1e-3)
    if name != "crosstalk":
        return  # a tracker asks for the number, or for a posterior
    a_track, b_track = (track(stated, s, frames, TrackingSettings()) for s in (one, other))
    assert np.isfinite(a_track.range_m).all()
    # one sums over a frame's modes, the other linearises about each: 0.008 standard deviations
    assert (np.abs(a_track.range_m - b_track.range_m) < 0.05 * a_track.sd_m).all()


def test_frames_of_any_size_are_as_their_parts() -> None:
    """A technique gives one frame of 100,000 what it gives it alone, bit for bit."""
    frames = frames_of("pulsed", "wall")
    scene, stated = parse_scene(DOCUMENTS["wall"]), parse_sensor(sensor("pulsed", 1.0))
    rows: NDArray[np.intp] = np.random.default_rng(2).integers(0, PATH.size, 100_000)
    many = dataclasses.replace(frames.select(rows), time_s=None)
    few = dataclasses.replace(frames, time_s=None)
    names = ["background_cancelling", "background_intensity"]
    for whole, part in zip(
        estimate(stated, scene, many, names).results,
        estimate(stated, scene, few, names).results,
        strict=True,
    ):
        assert np.array_equal(whole.roots_m, part.roots_m[rows], equal_nan=True)
        assert np.array_equal(whole.roots_sd_m, part.roots_sd_m[rows], equal_nan=True)
