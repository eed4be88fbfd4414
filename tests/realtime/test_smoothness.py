"""Differences in time: an object that jumps has no derivative, and none is told."""

import numpy as np
import pytest

from inference.estimate import estimate
from inference.realtime.derivatives import DERIVATIVE_REASONS
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


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_units_change_nothing(unit: float) -> None:
    r = np.exp(np.random.default_rng(3).uniform(np.log(0.2), np.log(1.2), N))
    assert told("pulsed", r, 1e-5, unit)[1] == told("pulsed", r, 1e-5)[1]
