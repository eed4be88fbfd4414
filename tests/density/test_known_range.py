"""Ranges that are known beside the readings: densities and draws held to slow quadrature."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate

from inference.density.collapsed import collapsed_density
from inference.density.discrepant import with_discrepancy
from inference.density.profile import linearise
from inference.density.static import with_common_range
from inference.density.whitened import whitened
from simulator.frames import Frames
from simulator.parameters import OFFSET
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

Array = NDArray[np.float64]

PLATE = {"c0": 0.08, "c1": -0.12, "c2": 0.1}
NOTHING = np.empty((1, 0))
KINDS = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}
LAWS: dict[str, Any] = {
    "reference": None,
    "loguniform": {"prior": "loguniform", "low": 0.02, "high": 10.0},
    "normal": {"prior": "normal", "mean": 1.2, "sd": 0.4},
}


def seen(kind: str, known: Array, sd: Array, **noise: float) -> tuple[Any, dict[str, Any], Frames]:
    """Frames at 0.6, 1 and 2 m of a noisy sensor, ranges told as given."""
    sensor = parse_sensor(KINDS[kind] | {"noise": {"read": [1e-4, 4e-4], **noise}})
    scene: dict[str, Any] = {"object": PLATE, "crosstalk": [0.001, 0.002]}
    path = SampledTrajectory(range_m=[0.6, 1.0, 2.0])
    frames = simulate(sensor, parse_scene(scene | {"discrepancy": 0}), path, 3).frames
    return sensor, scene, Frames(frames.readings, known_range_m=known, known_range_sd_m=sd)


def without(frames: Frames) -> Frames:
    return Frames(frames.readings)


def pointwise(sensor: Any, reading: Array, r: Array) -> Array:
    """Log density of one frame's readings given r, written anew."""
    strength: float = sensor.known_gain * PLATE["c0"] * PLATE["c2"]
    means: tuple[Array, Array]
    flux = strength / (r**2 * (r**2 + PLATE["c1"] * r + PLATE["c0"]))
    if sensor.kind == "pulsed":
        means = flux * r / sensor.r0, flux
    else:
        means = flux * np.cos(sensor.wave_number * r), flux * np.sin(sensor.wave_number * r)
    means = means[0] + 0.001, means[1] + 0.002
    off = (reading[:, None] - np.array(means)) / np.array(sensor.noise.read)[:, None]
    constant = math.log(2 * math.pi) + np.log(sensor.noise.read).sum()
    return np.asarray(-0.5 * np.square(off).sum(axis=0) - constant)


def information(sensor: Any, r: Array) -> Array:
    """Fisher information on log r by central differences of the means."""

    def means(r: Array) -> Array:
        flux = sensor.known_gain * PLATE["c0"] * PLATE["c2"]
        flux = flux / (r**2 * (r**2 + PLATE["c1"] * r + PLATE["c0"]))
        if sensor.kind == "pulsed":
            return np.array([flux * r / sensor.r0, flux])
        angle = sensor.wave_number * r
        return np.array([flux * np.cos(angle), flux * np.sin(angle)])

    h = 1e-5
    slope = (means(r * math.exp(h)) - means(r * math.exp(-h))) / (2 * h)
    return np.asarray(np.square(slope / np.array(sensor.noise.read)[:, None]).sum(axis=0))


def dark_of(sensor: Any, low: float, high: float) -> float:
    """What readings alone do not resolve has the mass of one state, or less."""
    u = np.linspace(math.log(low), math.log(high), 20_001)
    unresolved = 5.0 / np.sqrt(1.0 + information(sensor, np.exp(u)) / 25.0)
    return float(min(math.sqrt(2 * math.pi * math.e) / integrate.trapezoid(unresolved, u), 1.0))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("sd", [1e-5, 0.003, 0.1])
