"""Standard deviations of r0 w1 / w2 where the light nearly drowns, and the end of a pulse."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import binom, norm

from inference.estimate import estimate
from inference.realtime.assemble import END_BAND
from inference.realtime.solving.ratio_reach import ratio_reach
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

R0 = 4.496886870
BAND = 3.0
FRAMES = 40_000
UNIT = st.floats(1e-9, 1.0)


# between two ratios that are not explained, and where three deviations are all of the whole window
@example(0.125, 0.03125, 0.25, 1.0, 0.0)
@example(0.4, 0.01, 1.0 / 2.7, 0.0, 0.0)
@given(UNIT, st.floats(1e-3, 1.0), UNIT, st.floats(0.0, 1.0), st.floats(-12.0, 12.0))
def test_the_reach_is_the_farther_end_of_what_three_deviations_explain(
    late: float, own1: float, own2: float, shared: float, power: float
) -> None:
    """Against every share of a fine grid, one by one; whatever unit the readings have."""
    shares = np.linspace(0.0, 1.0, 4001)
    own1, own2, shared = 0.3 * own1, 0.3 * own2, 0.1 * shared
    spread = own1 + shares**2 * own2 + (1.0 - shares) ** 2 * shared
    explained = shares[np.abs(late - shares) <= BAND * np.sqrt(spread)]
    ends = np.append(explained, late)  # the estimate itself explains its reading
    expected = max(ends.max() - late, late - ends.min()) / BAND
    unit = 10.0**power
    squared = unit * unit
    found = ratio_reach(late * unit, unit, own1 * squared, own2 * squared, shared * squared, 1.0)
    assert found == pytest.approx(expected, abs=1.01 * (shares[1] - shares[0]) / BAND)


def test_where_the_light_is_twenty_times_its_noise_the_tangent_goes_over_into_it() -> None:
    """There the two are apart by no more than the square of the noise of the whole over it."""
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [1e-3, 1.0]}})
    whole = np.array([20.0 * (1 - 1e-9), 20.0 * (1 + 1e-9)])
    frames = Frames(np.column_stack([0.4 * whole, whole]))
    scene = parse_scene({"discrepancy": 0})
    bent, straight = estimate(sensor, scene, frames, ["conventional"]).results[0].sd_m
    assert straight == pytest.approx(R0 * 0.4 / 20.0, rel=1e-4)
    # the upper end is 3 / (1 - 3 / 20) of it away
    assert bent == pytest.approx(straight / (1.0 - BAND / 20.0), rel=1e-3)


@pytest.mark.parametrize("times", [0.5, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("late_noise", [0.02, 0.3, 1.0])
def test_faint_ranges_are_not_far_off(late_noise: float, times: float) -> None:
    """Of a whole window of some times its noise; a late one may have far less noise.

    Noise is beyond three standard deviations in 0.27 % of frames. By the tangent 8 % of answers
    were more than five off where the late window had a tenth of the noise. A false alarm once in
    1e6 runs of all.
    """
    document = {"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [late_noise, 1.0]}}
    sensor = parse_sensor(document)
    rng = np.random.default_rng(20261128)
    for share in (0.1, 0.35, 0.7, 0.95):
        readings = times * np.array([share, 1.0]) + rng.normal(size=(FRAMES, 2)) * [late_noise, 1.0]
        scene = parse_scene({"discrepancy": 0})
        (found,) = estimate(sensor, scene, Frames(readings), ["conventional"]).results
        off = np.abs(found.range_m - share * R0) / found.sd_m
        told = np.isfinite(off)
        assert told.sum() > FRAMES / 10
        assert (off[told] > BAND).sum() <= binom.isf(1e-6 / 48, FRAMES, 2 * norm.sf(BAND))


@pytest.mark.parametrize("times", [1.0, 3.0, 10.0, 1e3])
@pytest.mark.parametrize("late_noise", [0.02, 0.3, 1.0])
def test_an_object_beyond_the_reach_of_a_pulse_is_told_for_one(
    late_noise: float, times: float
) -> None:
    """Both windows hold its whole pulse, and noise parts them: none of them may pass for nearer.

    Within three standard deviations of the range, and beyond half of the reach alone, 2 % of the
    frames of an object at 7 m, of three times its noise, were sure and up to 8 deviations off. A
    false alarm once in 1e6 runs of all.
    """
    document = {"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [late_noise, 1.0]}}
    sensor, rng = parse_sensor(document), np.random.default_rng(20261129)
    readings = times + rng.normal(size=(FRAMES, 2)) * [late_noise, 1.0]
    (found,) = estimate(sensor, parse_scene({}), Frames(readings), ["conventional"]).results
    sure = np.isfinite(found.sd_m) & ~found.near_fold
    assert sure.sum() <= binom.isf(1e-6 / 12, FRAMES, norm.sf(END_BAND))
    assert np.isfinite(found.range_m).sum() > FRAMES / 4


def test_where_the_scene_ends_before_the_reach_nothing_stands_beyond_it() -> None:
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [1e-3, 1.0]}})
    stated = {"range_m": {"prior": "uniform", "low": 0.1, "high": 4.0}}
    frames = Frames(np.array([[2.0, 3.0], [8.0, 10.0]]))
    (open_end,) = estimate(sensor, parse_scene({}), frames, ["conventional"]).results
    (ended,) = estimate(sensor, parse_scene(stated), frames, ["conventional"]).results
    assert open_end.near_fold.all()
    assert not ended.near_fold.any()


@pytest.mark.parametrize("times", [0.5, 1.0, 3.0, 10.0])
@pytest.mark.parametrize("late_noise", [0.02, 0.3, 1.0])
def test_ranges_by_derivatives_that_drown_are_not_far_off(late_noise: float, times: float) -> None:
    """The derivative of the whole window is some times its noise, of either sign.

    By the tangent 9 % of answers were more than five standard deviations off where the late
    derivative had a fiftieth of the noise. A false alarm once in 1e6 runs of all.
    """
    world = {"c0": 0.08, "c1": 0.05, "c2": 0.1}
    rng = np.random.default_rng(20261130)
    for r, sign in ((0.3, 1.0), (0.8, -1.0), (2.0, 1.0)):
        # d(flux)/dr, and d(r flux)/dr over r0, of flux ~ 1/(r² Q)
        fall = -2.0 / r - (2.0 * r + world["c1"]) / (r * r + world["c1"] * r + world["c0"])
        slope = sign * np.array([(1.0 + r * fall) / R0, fall]) / abs(fall)
        noise = [late_noise, 1.0]
        rates = times * slope + rng.normal(size=(FRAMES, 2)) * noise
        document = {"read": [1.0, 1.0], "derivative": noise}
        sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 3e-8, "noise": document})
        frames = Frames(np.full((FRAMES, 2), 1e6), derivatives=rates)
        scene = parse_scene({"object": world, "discrepancy": 0})
        (found,) = estimate(sensor, scene, frames, ["differential"]).results
        off = np.abs(found.range_m - r) / found.sd_m
        told = np.isfinite(off) & ~found.near_fold
        assert (off[told] > BAND).sum() <= binom.isf(1e-6 / 36, FRAMES, 2 * norm.sf(BAND))
        if times == 10.0:
            assert told.sum() > 0.6 * FRAMES


@pytest.mark.parametrize("times", [1.5, 3.0, 10.0])
@pytest.mark.parametrize("noise", [(0.1, 1.0), (1.0, 1.0), (1.0, 0.1)])
def test_an_object_at_contact_does_not_pass_for_one_at_the_far_end(
    noise: tuple[float, float], times: float
) -> None:
    """Noise turns its phase past zero, where the far end of the unambiguous range is.

    Within three standard deviations of the tangent an object at 8 cm was one at 81 m, 36 of its
    deviations off. Phases more than a quarter of a turn off belong to light that drowns. A false
    alarm once in 1e6 runs of all.
    """
    document = {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": list(noise)}}
    sensor, rng = parse_sensor(document), np.random.default_rng(20261201)
    r = 0.003 * sensor.max_range_m
    angle = 2 * np.pi * r / sensor.max_range_m
    signal = times * np.array([np.cos(angle), np.sin(angle)])
    readings = signal + rng.normal(size=(FRAMES, 2)) * noise
    (found,) = estimate(sensor, parse_scene({}), Frames(readings), ["conventional"]).results
    bright = readings[:, 0] > 0
    passed = np.isfinite(found.sd_m) & bright & (found.range_m > 0.5 * sensor.max_range_m)
    assert passed.sum() <= binom.isf(1e-6 / 9, FRAMES, norm.sf(END_BAND))
    assert np.isfinite(found.range_m).sum() > FRAMES / 4
