"""Directions of derivatives where noise or bias points along them."""

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
DROWNED = DERIVATIVE_REASONS[2]


def told(
    kind: str, r: np.ndarray, noise: dict[str, object], seed: int = 0, motion: str = "radial"
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Errors over sd of `differential`, nan where nothing is told, sd and the reasons."""
    sensor = parse_sensor({**KINDS[kind], "noise": noise})
    time = np.arange(r.size, dtype=np.float64)
    truth = parse_scene({"object": OBJECT, "discrepancy": 0})
    path = SampledTrajectory(range_m=r.tolist(), time_s=time.tolist())
    frames = simulate(sensor, truth, path, seed).frames
    scene = parse_scene({"object": OBJECT, "motion": motion})
    (found,) = estimate(
        sensor, scene, Frames(frames.readings, time_s=time), ["differential"]
    ).results
    off = (found.range_m - r) / found.sd_m
    off[found.near_fold] = np.nan
    return off, found.sd_m, [found.reasons[i] for i in found.reason]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_a_flickering_source_is_no_motion(kind: str, seed: int) -> None:
    """At rest, with a relative error that is stated: all frames told ranges, 30 sd off.

    A change of five standard deviations of that error is told in 6e-7 of windows, so that frames
    with a range are 1 in 1e4 runs. In motion that outruns the flicker all but the ends are told,
    and so is an object at a fixed range of changing amplitude, for which flicker is no error.
    """
    noise = {"read": [1e-7, 1e-7], "relative": 3e-3}
    _, sd, reasons = told(kind, np.full(16, 0.4), noise, seed)
    assert np.isnan(sd).all()
    assert reasons.count(DROWNED) >= 14
    moving, _, _ = told(kind, np.geomspace(0.3, 0.9, 16), noise, seed)
    assert np.isfinite(moving).sum() >= 14
    assert np.nanmax(np.abs(moving)) < 5.0
    flickering, _, _ = told(kind, np.full(16, 0.4), noise, seed, "tangential")
    assert np.isfinite(flickering).sum() >= 14
    assert np.nanmax(np.abs(flickering)) < 5.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ratio", [4.5, 6.0])
def test_frames_beside_a_turn_serve_those_farther_from_it(kind: str, ratio: float) -> None:
    """There and back in 24 frames: windows that ended before the turn were 6 to 9 sd off.

    Nothing but bias counts at this noise, and centred windows tell what is left of it.
    """
    r = 0.2 * (1.0 + (ratio - 1.0) * np.sin(np.pi * np.linspace(0.0, 1.0, 24)) ** 2)
    off, sd, _ = told(kind, r, {"read": [1e-8, 1e-8]})
    assert np.isfinite(off).sum() >= 14
    assert np.nanmax(np.abs(off)) < 3.0
    assert np.nanmedian(sd / r) < 0.1


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("frames", "farther"), [(6, 4.0), (7, 4.0), (7, 5.0), (9, 5.0)])
def test_a_bias_that_vanishes_at_one_frame_is_told_by_its_neighbours(
    kind: str, frames: int, farther: float
) -> None:
    """Few frames, evenly in log r: one before the last was 7 to 11 sd off."""
    r = np.geomspace(0.3, 0.3 * farther, frames)
    off, sd, _ = told(kind, r, {"read": [1e-8, 1e-8]})
    assert np.isfinite(off).sum() >= frames - 1
    assert np.nanmax(np.abs(off)) < 3.0
    assert np.nanmedian(sd / r) < 0.3


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("near", [0.22, 0.3, 0.4])
def test_windows_to_one_side_that_do_not_converge_say_so(kind: str, near: float) -> None:
    """Eight coarse frames at constant speed: the far end was 9 to 14 sd off.

    The light grows severalfold within a window there, and a derivative of five readings is as far
    off as one of three. Nothing but bias counts at this noise.
    """
    far = near + 7 * 0.1 * near * 3.3
    for r in (np.linspace(far, near, 8), np.linspace(near, far, 8)):
        off, sd, _ = told(kind, r, {"read": [1e-8, 1e-8]})
        assert np.nanmax(np.abs(off)) < 3.0
        assert np.isfinite(sd).sum() >= 4
