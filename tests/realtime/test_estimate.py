"""The plan, the statuses, bad input, and what must hold whatever the readings."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inference.estimate import all_roots, estimate
from inference.estimates import Status
from inference.plan import plan
from inference.realtime.registry import TECHNIQUES
from inference.techniques import ALL_TECHNIQUES, ELSEWHERE
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import Sensor
from simulator.simulate import mean_readings
from tests.realtime.small_scenes import FAR, OBJECT, PRIOR, PULSED, SINE, UNKNOWN, frame, sensor_of


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
        ({"background": FAR, "object": OBJECT}, "background_cancelling"),
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


@pytest.mark.parametrize(("distance", "chosen"), [(3.0, "cancelling"), (4.5, "intensity")])
def test_of_two_that_serve_a_wall_the_sharper_is_chosen_where_it_has_one_root(
    distance: float, chosen: str
) -> None:
    scene = parse_scene({"object": OBJECT, "background": FAR | {"distance_m": distance}})
    terms = parameters_of(SINE, scene).terms(np.zeros((1, 0)))
    frames = Frames(mean_readings(SINE, terms, np.array([0.8, 1.2, 1.6])))
    found = estimate(SINE, scene, frames)
    assert found.chosen == f"background_{chosen}"
    both = ["background_intensity", "background_cancelling"]
    named = estimate(SINE, scene, frames, both)
    assert named.chosen == found.chosen
    wide, sharp = (result.roots_sd_m[:, 0] for result in named.results)
    if distance < 4.0:
        assert (sharp < 0.9 * wide).all()
        assert {item.name: item.reason for item in found.left_out}[both[0]].endswith("less error")


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
