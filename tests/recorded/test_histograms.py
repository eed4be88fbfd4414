"""Histograms to readings, on histograms made up here."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.constants import speed_of_light

from service.adapters.histograms import Calibration, calibrate, pulsed, sine_wave
from service.adapters.recordings import Recording, read_recording
from service.errors import MalformedError

WIDTH_S = 1e-10


def recording(peak: int = 20, floor: float = 3.0) -> Recording:
    counts = np.full((1, 128), floor)
    counts[0, peak - 1 : peak + 2] += [100.0, 500.0, 100.0]
    return Recording(np.array([0.3]), counts, WIDTH_S)


def test_first_moment_is_the_range_of_a_symmetric_echo() -> None:
    sensor, frames = pulsed(recording())
    (late, whole) = frames.readings[0]
    assert whole == pytest.approx(700.0, rel=1e-12)
    expected = 0.5 * speed_of_light * 20.5 * WIDTH_S
    assert late / whole * sensor.r0 == pytest.approx(expected, rel=1e-12)


def test_phase_is_the_range_of_a_symmetric_echo() -> None:
    calibration = Calibration(slope=1.1, offset_m=-0.05)
    sensor, frames = sine_wave(recording(), calibration)
    i, q = frames.readings[0]
    expected = 1.1 * 0.5 * speed_of_light * 20.5 * WIDTH_S - 0.05
    assert np.arctan2(q, i) / sensor.wave_number == pytest.approx(expected, rel=1e-12)


def test_calibration_moves_the_range_of_a_pulse() -> None:
    calibration = Calibration(slope=0.9, offset_m=0.02)
    sensor, plain = pulsed(recording())
    _, moved = pulsed(recording(), calibration)
    r = sensor.r0 * plain.readings[:, 0] / plain.readings[:, 1]
    np.testing.assert_allclose(
        sensor.r0 * moved.readings[:, 0] / moved.readings[:, 1], calibration(r), rtol=1e-12
    )


def test_calibration_of_exact_lines_is_exact() -> None:
    measured = np.linspace(0.1, 0.4, 30)
    found = calibrate(measured, 1.01 * measured - 0.2)
    assert found.slope == pytest.approx(1.01, rel=1e-12)
    assert found.offset_m == pytest.approx(-0.2, rel=1e-12)


@pytest.mark.parametrize("form", [pulsed, sine_wave])
def test_stated_noise_is_that_of_counted_photons(form: object) -> None:
    """Covariance of the readings of 4000 Poisson histograms, against what the sensor states.

    The sample variance of 4000 draws has a relative sd of 2.2 %: five of them, three entries and
    two sensors, alarm falsely once in 3e5 runs; the seed is fixed. What is stated is the worst
    position's, here the only one.
    """
    assert callable(form)
    expected = recording(floor=40.0)
    rng = np.random.default_rng(1)
    counts = rng.poisson(np.broadcast_to(expected.counts, (4000, 128))).astype(float)
    many = Recording(np.linspace(0.1, 0.2, 4000), counts, WIDTH_S)
    sensor, at_mean = form(expected)
    _, drawn = form(many)
    sample = np.cov(drawn.readings.T)
    mean = at_mean.readings[0]
    noise = sensor.noise
    stated = np.diag(np.square(noise.read)) + noise.relative**2 * np.outer(mean, mean)
    np.testing.assert_allclose(np.diag(sample), np.diag(stated), rtol=0.11)


@pytest.mark.parametrize(
    "document",
    [
        {"positions": []},
        {"bin_width_s": 1e-10, "positions": []},
        {
            "bin_width_s": 1e-10,
            "positions": [{"distance_m": 0.1, "zone_histograms": [[1] * 127]}],
        },
        {
            "bin_width_s": 1e-10,
            "positions": [{"distance_m": 0.1, "zone_histograms": [[1] * 128, [1] * 129]}],
        },
    ],
)
def test_bad_files(tmp_path: Path, document: object) -> None:
    path = tmp_path / "recording.json"
    path.write_text(json.dumps(document))
    with pytest.raises(MalformedError, match=r"recording\.json: "):
        read_recording(path)


def test_positions_are_sorted_and_zones_pooled(tmp_path: Path) -> None:
    zones = [[1] * 128, [2] * 128]
    positions = [{"distance_m": d, "zone_histograms": zones} for d in (0.2, 0.1)]
    path = tmp_path / "recording.json"
    path.write_text(json.dumps({"bin_width_s": 1e-10, "positions": positions}))
    found = read_recording(path)
    assert found.distance_m.tolist() == [0.1, 0.2]
    assert np.all(found.counts == 3)
