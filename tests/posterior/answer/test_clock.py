"""Known ranges beside readings whose clock errs."""

import numpy as np
import pytest

from inference.posterior.answer.clock import as_ruled, with_clock_error
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

SIZE = 8e-4


def ruled(sd: list[float]) -> Frames:
    known = np.array([0.5, np.nan, 0.7, 0.9])
    return Frames(np.ones((4, 2)), known_range_m=known, known_range_sd_m=np.array(sd))


@pytest.mark.parametrize("sd", [1e-6, 3e-4, 1e-2])
def test_a_ruled_range_has_its_law_given_the_effective_distance(sd: float) -> None:
    """By Bayes's rule for two normal laws; 40,000 draws, six standard errors of their moments."""
    frames, rng = ruled([sd, np.nan, sd, sd]), np.random.default_rng(1)
    effective = np.array([0.501, 0.6, 0.699, 0.9])
    draws = as_ruled(frames, np.tile(effective, (40_000, 1)), SIZE, rng)
    assert np.array_equal(draws[:, 1], np.full(40_000, 0.6))
    share = sd**2 / (sd**2 + SIZE**2)
    told = [0, 2, 3]
    known = np.asarray(frames.known_range_m)[told]
    mean = known + share * (effective[told] - known)
    # the smooth error of the clock that draws have is the other part of share * SIZE^2
    spread = np.sqrt(share * SIZE**2 - (share * SIZE) ** 2)
    assert draws[:, told].mean(axis=0) == pytest.approx(mean, abs=6.0 * spread / 200.0)
    assert draws[:, told].std(axis=0) == pytest.approx(spread, rel=6.0 / np.sqrt(80_000.0))


def test_a_clock_without_error_and_no_ruler_change_nothing() -> None:
    frames, rng = ruled([1e-3] * 4), np.random.default_rng(1)
    draws = np.full((3, 4), 0.6)
    assert with_clock_error(frames, 0.0) is frames
    assert as_ruled(frames, draws, 0.0, rng) is draws
    bare = Frames(np.ones((4, 2)))
    assert with_clock_error(bare, SIZE) is bare
    assert as_ruled(bare, draws, SIZE, rng) is draws
    wider = with_clock_error(frames, SIZE)
    assert wider.known_range_sd_m == pytest.approx(np.hypot(1e-3, SIZE))
    assert wider.known_range_m is frames.known_range_m


def test_bright_frames_on_a_rail_are_no_misfit() -> None:
    """Draws took the clock for exact: a misfit, chi-square 2,271 for 77, crosstalk 4.5 sd off."""
    signal = 0.28 * 0.15 / (1.0 - 0.36 + 0.28)
    read = signal / 300.0
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [read, read]}}
    )
    way = np.geomspace(0.11, 1.9, 30)
    truth = {
        "object": {"c0": 0.28, "c1": -0.36, "c2": 0.15},
        "crosstalk": [1e-4, 2.5e-3],
        "discrepancy": {"flux": 0.02, "range_m": 8e-4},
    }
    seen = simulate(sensor, parse_scene(truth), SampledTrajectory(range_m=way.tolist()), 2).frames
    empty = np.array([1e-4, 2.5e-3]) + read * np.random.default_rng(5).standard_normal((5, 2))
    present = np.arange(35) >= 5
    known = np.append(np.full(5, np.nan), way)
    frames = Frames(
        np.concatenate([empty, seen.readings]),
        object_present=present,
        known_range_m=known,
        known_range_sd_m=np.where(present, 1e-6, np.nan),
    )
    scene = parse_scene({"crosstalk": [{"prior": "halfnormal", "sd": 0.01}] * 2})
    found = infer(sensor, scene, frames, SamplerSettings(seed=1, target_ess=60, max_seconds=30.0))
    assert found.fit.misfit is False
    for path, true in (("crosstalk.w1", 1e-4), ("crosstalk.w2", 2.5e-3), ("object.c0", 0.28)):
        told = found.parameters[path]
        assert told.mean == pytest.approx(true, abs=4.0 * told.sd)
    assert found.parameters["crosstalk.w1"].sd < 2.0 * read / np.sqrt(5.0)
    # the rail is known no worse for that
    assert found.range_m.sd[5:] == pytest.approx(1e-6, rel=0.2)
    assert np.abs(found.range_m.mean[5:] - way).max() < 5e-6
