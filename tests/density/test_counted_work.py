"""What a frame costs in the likelihood, counted: evaluations of its density, and machine code."""

from typing import Any

import numpy as np
import pytest

from inference.density import frame_integrals
from inference.density.collapsed import CollapsedDensity, collapsed_density
from simulator.scene import parse_scene
from tests.counting import counted_calls, types_asked_for
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

LOG_UNIFORM = {"prior": "loguniform", "low": 0.05, "high": 5.0}
FRAMES = 8


def density_of(
    snr: float, noise: dict[str, float], scene: dict[str, Any], frames: int = FRAMES
) -> CollapsedDensity:
    sensor = sensor_of("pulsed", snr, **noise)
    sent = data(sensor, {"discrepancy": 0}, frames, span=(0.2, 2.0)).frames
    stated = parse_scene({"object": OBJECT, "discrepancy": 0, **scene})
    return collapsed_density(sensor, stated, sent)


@pytest.mark.parametrize(
    ("snr", "noise", "scene", "densities", "slopes"),
    [
        # a narrow peak: seven points of Gauss and Hermite, four that see whether it falls off, and
        # the steps to its top; as many at any signal-to-noise ratio
        (1e3, {}, {"range_m": LOG_UNIFORM}, 20.0, 6.0),
        (1e6, {}, {"range_m": LOG_UNIFORM}, 24.0, 6.0),
        # with the reference prior, whose information costs two more evaluations of a slope each
        (1e3, {}, {}, 21.0, 6.0),
        # one that leans, or is as wide as the table's knots lie apart, takes less than panels of
        # eight points each, looked at twice, which took 67
        (30.0, {}, {}, 22.0, 6.0),
        (10.0, {}, {}, 60.0, 9.0),
        # shot noise has kinks where a mean reading changes sign, and is held to 1e-8: today 116
        (30.0, {"shot": 1e-6}, {}, 145.0, 20.0),
    ],
)
def test_evaluations_for_an_integral_over_a_range(
    snr: float, noise: dict[str, float], scene: dict[str, Any], densities: float, slopes: float
) -> None:
    density = density_of(snr, noise, scene)
    rows = density.integral_rows(density.parameters.terms(np.zeros((1, len(density.parameters)))))
    out = np.empty((1, FRAMES))
    _, calls = counted_calls(
        frame_integrals.fill_log_likelihoods, out, rows, density.data, density.instrument
    )
    assert np.isfinite(out).all()
    assert calls["log_density.log_density"] <= densities * FRAMES
    assert calls["log_density.slope_and_curvature"] <= slopes * FRAMES
    assert calls["table_by_arrays.tabulate"] == 1  # whatever the number of frames


def test_a_scene_without_a_term_evaluates_none_of_it() -> None:
    density = density_of(1e3, {}, {})
    rows = density.integral_rows(density.parameters.terms(np.zeros((1, len(density.parameters)))))
    _, calls = counted_calls(
        frame_integrals.fill_log_likelihoods,
        np.empty((1, FRAMES)),
        rows,
        density.data,
        density.instrument,
    )
    assert calls["readings.object_readings"] > 0
    for name in ("background_readings", "background_slopes", "noise_parts", "covariance"):
        assert calls[f"readings.{name}"] == 0


def test_numbers_of_frames_and_of_points_need_no_machine_code(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = types_asked_for(monkeypatch)
    scene = {"crosstalk": UNKNOWN_CROSSTALK}
    for frames in (1, FRAMES):
        density = density_of(1e3, {}, scene, frames)
        for points in (1, 3):
            density(np.zeros((points, len(density.parameters))))
    (name,) = (name for name in asked if name.endswith(".fill_log_likelihoods"))
    assert len(asked[name]) == 1
