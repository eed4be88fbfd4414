"""Noise that depends on light which is still to be learnt: each frame weighs what it should."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from inference.tracking.light import noise_at_light
from inference.tracking.readings_table import ReadingsNoise, noise_root
from inference.tracking.roots import Root
from inference.tracking.track import track
from simulator.frames import frames_from_columns
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.simulate import mean_readings
from tests.posterior.scenes import KINDS
from tests.tracking.scenes import STEP, sensor_of

Array = NDArray[np.float64]
READ, SHOT = 1e-4, 1e-5
CROSSTALK = {"pulsed": np.array([0.02, 0.1]), "sine_wave": np.array([0.1, -0.05])}
FAR = [{"prior": "normal", "mean": 0.0, "sd": 0.2}] * 2  # 2,000 read noises
SEEDS, FRAMES = 40, 10


def noisy(kind: str, light: Array, rng: np.random.Generator) -> Array:
    """Readings of some light, shape (n, 2), by normal photons and read noise."""
    first, second = SHOT * np.abs(light).T
    a, b = rng.standard_normal((2, len(light)))
    if kind == "pulsed":
        # the second window holds the first
        late = a * np.sqrt(first)
        photons = np.column_stack([late, late + b * np.sqrt(second - first)])
    else:
        photons = np.column_stack([a * np.sqrt(first), b * np.sqrt(second)])
    return np.asarray(light + photons + READ * rng.standard_normal(light.shape))


def deviations(kind: str, priors: Any, *, known_range: bool) -> Array:
    """Errors of learnt crosstalk after ten frames in its own deviations, shape (seeds, 2)."""
    sensor = sensor_of(READ, kind, noise={"shot": SHOT})
    bare = {"object": {"c0": 0.1, "c1": 0.0, "c2": 0.1}, "discrepancy": 0}
    scene = parse_scene({**bare, "crosstalk": priors})
    light = np.tile(CROSSTALK[kind], (FRAMES, 1))
    columns: dict[str, Any] = {"time_s": STEP * np.arange(FRAMES)}
    if known_range:
        terms = parameters_of(sensor, parse_scene(bare)).terms(np.zeros((1, 0)))
        light = light + mean_readings(sensor, terms, np.ones(FRAMES))
        columns |= {"known_range_m": np.ones(FRAMES), "known_range_sd_m": np.full(FRAMES, 1e-6)}
    else:
        columns["object_present"] = np.zeros(FRAMES, dtype=bool)
    off = []
    for seed in range(SEEDS):
        readings = noisy(kind, light, np.random.default_rng(seed))
        own = dict(zip(sensor.columns, readings.T, strict=True))
        found = track(sensor, scene, frames_from_columns(sensor, {**columns, **own}))
        assert found.crosstalk is not None
        assert found.crosstalk_sd is not None
        off.append((found.crosstalk[-1] - CROSSTALK[kind]) / found.crosstalk_sd[-1])
    return np.array(off)


@pytest.mark.parametrize("known_range", [False, True])
@pytest.mark.parametrize("prior", ["far", "near"])
@pytest.mark.parametrize("kind", sorted(KINDS))
def test_learnt_crosstalk_is_as_sure_as_it_should_be(
    kind: str, prior: str, known_range: bool
) -> None:
    """Sums of 40 squares of either reading, one of 1e5 beyond: eight of them, one of 1e4 runs.

    With noise taken at the prior's mean of zero, empty frames left errors of 8.6 deviations.
    """
    near = [{"prior": "normal", "mean": value, "sd": 0.05} for value in CROSSTALK[kind]]
    off = deviations(kind, FAR if prior == "far" else near, known_range=known_range)
    for square in np.sum(off**2, axis=0):
        assert stats.chi2.ppf(5e-6, SEEDS) < square < stats.chi2.ppf(1.0 - 5e-6, SEEDS)


@pytest.mark.parametrize("pulsed", [False, True])
def test_noise_is_that_of_the_prior_where_light_is_known_and_of_the_reading_where_it_is_open(
    pulsed: bool,
) -> None:
    noise = ReadingsNoise(False, 1e-3, 0.7, 0.0, pulsed)
    mean, residual = (300.0, 500.0), (4000.0, 9000.0)
    known = noise_root(*mean, 0.0, 0.0, noise)
    read = noise_root(4300.0, 9500.0, 0.0, 0.0, noise)
    for open_sd, wanted in ((0.0, known), (1e-4, known), (1e9, read)):
        found = noise_at_light(mean, (0.0, 0.0), residual, Root(open_sd, 0.0, open_sd), noise)
        # a photon more or less in 300,000
        np.testing.assert_allclose(found, wanted, rtol=1e-5)


def test_a_reading_of_nothing_has_the_noise_of_a_photon() -> None:
    noise = ReadingsNoise(False, 50.0, 0.5, 0.0, False)
    wide = Root(1e6, 0.0, 1e6)
    found = noise_at_light((0.0, 0.0), (0.0, 0.0), (0.0, 0.0), wide, noise)
    # in units of the read noise, of which the first reading has half of the second's
    assert found.r11 == pytest.approx(np.hypot(1.0, 100.0), rel=1e-3)
    assert found.r22 == pytest.approx(np.hypot(1.0, 50.0), rel=1e-3)
