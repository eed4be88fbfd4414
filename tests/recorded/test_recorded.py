"""Promises about recorded photons; the figures that are only reported: benchmarks/recorded.py."""

import json

import httpx
import numpy as np
import pytest

from service.adapters.histograms import pulsed, sine_wave
from service.adapters.recordings import Recording
from service.app import create_app
from service.service_settings import ServiceSettings
from tests.recorded.experiment import (
    PATH,
    calibration_of,
    conventional_residual_m,
    near_recording,
    zeta_and_power_law,
)

pytestmark = [
    pytest.mark.recorded,
    pytest.mark.skipif(not PATH.exists(), reason="../shared/data/tmf8820_plane.json is absent"),
]


@pytest.fixture(scope="module")
def recording() -> Recording:
    return near_recording()


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_conventional_range_is_within_a_millimetre(recording: Recording, kind: str) -> None:
    residual = conventional_residual_m(recording, kind)
    # two parameters were fitted
    assert np.sqrt(np.sum(residual**2) / (residual.size - 2)) <= 1.0e-3


def test_zeta_is_one_plus_one_over_b(recording: Recording) -> None:
    distance, zeta, b = zeta_and_power_law(recording)
    far = distance > 0.2
    assert far.sum() > 40
    assert np.abs(zeta - (1 + 1 / b))[far].max() <= 0.03


def test_both_sensors_agree(recording: Recording) -> None:
    """The phase of a slow sine wave is the mean arrival time: two paths to one range."""
    calibration = calibration_of(recording)
    columns = []
    for form in (pulsed, sine_wave):
        _, frames = form(recording, calibration)
        columns.append(frames.readings)
    late, whole = columns[0].T
    assert whole.min() > 1e6  # photons
    modulus = np.hypot(*columns[1].T)
    # the echo's width turns the phase by less than its square: (2 pi 5 MHz 1 ns)^2 = 1e-3
    np.testing.assert_allclose(modulus, whole, rtol=1e-3)
    assert np.all(late > 0)


@pytest.mark.anyio
@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
async def test_over_http(recording: Recording, kind: str) -> None:
    form = pulsed if kind == "pulsed" else sine_wave
    sensor, frames = form(recording, calibration_of(recording))
    body = {
        "sensor": json.loads(sensor.model_dump_json(exclude_none=True)),
        "scene": {},
        "frames": frames.to_columns(sensor),
        "techniques": ["conventional", "differential"],
    }
    app = create_app(ServiceSettings(workers=1))
    async with httpx.AsyncClient(
        transport=httpx.ASGITransport(app), base_url="http://localhost"
    ) as client:
        response = await client.post("/v1/estimates", json=body)
    assert response.status_code == 200
    first, second = response.json()["results"]
    assert {frame["status"] for frame in first["frames"]} == {"unique"}
    ranges = np.array([frame["range_m"] for frame in first["frames"]])
    residual = ranges - recording.distance_m
    assert np.sqrt(np.sum(residual**2) / (residual.size - 2)) <= 1.0e-3
    # nothing is known of the object: differential gives bounds, not one range
    assert all("range_bounds_m" in f for f in second["frames"] if f["status"] == "ambiguous")
    assert any(frame["status"] == "ambiguous" for frame in second["frames"])