def test_likelihood_against_quadrature(kind: str, law: str, sd: float) -> None:
    """The knowledge multiplies the law of the range, and is part of what a reference resolves."""
    told = np.array([0.6 + sd, np.nan, 2.0 - 2 * sd if sd < 0.5 else 3.0])
    sensor, scene, frames = seen(kind, told, np.array([sd, np.nan, sd]))
    stated = parse_scene(scene if LAWS[law] is None else scene | {"range_m": LAWS[law]})
    density = collapsed_density(sensor, stated, frames)
    found = density.frame_log_likelihoods(NOTHING)[0]
    plain = collapsed_density(sensor, stated, without(frames)).frame_log_likelihoods(NOTHING)[0]
    assert found[1] == plain[1]
    prior: Any = density.parameters.range_prior
    low, high = max(prior.low, 1e-4), min(prior.high, 10.0)
    dark = dark_of(sensor, low, prior.high) if law == "reference" else 1.0
    for j in (0, 2):

        def log_density(u: Array, j: int = j) -> Array:
            r = np.exp(u)
            value = pointwise(sensor, frames.readings[j], r)
            value = value - 0.5 * ((r - told[j]) / sd) ** 2
            if law == "reference":
                resolved = (information(sensor, r) + (r / sd) ** 2) / 25.0
                value = value + np.log((resolved + dark) / np.sqrt(1.0 + resolved))
            else:
                value = value + u + prior.log_density(r)
            return np.asarray(value)

        grid = np.unique(
            np.concatenate(
                [
                    np.linspace(math.log(low), math.log(high), 60_001),
                    np.log(np.clip(told[j] + sd * np.linspace(-10, 10, 2001), low, high)),
                ]
            )
        )
        values = log_density(grid)
        top = values.max()
        expected = top + math.log(integrate.trapezoid(np.exp(values - top), grid))
        assert found[j] == pytest.approx(expected, abs=2e-3)


def test_a_range_known_to_next_to_nothing_changes_nothing() -> None:
    """In the limit the reference prior is what it was, however the range is told."""
    told, sd = np.array([0.6, 1.0, 2.0]), np.full(3, 1e9)
    sensor, scene, frames = seen("pulsed", told, sd)
    found = collapsed_density(sensor, parse_scene(scene), frames)(NOTHING)
    plain = collapsed_density(sensor, parse_scene(scene), without(frames))(NOTHING)
    assert found == pytest.approx(plain, abs=1e-9)
    null = Frames(frames.readings, known_range_m=0 * told + np.nan, known_range_sd_m=sd)
    assert collapsed_density(sensor, parse_scene(scene), null)(NOTHING) == plain


