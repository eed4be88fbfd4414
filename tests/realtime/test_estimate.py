"""The plan, the statuses, bad input, and what must hold whatever the readings."""

import math
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inference.estimate import all_roots, estimate
from inference.estimates import Status, TechniqueResult
from inference.plan import plan
from inference.realtime.registry import TECHNIQUES
from inference.realtime.techniques.conventional import conventional_range
from inference.techniques import ALL_TECHNIQUES, ELSEWHERE
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.model_error import RANGE_ERROR_SD
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

PRIOR = {"prior": "lognormal", "median": 1.0, "sigma": 1.0}
UNKNOWN = [PRIOR, PRIOR]
OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
FAR = {"strength": 0.0177, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}


def sensor_of(kind: str, **more: Any) -> Sensor:
    timing = {"pulse_width_s": 1e-7} if kind == "pulsed" else {"frequency_hz": 2e7}
    noise = {"read": [1e-6, 1e-6], "derivative": [1e-6, 1e-6]}
    return parse_sensor({"kind": kind, "noise": noise} | timing | more)


def noise_of(noise: float) -> dict[str, list[float]]:
    return {"read": [noise, noise], "derivative": [noise, noise]}


PULSED, SINE = sensor_of("pulsed"), sensor_of("sine_wave")
SINE_WAVE_NUMBER = 4.0 * math.pi * 2e7 / 299792458.0


def frame(*pair: float) -> Frames:
    return Frames(np.array([pair]), time_s=np.array([0.0]))


def reason_of(result: TechniqueResult, i: int = 0) -> str:
    return result.reasons[int(result.reason[i])]


@pytest.mark.parametrize(
    ("scene", "chosen"),
    [
        ({}, "conventional"),
        ({"object": OBJECT}, "conventional"),
        ({"crosstalk": [0.1, 0.2]}, "conventional"),
        ({"object": OBJECT, "crosstalk": UNKNOWN}, "differential"),
        ({"crosstalk": UNKNOWN}, "differential"),
        ({"crosstalk": UNKNOWN, "motion": "static"}, None),
        ({"crosstalk": {"values": [0.1, 0.2], "optional": True}}, "differential"),
        ({"background": FAR}, "background_intensity"),
        ({"object": OBJECT, "background": FAR | {"strength": PRIOR}}, "background_cancelling"),
        ({"background": FAR | {"optional": True}}, None),
        (
            {"object": OBJECT, "background": FAR, "crosstalk": UNKNOWN},
            "background_cancelling_differential",
        ),
        ({"background": FAR | {"distance_m": PRIOR}, "object": OBJECT}, "joint_fit"),
        ({"background": FAR | {"shadow": "object"}, "object": OBJECT}, "background_"),
    ],
)
def test_plan(scene: dict[str, Any], chosen: str | None) -> None:
    for sensor in (PULSED, SINE):
        found = plan(sensor, parse_scene(scene))
        if chosen is None:
            assert found.chosen is None
        else:
            assert found.chosen is not None
            assert found.chosen.startswith(chosen)
        named = {item.name for item in found.left_out} | {found.chosen} - {None}
        assert named == {*ALL_TECHNIQUES, *ELSEWHERE}
        assert all(item.reason for item in found.left_out)


def test_immunity_is_that_of_table_4_1() -> None:
    immunity = {name: set(technique.immune_to) for name, technique in TECHNIQUES.items()}
    assert immunity == {
        "conventional": {"discrepancy"},
        "intensity": set(),
        "intensity_w1": set(),
        "differential": {"crosstalk"},
        "background_cancelling": {"background"},
        "background_intensity": {"background", "discrepancy"},
        "background_cancelling_differential": {"crosstalk", "background"},
    }


def test_results_stand_in_the_order_asked_for() -> None:
    asked = ["intensity", "joint_fit", "conventional", "background_cancelling"]
    estimates = estimate(PULSED, parse_scene({"object": OBJECT}), frame(0.1, 2.0), asked)
    assert [result.technique for result in estimates.results] == ["intensity", "conventional"]
    assert estimates.chosen == "conventional"
    reasons = {item.name: item.reason for item in estimates.left_out}
    assert "the scene states none" in reasons["background_cancelling"]
    assert "nothing but the ranges is unknown" in reasons["joint_fit"]


