"""The status of a frame: contact, ends of a pulse, supports, finite roots alone."""

import math
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from inference.plan import plan
from inference.realtime.registry import TECHNIQUES
from inference.realtime.techniques.conventional import conventional_range
from simulator.frames import Frames
from simulator.model_error import RANGE_ERROR_SD
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from tests.realtime.small_scenes import FAR, OBJECT, PULSED, SINE, UNKNOWN, frame, sensor_of


def noise_of(noise: float) -> dict[str, list[float]]:
    return {"read": [noise, noise], "derivative": [noise, noise]}


SINE_WAVE_NUMBER = 4.0 * math.pi * 2e7 / 299792458.0
TURN = 2 * math.pi / SINE_WAVE_NUMBER  # to which ranges are told apart


def reason_of(result: TechniqueResult, i: int = 0) -> str:
    return result.reasons[int(result.reason[i])]


def test_statuses_of_a_pulse() -> None:
    sensor = sensor_of("pulsed", full_scale=[10.0, 10.0])
    r0 = 14.9896229
    readings = [[0.5, 1.0], [0.5, 0.0], [0.5, -2e-6], [-1e-9, 1.0], [1.000002, 1.0], [1.0, 10.0]]
    # by a hundred thousand standard deviations
    readings += [[0.5, -1.0], [1.1, 1.0], [0, 0]]
    present = np.array([True] * 8 + [False])
    result = estimate(
        sensor, parse_scene({}), Frames(np.array(readings), object_present=present)
    ).results[0]
    assert result.status.tolist() == [0, 2, 2, 2, 2, 3, 2, 2, 2]
    assert result.range_m[0] == pytest.approx(r0 / 2)
    assert result.sd_parts_m is not None
    noise, model = r0 * 1e-6 * math.sqrt(1.25), RANGE_ERROR_SD
    parts = [float(part[0, 0]) for part in result.sd_parts_m]
    assert parts == pytest.approx([noise, 0.0, model])
    assert result.sd_m[0] == pytest.approx(math.hypot(noise, model))
    words = ["", "w2 is not", "w2 is not", "contact", "beyond r0", "full scale", "below zero by"]
    words += ["above w2 by", "no object"]
    for i, word in enumerate(words):
        assert word in reason_of(result, i)
    assert np.isnan(result.roots_m[1:]).all()
    assert result.root_count.tolist() == [1, *[0] * 8]


def test_a_phase_just_below_zero_is_contact() -> None:
    just_below, clearly = (1.0, -2e-6), (1.0, -1e-2)
    result = estimate(SINE, parse_scene({}), Frames(np.array([just_below, clearly]))).results[0]
    assert result.status.tolist() == [Status.NONE, Status.UNIQUE]
    assert "at or near contact" in reason_of(result, 0)
    assert result.range_m[1] > 7.4


@pytest.mark.parametrize(
    ("phase", "low", "high", "root", "words"),
    [
        (-2e-6, 0.0, 5.0, False, "at or near contact"),
        (-2e-6, 0.0, TURN, False, "at or near contact, or at the end of the unambiguous range"),
        (-2e-6, 1.0, TURN, True, ""),
        # a nearest range that is not zero, and lies within the noise of the phase too
        (-2e-6, 3e-7 / SINE_WAVE_NUMBER, TURN, False, "or at the end of the unambiguous range"),
        (2e-6, 1.0, TURN, False, "every solution lies outside the ranges of the scene"),
    ],
)
def test_a_phase_below_zero_is_contact_only_where_the_scene_allows_it(
    phase: float, low: float, high: float, root: bool, words: str
) -> None:
    """The noise of the phase is 1e-6 rad: within three of it lies a range near zero, or the end."""
    scene = parse_scene({"range_m": {"prior": "uniform", "low": low, "high": high}})
    readings = frame(math.cos(phase), math.sin(phase))
    (result,) = estimate(SINE, scene, readings, ["conventional"]).results
    assert (result.status[0] == Status.UNIQUE) == root
    assert reason_of(result, 0).endswith(words)
    if root:
        expected = (2 * math.pi + phase) / SINE_WAVE_NUMBER
        assert result.range_m[0] == pytest.approx(expected, rel=1e-12)


def test_the_end_of_a_pulse_is_a_fold() -> None:
    """Beyond r0 both windows hold the whole pulse: noise puts half of such frames below r0."""
    r0, noise = 14.9896229, 1e-6 * math.sqrt(2.0)
    shares = [1.0 - 4.4 * noise, 1.0 - 4.6 * noise, 1.0, 1.0 + noise, 0.5, 0.1]
    readings = np.column_stack([shares, np.ones(6)])
    (result,) = estimate(PULSED, parse_scene({}), Frames(readings)).results
    assert result.near_fold.tolist() == [True, False, True, False, False, False]
    assert "beyond r0" in reason_of(result, 3)
    assert np.isfinite(result.sd_m[[0, 1, 2, 4, 5]]).all()
    # windows whose difference drowns in the noise may hold the same, however little they hold
    dark = Frames(np.array([[3e-6, 4e-6], [1e-6, 8e-6]]))
    (result,) = estimate(PULSED, parse_scene({}), dark).results
    assert result.range_m == pytest.approx([0.75 * r0, r0 / 8.0])
    assert result.near_fold.tolist() == [True, False]
    # empty frames that read nothing on average, as the scene says
    ones = np.array([[1.0], [1.0], [-1.0]]) * np.ones(2)
    empty = Frames(ones, object_present=np.array([True, False, False]))
    (result,) = estimate(PULSED, parse_scene({}), empty).results
    assert result.near_fold.tolist() == [True, False, False]


