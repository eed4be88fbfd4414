"""The numeric examples of the ambiguity study, part 1: every root set, unfiltered and filtered."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from inference.estimate import all_roots, estimate
from inference.estimates import Status, TechniqueResult
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor

MAIN = (0.0769, -0.123, 0.0957)
PLATE = (0.0817, 0.0574, 0.103)
R0_15_M = 2 * 15 / 299792458

# observations are rounded to 12 digits, so roots agree to their condition times 1e-12
TOLERANCE = 3e-10


def pulsed(noise: float = 1e-16) -> Sensor:
    noises = {"read": [noise, noise], "derivative": [noise, noise]}
    return parse_sensor({"kind": "pulsed", "pulse_width_s": R0_15_M, "noise": noises})


def sine(frequency: float, noise: float = 1e-16) -> Sensor:
    noises = {"read": [noise, noise], "derivative": [noise, noise]}
    return parse_sensor({"kind": "sine_wave", "frequency_hz": frequency, "noise": noises})


def scene(
    target: tuple[float, float, float] | None = None,
    far: tuple[float, float, float | None, float] | None = None,
) -> Scene:
    """Build an exact scene of (c0, c1, c2) and of background (R, strength, c0', c1')."""
    data: dict[str, Any] = {"discrepancy": 0}
    if target is not None:
        data["object"] = dict(zip(("c0", "c1", "c2"), target, strict=True))
    if far is not None:
        distance, strength, c0, c1 = far
        data["background"] = {"distance_m": distance, "strength": strength}
        if c0 is not None:
            data["background"]["shadow"] = {"c0": c0, "c1": c1}
    return parse_scene(data)


def frame(*pair: float) -> Frames:
    return Frames(np.array([pair]))


def motion(*pair: float) -> Frames:
    return Frames(np.array([[1.0, 2.0]]), derivatives=np.array([pair]))


def roots_of(result: TechniqueResult) -> list[float]:
    return [float(r) for r in result.roots_m[0, : result.root_count[0]]]


def reason_of(result: TechniqueResult) -> str:
    return result.reasons[int(result.reason[0])]


def check(result: TechniqueResult, expected: Sequence[float], tolerance: float = TOLERANCE) -> None:
    assert roots_of(result) == pytest.approx(list(expected), rel=tolerance)
    statuses = {0: Status.NONE, 1: Status.UNIQUE}
    assert result.status[0] == statuses.get(len(expected), Status.AMBIGUOUS)


def test_conventional_sine_wave_and_its_aliases() -> None:
    frames, sensor = frame(0.00124766294134, 0.00239094797596), sine(20e6)
    aliases = all_roots("conventional", sensor, scene(), frames, high_m=20.0)
    check(aliases, [1.3, 8.79481145, 16.2896229])
    check(estimate(sensor, scene(), frames).results[0], [1.3])


@pytest.mark.parametrize(
    ("flux", "expected"),
    [
        (21.9258721345, [0.0951138281882, 0.278682255575, 0.3]),
        (22.2783278932, [0.0938613884496, 0.287198849028, 0.292339822132]),
        (22.3229291502, [0.0937065122776]),
    ],
)
def test_intensity_has_three_roots_and_a_vanishing_pair(flux: float, expected: list[float]) -> None:
    result = estimate(
        pulsed(), scene((0.1, -0.6164414, 0.1)), frame(1.0, flux), ["intensity"]
    ).results[0]
    # near the fold the root moves by the root of the rounding of the flux
    check(result, expected, 3e-9)


def test_a_merging_pair_is_called_near_a_fold() -> None:
    target = scene((0.1, -0.6164414, 0.1))
    noisy = pulsed(0.05)
    at_fold = estimate(noisy, target, frame(1.0, 22.2783278932), ["intensity"]).results[0]
    assert bool(at_fold.near_fold[0])
    sd = at_fold.roots_sd_m[0]
    assert math.isfinite(sd[0])
    assert np.isnan(sd[1:]).all()
    beyond = estimate(noisy, target, frame(1.0, 22.3229291502), ["intensity"]).results[0]
    assert bool(beyond.near_fold[0])  # the right root has gone, a wrong one is left
    far = estimate(noisy, target, frame(1.0, 100.0), ["intensity"]).results[0]
    assert not bool(far.near_fold[0])


@pytest.mark.parametrize(
    ("q", "expected"),
    [
        (0.02, [0.0487955980318, 0.112841287366, 0.242153114603]),
        (0.9999 * 0.0256236380866, [0.0830081208659, 0.0843622290857, 0.243914417679]),
        (1.0001 * 0.0256236380866, [0.243916017315]),
    ],
)
def test_differential_pulsed_with_three_roots(q: float, expected: list[float]) -> None:
    target = scene((0.1, -0.565685, 0.1))
    result = estimate(pulsed(), target, motion(q / 15, 1.0), ["differential"]).results[0]
    # at 1e-4 of the fold the 12 digits of its position are amplified by up to 1e4
    check(result, expected, 3e-10 if q == 0.02 else 1e-7)


def test_differential_pulsed_ordinary_object() -> None:
    frames = motion(0.0196117404961, 0.810185824528)
    check(estimate(pulsed(), scene(MAIN), frames, ["differential"]).results[0], [0.5])
    flipped = motion(-0.0196117404961, 0.810185824528)
    check(estimate(pulsed(), scene(MAIN), flipped, ["differential"]).results[0], [])


def test_differential_sine_wave() -> None:
    frames = motion(1594.88080461, 8.29059390850)
    aliases = all_roots("differential", sine(5e6), scene(MAIN), frames, high_m=40.0)
    check(aliases, [0.05, 18.7108774095, 35.1221709019])
    check(estimate(sine(5e6), scene(MAIN), frames, ["differential"]).results[0], [0.05])


def test_a_phase_below_zero_is_contact_and_never_the_alias() -> None:
    frames = motion(1594.88396579, -7.65836285166)
    aliases = all_roots("differential", sine(5e6), scene(MAIN), frames, high_m=40.0)
    check(aliases, [18.6561702214, 35.0715664963])
    # the phase noise of the example is 0.01 rad of 1595
    result = estimate(sine(5e6, 16.0), scene(MAIN), frames, ["differential"]).results[0]
    check(result, [])
    assert "at or near contact" in reason_of(result)


def test_differential_sine_wave_at_20_mhz() -> None:
    frames = motion(0.00587496531614, 0.00634796711966)
    aliases = all_roots("differential", sine(20e6), scene(MAIN), frames, high_m=10.0)
    check(aliases, [1.3, 5.77826884480, 9.81023270872])
    check(estimate(sine(20e6), scene(MAIN), frames, ["differential"]).results[0], [1.3])


FAR = (10.0, 1 / (200 * math.pi), 0.73 * 0.0769, -0.23 * 0.123)


@pytest.mark.parametrize(
    ("distance", "expected"), [(10.0, 1.8), (9.9, 1.81134), (9.5, 1.86404), (9.0, 1.95362)]
)
def test_background_cancelling_pulsed(distance: float, expected: float) -> None:
    frames = frame(0.00113073169872, 0.00229779242176)
    result = all_roots("background_cancelling", pulsed(), scene(MAIN, (distance, *FAR[1:])), frames)
    check(result, [expected], 1e-10 if distance == 10.0 else 3e-6)


def test_background_cancelling_loses_its_root_to_half_a_percent() -> None:
    right = frame(0.00106265358296, 0.00159999734777)
    check(
        estimate(pulsed(), scene(MAIN, FAR), right, ["background_cancelling"]).results[0],
        [5.0],
        3e-8,
    )
    wrong = frame(0.00106796685087, 0.00159999734777)
    result = estimate(pulsed(), scene(MAIN, FAR), wrong, ["background_cancelling"]).results[0]
    check(result, [])
    assert reason_of(result) == "the readings lie at or beyond the background"


def test_background_cancelling_three_roots_and_the_filter_that_leaves_one() -> None:
    frames = frame(0.439020037246, 21.9266260263)
    target = scene((0.1, -0.6164414, 0.1), (10.0, 1 / (200 * math.pi), 0.1, 0.0))
    every = all_roots("background_cancelling", pulsed(), target, frames)
    check(every, [0.0967908097246, 0.277915074546, 0.3])
    check(estimate(pulsed(), target, frames, ["background_cancelling"]).results[0], [0.3])
    # light that the object model misses by a few percent may be what the other one lacks
    erring = target.model_copy(update={"discrepancy": 0.11})
    wide = estimate(pulsed(), erring, frames, ["background_cancelling"]).results[0]
    check(wide, [0.277915074546, 0.3])


def test_background_cancelling_sine_wave_beyond_half_a_turn() -> None:
    target = scene(PLATE, (5.0, 1 / (50 * math.pi), None, 0.0))
    frames = frame(-0.00317385017206, -0.00494337922013)
    check(all_roots("background_cancelling", sine(20e6), target, frames), [1.45475259816, 2.0])
    check(estimate(sine(20e6), target, frames, ["background_cancelling"]).results[0], [2.0])
    top = frame(-0.00291775051665, -0.00438661000661)
    pair = all_roots("background_cancelling", sine(20e6), target, top)
    check(pair, [1.65872571799, 1.66204125161], 1e-8)
    gone = frame(-0.00291778077308, -0.00438659265484)
    noisy = estimate(sine(20e6, 3.5e-8), target, gone, ["background_cancelling"]).results[0]
    check(noisy, [])
    assert bool(noisy.near_fold[0])
    assert "merged" in reason_of(noisy)


def test_background_cancelling_sine_wave_with_three_roots() -> None:
    target = scene(PLATE, (10.0, 1 / (50 * math.pi), None, 0.0))
    frames = frame(0.00160276254332, -1.24353253861e-6)
    result = all_roots("background_cancelling", sine(30e6), target, frames)
    check(result, [0.00691806102458, 2.57004453245, 4.4], 1e-9)


def test_background_intensity_pulsed() -> None:
    far = scene(None, (3.0, 1 / (18 * math.pi), 0.0561, 0.0132))
    result = estimate(pulsed(), far, frame(0.00349115385394, 0.0180978306561)).results[0]
    check(result, [1.20000000002], 1e-11)


def test_three_solutions_with_negative_background_are_filtered() -> None:
    far = scene(None, (5.15244624179, 1.0, 1.0, -1.45742818638))
    frames = frame(0.00365795040531, 8.63685315378)
    every = all_roots("background_intensity", pulsed(), far, frames)
    check(every, [0.0645634861078, 0.220357248213, 0.505010397572])
    result = estimate(pulsed(), far, frames).results[0]
    check(result, [])
    assert "negative object, or a background below zero" in reason_of(result)


def test_background_intensity_sine_wave_two_physical_roots() -> None:
    far = scene(None, (5.0, 1 / (50 * math.pi), 0.0596, 0.0132))
    frames = frame(0.00522929922254, -0.00147082061217)
    expected = [0.262711864408, 0.382477819733]
    check(all_roots("background_intensity", sine(20e6), far, frames), expected)
    check(estimate(sine(20e6), far, frames).results[0], expected)


ROWS = [
    (
        (0.0769, -0.123, 0.03),
        (3.0, 0.0176838825658, 0.056137, -0.02829),
        (0.00101689719286, 0.0566258184306),
        [0.68, 0.750280036],
    ),
    (
        (0.0817, 0.0574, 0.03),
        (10.0, 0.00159154943092, 0.059641, 0.013202),
        (5.18702564518e-5, 0.00111775451431),
        [1.5, 2.62200736],
    ),
    (
        (0.0769, -0.123, 0.0957),
        (3.0, 0.0176838825658, 0.0769, -0.123),
        (0.000194650574750, 0.00472036526261),
        [1.4, 1.99300562],
    ),
]


@pytest.mark.parametrize(("target", "far", "rates", "expected"), ROWS)
def test_both_terms_leave_two_roots_for_ordinary_scenes(
    target: tuple[float, float, float],
    far: tuple[float, float, float, float],
    rates: tuple[float, float],
    expected: list[float],
) -> None:
    name = "background_cancelling_differential"
    result = estimate(pulsed(), scene(target, far), motion(*rates), [name]).results[0]
    check(result, expected, 2e-9)
    check(all_roots(name, pulsed(), scene(target, far), motion(*rates)), expected, 2e-9)


@pytest.mark.parametrize(
    ("row", "fold"),
    [(0, (0.715308, 0.270211)), (1, (2.074666, 0.758347)), (2, (1.715532, 0.645299))],
)
def test_the_pair_merges_at_the_fold(row: int, fold: tuple[float, float]) -> None:
    target, far, _, _ = ROWS[row]
    name = "background_cancelling_differential"
    r_fold, q_fold = fold
    # q is known to six digits, so the pair is looked for at 1e-4 below and above
    below = motion(q_fold * (1 - 1e-4) / 15, 1.0)
    pair = roots_of(estimate(pulsed(), scene(target, far), below, [name]).results[0])
    assert len(pair) == 2
    assert pair[0] < r_fold < pair[1]
    above = motion(q_fold * (1 + 1e-4) / 15, 1.0)
    result = estimate(pulsed(1e-4), scene(target, far), above, [name]).results[0]
    check(result, [])
    assert bool(result.near_fold[0])


def test_a_hundredth_below_the_fold_two_per_mille_leave_no_root() -> None:
    target, far, _, _ = ROWS[0]
    name = "background_cancelling_differential"
    r, (c0, c1, c2), (distance, b, c0s, c1s) = 0.708155266936, target, far
    quad, quad_s = r * r + c1 * r + c0, r * r + c1s * r + c0s
    flux = c0 * c2 / (r * r * quad)
    change = -flux * (4 * r * r + 3 * c1 * r + 2 * c0) / (r * quad)
    back = b * c0s * (2 * r + c1s) / quad_s**2
    rates = (change * r + flux + distance * back) / 15, change + back
    pair = estimate(pulsed(), scene(target, far), motion(*rates), [name]).results[0]
    check(pair, [0.708155266936, 0.722448], 1e-6)
    off = estimate(pulsed(), scene(target, far), motion(1.002 * rates[0], rates[1]), [name])
    check(off.results[0], [])


def test_both_terms_sine_wave() -> None:
    target, far, _, _ = ROWS[0]
    frames = motion(0.0573380241332, 0.00340569187640)
    name = "background_cancelling_differential"
    check(all_roots(name, sine(5e6), scene(target, far), frames), [0.68, 0.827912650], 2e-9)
    check(
        estimate(sine(5e6), scene(target, far), frames, [name]).results[0],
        [0.68, 0.827912650],
        2e-9,
    )