def test_chosen_has_a_result_or_is_none() -> None:
    known = parse_scene({"object": OBJECT})
    assert estimate(PULSED, known, frame(0.1, 2.0), ["intensity"]).chosen == "intensity"
    assert estimate(PULSED, known, frame(0.1, 2.0)).chosen == "conventional"
    none = estimate(PULSED, known, frame(0.1, 2.0), ["joint_fit", "posterior"])
    assert none.results == ()
    assert none.chosen is None
    # the plan needs no more than the scene; the fit finds that one frame is not enough
    unknown = parse_scene({"crosstalk": UNKNOWN})
    refused = estimate(PULSED, unknown, frame(0.1, 2.0), ["crosstalk_fit", "joint_fit"])
    assert refused.results == ()
    assert refused.chosen is None


def test_unknown_techniques_are_named() -> None:
    with pytest.raises(InvalidInputError) as caught:
        estimate(PULSED, parse_scene({}), frame(0.1, 2.0), ["conventional", "magic"])
    assert [p.pointer for p in caught.value.problems] == ["/techniques/1"]


def test_an_impossible_scene_is_named() -> None:
    scene = parse_scene({"object": {"c0": 0.1, "c1": -0.7}})
    with pytest.raises(InvalidInputError) as caught:
        estimate(PULSED, scene, frame(0.1, 2.0))
    assert [p.pointer for p in caught.value.problems] == ["/scene/object/c1"]
    with pytest.raises(InvalidInputError):
        all_roots("background_cancelling", PULSED, parse_scene({}), frame(0.1, 2.0))


def test_an_own_shadow_is_said_to_be_an_assumption() -> None:
    scene = {"object": OBJECT, "background": FAR}
    for shadow, said in (("object", True), ({"c0": 0.05, "c1": 0.0}, False), ({}, False)):
        document = scene | {"background": FAR | {"shadow": shadow}}
        found = estimate(PULSED, parse_scene(document), frame(0.1, 2.0))
        assert any("own" in text for text in found.assumptions) == said


def test_known_crosstalk_and_gain_are_taken_off_first() -> None:
    scene = parse_scene({"object": OBJECT, "crosstalk": [0.5, -0.25]})
    for technique in ("conventional", "intensity"):
        plain = estimate(PULSED, parse_scene({"object": OBJECT}), frame(0.1, 2.0), [technique])
        frames = Frames(np.array([[4 * 0.1 + 0.5, 4 * 2.0 - 0.25]]), gain=np.array([4.0]))
        shifted = estimate(PULSED, scene, frames, [technique])
        np.testing.assert_allclose(shifted.results[0].roots_m, plain.results[0].roots_m, rtol=1e-14)


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
        (-2e-6, 0.0, 20.0, False, "at or near contact, or at the end of the unambiguous range"),
        (-2e-6, 1.0, 20.0, True, ""),
        # a nearest range that is not zero, and lies within the noise of the phase too
        (-2e-6, 3e-7 / SINE_WAVE_NUMBER, 20.0, False, "or at the end of the unambiguous range"),
        (2e-6, 1.0, 20.0, False, "every solution lies outside the ranges of the scene"),
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
    shares = [1.0 - 2.9 * noise, 1.0 - 3.1 * noise, 1.0, 1.0 + noise, 0.5, 0.1]
    readings = np.column_stack([shares, np.ones(6)])
    (result,) = estimate(PULSED, parse_scene({}), Frames(readings)).results
    assert result.near_fold.tolist() == [True, False, True, False, False, False]
    assert "beyond r0" in reason_of(result, 3)
    assert np.isfinite(result.sd_m[[0, 1, 2, 4, 5]]).all()
    # noise as wide as the range reaches every end
    dark = Frames(np.array([[3e-6, 4e-6], [1e-6, 4e-6]]))
    (result,) = estimate(PULSED, parse_scene({}), dark).results
    assert result.range_m == pytest.approx([0.75 * r0, 0.25 * r0])
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


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_sd_of_single_frames_is_that_of_the_scatter(kind: str) -> None:
    """20000 frames: the scatter's sd is known to 0.5 %, tested at 5 sigma (false alarm 6e-7)."""
    noise = {"read": [1e-6, 2e-6], "shot": 1e-9, "relative": 1e-5}
    sensor = sensor_of(kind, noise=noise)
    scene = parse_scene({"object": OBJECT, "background": FAR, "discrepancy": 0})
    bare = parse_scene({"object": OBJECT, "discrepancy": 0})
    r = 0.9
    rng = np.random.default_rng(3)
    names = ["conventional", "intensity", "intensity_w1"]
    names += ["background_cancelling", "background_intensity"]
    for technique in names:
        if kind == "sine_wave" and technique == "intensity_w1":
            continue
        shown = scene if technique.startswith("background") else bare
        frames = _noisy(sensor, technique.startswith("background"), r, rng, 20000)
        result = estimate(sensor, shown, frames, [technique]).results[0]
        unique = result.status == Status.UNIQUE
        ranges, sd = result.range_m[unique], result.sd_m[unique]
        if not unique.all():  # two roots as a rule beyond k R = pi: take the true branch
            nearest = np.nanargmin(np.abs(result.roots_m - r), axis=1)
            rows = np.arange(nearest.size)
            ranges, sd = result.roots_m[rows, nearest], result.roots_sd_m[rows, nearest]
        assert np.std(ranges) == pytest.approx(np.nanmedian(sd), rel=0.025), technique
        assert np.mean(ranges) == pytest.approx(r, abs=5 * np.std(ranges) / math.sqrt(20000) + 1e-5)