@pytest.mark.parametrize("common", [False, True])
def test_draws_follow_what_is_known(common: bool) -> None:
    """Each range is drawn from its own law; 4000 draws, mean within 5 standard errors."""
    told = np.array([0.6, np.nan, 2.0])
    sd = np.array([1e-4, np.nan, 1e-4])
    if common:
        told = np.array([0.9, np.nan, 0.9001])
    sensor, scene, frames = seen("pulsed", told, sd)
    if common:
        frames = Frames(
            np.repeat(frames.readings[[1]], 3, axis=0), known_range_m=told, known_range_sd_m=sd
        )
        scene = scene | {"motion": "static"}
    density = collapsed_density(sensor, parse_scene(scene), frames)
    if common:
        density = with_common_range(density)
    z = np.empty((4000, 0))
    drawn = np.exp(density.draw_log_ranges(z, np.random.default_rng(1)))
    if common:  # the readings are at 1 m, told by a hundred times worse than the ruler
        assert np.ptp(drawn, axis=1).max() == 0.0
        assert drawn[:, 0].mean() == pytest.approx(0.90005, abs=2e-4)
        assert drawn[:, 0].std() == pytest.approx(1e-4 / math.sqrt(2), rel=0.1)
        return
    for j in (0, 2):
        assert drawn[:, j].mean() == pytest.approx(told[j], abs=3e-5)
        assert drawn[:, j].std() == pytest.approx(1e-4, rel=0.1)
    assert drawn[:, 1].std() > 1e-3


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("flux", [0.0, 0.05])
def test_linearisation_against_differences(kind: str, flux: float) -> None:
    """The slope of half the profile deviance along z is J^T residual, what is known included."""
    told, sd = np.array([0.61, np.nan, 1.98]), np.array([0.004, np.nan, 0.01])
    sensor, scene, frames = seen(kind, told, sd)
    free = scene | {
        "object": {**PLATE, "c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.3}},
        "range_m": LAWS["loguniform"],
    }
    density = collapsed_density(sensor, parse_scene(free), frames)
    if flux:
        density = with_discrepancy(density, flux)
    z = np.array([0.05])
    line = linearise(density, z, density.best_ranges(z[None])[0, :, 0])
    slope = float(line.jacobian.reshape(-1) @ line.residual.reshape(-1))
    h = 1e-4
    ends = [density.total(density.best_ranges(z[None] + s * h)[:, :, 1])[0] for s in (-1, 1)]
    wanted = -(ends[1] - ends[0]) / (2 * h)
    assert slope == pytest.approx(wanted, rel=0.02, abs=0.05)


@pytest.mark.parametrize("law", ["reference", "loguniform"])
def test_displacements_are_ranges_less_an_offset(law: str) -> None:
    """At every offset the likelihood is that of ranges known to be offset plus displacement."""
    moved, sd = np.array([5.0, np.nan, 6.41]), np.array([0.004, np.nan, 0.01])
    sensor, scene, frames = seen("pulsed", moved, sd)
    stated = parse_scene(scene if LAWS[law] is None else scene | {"range_m": LAWS[law]})
    moved_frames = Frames(frames.readings, displacement_m=moved, displacement_sd_m=sd)
    density = collapsed_density(sensor, stated, moved_frames)
    assert density.parameters.names == (OFFSET,)
    offsets = np.array([[-4.7], [-4.39], [-4.0]])
    z = density.parameters.standard(offsets)
    np.testing.assert_allclose(density.parameters.natural(z), offsets, rtol=1e-12)
    found = density.frame_log_likelihoods(z)
    for row, offset in zip(found, offsets[:, 0], strict=True):
        told = Frames(frames.readings, known_range_m=moved + offset, known_range_sd_m=sd)
        wanted = collapsed_density(sensor, stated, told).frame_log_likelihoods(NOTHING)[0]
        np.testing.assert_allclose(row, wanted, rtol=1e-9)


def test_linearisation_along_the_offset() -> None:
    """As above, by differences of the profile along the offset, and along c2 beside it."""
    moved, sd = np.array([0.01, np.nan, 1.41]), np.array([0.004, np.nan, 0.01])
    sensor, scene, frames = seen("pulsed", moved, sd)
    told = np.array([0.61, np.nan, np.nan])
    both = dataclasses.replace(frames, displacement_m=moved, displacement_sd_m=sd)
    both = dataclasses.replace(both, known_range_m=told)
    free = scene | {
        "object": {**PLATE, "c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.3}},
        "range_m": LAWS["loguniform"],
    }
    density = collapsed_density(sensor, parse_scene(free), both)
    z = density.parameters.standard(np.array([[0.101, 0.595]]))[0]
    line = linearise(density, z, density.best_ranges(z[None])[0, :, 0])
    slope = line.jacobian.reshape(-1, 2).T @ line.residual.reshape(-1)
    for j, h in ((0, 1e-4), (1, 1e-5)):
        step = h * np.eye(2)[j]
        ends = [
            density.total(density.best_ranges((z + s * step)[None])[:, :, 1])[0] for s in (-1, 1)
        ]
        assert slope[j] == pytest.approx(-(ends[1] - ends[0]) / (2 * h), rel=0.02)


def test_residuals_beside_the_readings() -> None:
    told, sd = np.array([0.61, np.nan, 1.98]), np.array([0.004, np.nan, 0.01])
    sensor, scene, frames = seen("pulsed", told, sd)
    density = collapsed_density(sensor, parse_scene(scene), frames)
    at = whitened(sensor, density.parameters, density.frames, np.empty(0), np.log([0.6, 1.0, 2.0]))
    assert at.beside is not None
    np.testing.assert_allclose(at.beside.residual[:, 0], [2.5, 0.0, -2.0])
    np.testing.assert_allclose(at.beside.along[:, 0], [150.0, 0.0, 200.0])
