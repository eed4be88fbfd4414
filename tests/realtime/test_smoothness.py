"""Differences in time: an object that jumps has no derivative, and none is told."""

import numpy as np
import pytest
from scipy import stats

from inference.estimate import estimate
from inference.realtime.derivatives import DERIVATIVE_REASONS
from inference.realtime.net import Net
from inference.realtime.smoothness import rough
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
KINDS = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine wave": {"kind": "sine_wave", "frequency_hz": 5e6},
}
UNEVEN = DERIVATIVE_REASONS[3]
N = 30


def told(kind: str, r: np.ndarray, noise: float, unit: float = 1.0) -> tuple[np.ndarray, list[str]]:
    """Errors over sd of `differential`, nan where nothing is told, and the reasons."""
    sensor = parse_sensor({**KINDS[kind], "gain": unit, "noise": {"read": [noise * unit] * 2}})
    time = np.arange(r.size, dtype=np.float64)
    path = SampledTrajectory(range_m=r.tolist(), time_s=time.tolist())
    frames = simulate(sensor, parse_scene({"object": OBJECT, "discrepancy": 0}), path, 5).frames
    unknown = [{"prior": "normal", "mean": 0.0, "sd": unit}] * 2
    scene = parse_scene({"object": OBJECT, "crosstalk": unknown})
    (found,) = estimate(
        sensor, scene, Frames(frames.readings, time_s=time), ["differential"]
    ).results
    off = (found.range_m - r) / found.sd_m
    off[found.near_fold] = np.nan
    return off, [found.reasons[i] for i in found.reason]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", [1e-3, 1e-5, 1e-7])
def test_jumps_are_no_motion(kind: str, noise: float) -> None:
    """Places drawn anew, a walk, and moves between rests: ranges were up to 195 sd off."""
    rng = np.random.default_rng(3)
    paths = (
        np.exp(rng.uniform(np.log(0.2), np.log(1.2), N)),
        0.5 * np.exp(0.2 * np.cumsum(rng.choice([-1.0, 1.0], N) * rng.uniform(0.3, 1.0, N))),
        np.repeat([0.3, 0.9, 0.5, 0.7, 0.35], N // 5),
    )
    for r in paths:
        off, reasons = told(kind, r, noise)
        assert not np.abs(off[np.isfinite(off)]).max(initial=0.0) > 5.0
        if noise < 1e-3:
            assert UNEVEN in reasons


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", [1e-3, 1e-5, 1e-7])
def test_motion_that_windows_can_follow_is_told(kind: str, noise: float) -> None:
    """Constant speed, even steps in log r, and a turn, beside which alone nothing is told."""
    time = np.arange(N)
    for r in (np.linspace(0.3, 1.2, N), np.geomspace(0.2, 1.0, N)):
        _, reasons = told(kind, r, noise)
        assert UNEVEN not in reasons
    _, reasons = told(kind, 0.4 + 0.02 * np.abs(time - 15.0), noise)
    uneven = [i for i, reason in enumerate(reasons) if reason == UNEVEN]
    assert set(uneven) <= set(range(13, 18))
    if noise < 1e-3:
        assert 15 in uneven


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("noise", [1e-5, 1e-7])
def test_no_window_reaches_across_a_jump(kind: str, noise: float) -> None:
    """Slow motion with four jumps: frames up to 32 away from one were up to 18 sd off.

    Of 1,200 frames one is beyond 5 sd in 7e-4 of runs.
    """
    count = 200
    for seed in range(3):
        rng = np.random.default_rng(seed)
        r = 0.5 + 3e-5 * np.arange(count)
        for jump in rng.choice(np.arange(10, 190), 4, replace=False):
            r[jump:] *= np.exp(rng.uniform(-0.3, 0.3))
        off, reasons = told(kind, r, noise)
        assert not np.abs(off[np.isfinite(off)]).max(initial=0.0) > 5.0
        assert UNEVEN in reasons
        if noise < 1e-5:
            assert np.isfinite(off).sum() > count // 2


@pytest.mark.parametrize("n", [100, 1000, 5000])
def test_noise_alone_takes_no_long_slow_motion_away(n: int) -> None:
    """Steps of a hundredth of the noise; at most 1 % of tracks, this test fails once in 1e3.

    Two frames beyond four standard deviations took 46 of 100 tracks of 1000 frames, 95 of 5000.
    """
    rng, runs = np.random.default_rng(1), 100
    line, one, none = 0.01 * np.arange(float(n)), np.ones(n), np.zeros(n)
    taken = 0
    for _ in range(runs):
        first, second = line + rng.standard_normal((2, n))
        net = Net(first, second, one, one, none, 0.0, none.astype(np.uint8))
        taken += bool(rough(np.arange(float(n)), net, None).near.all())
    assert taken <= stats.binom.isf(1e-3, runs, 0.01)


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_units_change_nothing(unit: float) -> None:
    r = np.exp(np.random.default_rng(3).uniform(np.log(0.2), np.log(1.2), N))
    assert told("pulsed", r, 1e-5, unit)[1] == told("pulsed", r, 1e-5)[1]