def _noisy(sensor: Sensor, background: bool, r: float, rng: np.random.Generator, n: int) -> Frames:
    """Draw frames from the noise model as docs/model.md, noise, states it."""
    c0, c1, c2 = OBJECT.values()
    flux = c0 * c2 / (r * r * (r * r + c1 * r + c0))
    back = 0.0177 * (r * r + 0.013 * r) / (r * r + 0.013 * r + 0.056) if background else 0.0
    if sensor.kind == "pulsed":
        r0 = 14.9896229
        signal = np.array([flux * r / r0, flux])
        mean = signal + back * np.array([3.0 / r0, 1.0])
    else:
        k = 4 * math.pi * 2e7 / 299792458
        phases = np.array([math.cos(k * r), math.sin(k * r)])
        signal = flux * phases
        mean = signal + back * np.array([math.cos(3 * k), math.sin(3 * k)])
    read, shot = np.array(sensor.noise.read), sensor.noise.shot * np.abs(mean)
    cov = np.diag(read**2 + shot) + sensor.noise.relative**2 * np.outer(signal, signal)
    if sensor.kind == "pulsed":
        cov[0, 1] += shot[0]
        cov[1, 0] += shot[0]
    return Frames(mean + rng.standard_normal((n, 2)) @ np.linalg.cholesky(cov).T)


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


@given(
    st.floats(1e-12, 1e12),
    st.sampled_from(["intensity", "conventional", "background_cancelling", "background_intensity"]),
    st.sampled_from(["pulsed", "sine_wave"]),
    st.floats(0.05, 2.5),
)
@settings(max_examples=100, deadline=None)
def test_nothing_depends_on_the_unit_of_the_readings(
    unit: float, technique: str, kind: str, r: float
) -> None:
    background = technique.startswith("background")
    roots = []
    for scale in (1.0, unit):
        sensor = sensor_of(
            kind, gain=scale, noise={"read": [1e-6 * scale, 1e-6 * scale], "shot": 1e-9 * scale}
        )
        data: dict[str, Any] = {"object": OBJECT}
        if background:
            data["background"] = FAR | {"strength": 0.0177 * scale}
        plain = _noisy(sensor_of(kind), background, r, np.random.default_rng(0), 1)
        frames = Frames(plain.readings * scale)
        result = estimate(sensor, parse_scene(data), frames, [technique]).results[0]
        roots.append(result)
    one, other = roots
    assert one.status.tolist() == other.status.tolist()
    np.testing.assert_allclose(one.roots_m, other.roots_m, rtol=1e-9)
    np.testing.assert_allclose(one.roots_sd_m, other.roots_sd_m, rtol=1e-6)


def test_a_background_beyond_a_thousand_half_turns_is_left_out() -> None:
    """Each half turn may hold a root: without a bound a frame would fill the memory."""
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 1e9, "noise": {"read": [1e-6, 1e-6]}}
    )
    scene = parse_scene({"background": {"strength": 1.0, "distance_m": 1e6, "shadow": "object"}})
    left_out = {item.name: item.reason for item in plan(sensor, scene).left_out}
    for name in ("background_cancelling", "background_intensity"):
        assert "half turns" in left_out[name]
