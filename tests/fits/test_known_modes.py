"""More knowledge never adds ranges: where modes of readings go when rulers tell the ranges."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Status
from inference.fits.likelihood.told import Told, contradictions, unsettled
from simulator.frames import Frames, frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

C_M_S = 299_792_458.0
FRAMES = 24
SD_M = 1.0e-6, 1.0e-3, 1.0e-2
# of each frame's |z| under a normal law, 5 is passed once in 1.7 million; a set has 24 frames
FAR = 5.0


def readings(seed: int, flux_error: float = 0.0) -> tuple[Sensor, np.ndarray, np.ndarray]:
    """Return a sine wave's readings of an object, errors smooth along log r, and the ranges."""
    rng = np.random.default_rng(seed)
    frequency, c0, c1, c2 = 2e7, 0.08, float(rng.uniform(-0.1, 0.4)), 0.1
    r = rng.permutation(np.geomspace(0.2, 2.2, FRAMES))
    noise = c0 * c2 / (1.0 + c1 + c0) / 1000.0
    log_r = np.log(r)
    smooth = np.exp(-0.5 * np.square((log_r[:, None] - log_r) / 0.7)) + 1e-9 * np.eye(FRAMES)
    error = flux_error * (np.linalg.cholesky(smooth) @ rng.standard_normal(FRAMES))
    light = (1.0 + error) * c0 * c2 / (r * r * (r * r + c1 * r + c0))
    z = light * np.exp(4j * np.pi * frequency / C_M_S * r)
    y = np.column_stack([z.real, z.imag]) + noise * rng.standard_normal((FRAMES, 2))
    sensor = {"kind": "sine_wave", "frequency_hz": frequency, "noise": {"read": [noise, noise]}}
    return parse_sensor(sensor), y, r


def told(sensor: Sensor, y: np.ndarray, r: np.ndarray, sd: float) -> tuple[Frames, np.ndarray]:
    known = r + sd * np.random.default_rng(9).standard_normal(r.size)
    columns = {"i": y[:, 0], "q": y[:, 1], "known_range_m": known}
    return frames_from_columns(sensor, {**columns, "known_range_sd_m": np.full(r.size, sd)}), known


@pytest.mark.parametrize("sd", SD_M)
@pytest.mark.parametrize(
    ("scene", "error"),
    [({}, 0.0), ({"discrepancy": 0}, 0.0), ({"discrepancy": {"flux": 0.3}}, 0.3)],
)
def test_a_ruler_leaves_one_range_and_that_near_it(
    sd: float, scene: Mapping[str, Any], error: float
) -> None:
    """The seeds are fixed; other ones would raise an alarm in one of 20,000 sets."""
    sensor, y, r = readings(3, error)
    frames, known = told(sensor, y, r, sd)
    (found,) = estimate(sensor, parse_scene(dict(scene)), frames, ["joint_fit"]).results
    assert found.fit is not None
    assert not found.fit["misfit"]
    assert (found.status == Status.UNIQUE).all()
    assert not found.near_fold.any()
    assert np.abs((found.range_m - known) / sd).max() < FAR
    # no error that the fit is told of makes ranges surer than they are
    assert np.abs((found.range_m - r) / found.sd_m).max() < FAR
    assert (found.sd_m < 1.001 * sd).all()


def test_what_is_no_mode_costs_what_is_left_to_gain() -> None:
    """Against the sum of both squares, and its least along the slopes."""
    rng = np.random.default_rng(4)
    n = 6
    residual, along = rng.standard_normal((2, n, 2))
    along[1] = 0.0  # an end of the ranges: readings have no slope there
    beside = Told(
        rng.standard_normal((n, 2)) * np.array([3.0, 0.0]),
        np.abs(rng.standard_normal((n, 2))) * np.array([1.0, 0.0]),
        np.zeros((n, 2, 0)),
    )
    own = np.square(along).sum(axis=1)
    read = np.einsum("ni,ni->n", along, residual) / np.where(own > 0, own, 1.0)
    whole = own * read**2 + np.square(beside.residual[:, 0])
    parts = contradictions(beside, residual, along, np.zeros((n, 2, 0)))
    parts = parts + unsettled(beside, residual, along)
    np.testing.assert_allclose(parts, whole, rtol=1e-12)