def test_only_a_stated_support_limits_the_roots() -> None:
    r0 = 14.9896229
    frames = frame(0.01 / r0, 1.0)  # 1 cm, below the default prior's 2 cm
    assert estimate(PULSED, parse_scene({}), frames).results[0].range_m[0] == pytest.approx(0.01)
    support = {"range_m": {"prior": "uniform", "low": 0.02, "high": 5.0}}
    result = estimate(PULSED, parse_scene(support), frames).results[0]
    assert result.status[0] == Status.NONE
    assert "outside the ranges of the scene" in reason_of(result)
    result = estimate(
        PULSED, parse_scene(support | {"object": OBJECT}), frame(1.0, 1e9), ["intensity"]
    ).results[0]
    assert "outside the ranges of the scene" in reason_of(result)


def test_a_pulse_does_not_limit_intensity() -> None:
    """`intensity` works beyond r0; the others do not (docs/http.md, estimates)."""
    sensor = sensor_of("pulsed", pulse_width_s=1e-9)  # r0 = 0.15 m
    r, (c0, c1, c2) = 2.0, OBJECT.values()
    flux = c0 * c2 / (r * r * (r * r + c1 * r + c0))
    scene = parse_scene({"object": OBJECT})
    result = estimate(sensor, scene, frame(flux, flux), ["intensity", "intensity_w1"])
    assert result.results[0].range_m[0] == pytest.approx(r, rel=1e-12)
    assert result.results[1].status[0] == Status.NONE


EXTREMES = [0.0, -0.0, 1.0, -1.0, 1e300, -1e300, 1.7e308, -1.7e308, 5e-324, -5e-324, 1e-310, 1e-160]

READING = st.one_of(
    st.sampled_from(EXTREMES), st.floats(allow_nan=False, allow_infinity=False, width=64)
)

SCENES = [
    {"object": OBJECT},
    {"object": {"c0": 1e3, "c1": -1.99 * math.sqrt(1e3), "c2": 1e-4}},
    {"object": {"c0": 1e-4, "c1": 1.0, "c2": 1.0}, "crosstalk": [1e50, -1e50]},
    {"object": OBJECT, "background": FAR},
    {"object": {"c0": 0.1, "c1": -0.62, "c2": 0.1}, "background": FAR | {"strength": 1e5}},
    {"object": OBJECT, "background": FAR | {"shadow": {"c0": 1.0, "c1": -1.9}}},
    {"motion": "tangential"},
    {"crosstalk": UNKNOWN},
]


@given(
    st.lists(st.tuples(READING, READING), min_size=1, max_size=6),
    st.sampled_from(SCENES),
    st.sampled_from(
        [
            PULSED,
            SINE,
            sensor_of("pulsed", gain=1e-12),
            sensor_of("sine_wave", gain=1e12),
            *(sensor_of(kind, noise=noise_of(1e-50)) for kind in ("pulsed", "sine_wave")),
            *(sensor_of(kind, noise=noise_of(1e50)) for kind in ("pulsed", "sine_wave")),
        ]
    ),
    st.booleans(),
)
@settings(max_examples=300, deadline=None)
def test_any_finite_reading_has_a_status_and_only_finite_roots(
    pairs: list[tuple[float, float]], data: dict[str, Any], sensor: Sensor, columns: bool
) -> None:
    readings = np.array(pairs)
    n = readings.shape[0]
    frames = Frames(
        readings,
        time_s=np.arange(n, dtype=np.float64),
        derivatives=readings[::-1].copy() if columns else None,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        estimates = estimate(sensor, parse_scene(data), frames, list(TECHNIQUES))
    for result in estimates.results:
        count, status = result.root_count, result.status
        assert len(result) == n
        wanted = np.where(
            count == 1, Status.UNIQUE, np.where(count > 1, Status.AMBIGUOUS, Status.NONE)
        )
        if result.range_bounds_m is not None:
            bounded = np.isfinite(result.range_bounds_m).all(axis=1)
            wanted = np.where(bounded, Status.AMBIGUOUS, wanted)
        np.testing.assert_array_equal(status, wanted)
        for i in range(n):
            roots = result.roots_m[i]
            assert np.isfinite(roots[: count[i]]).all()
            assert (roots[: count[i]] > 0).all()
            assert (np.diff(roots[: count[i]]) >= 0).all()
            assert np.isnan(roots[count[i] :]).all()
            sds = result.roots_sd_m[i, : count[i]]
            # readings are rounded: no root is more certain than that
            assert (sds[np.isfinite(sds)] >= 1e-16 * roots[: count[i]][np.isfinite(sds)]).all()
            assert not np.isinf(sds).any()
            said = bool(result.reason[i] > 0)
            if status[i] != Status.UNIQUE:
                assert said
            elif np.isnan(sds).any():
                assert said or result.near_fold[i]
            else:
                assert not said
    if sensor.kind == "pulsed" and "crosstalk" not in data:
        alone = conventional_range(sensor, frames)
        assert not np.isinf(alone).any()


def test_a_background_beyond_a_thousand_half_turns_is_left_out() -> None:
    """Each half turn may hold a root: without a bound a frame would fill the memory."""
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 1e9, "noise": {"read": [1e-6, 1e-6]}}
    )
    scene = parse_scene({"background": {"strength": 1.0, "distance_m": 1e6, "shadow": "object"}})
    left_out = {item.name: item.reason for item in plan(sensor, scene).left_out}
    for name in ("background_cancelling", "background_intensity"):
        assert "half turns" in left_out[name]
