"""Frames whose ranges would lie beyond the ends of what is possible keep no fit from its top."""

import numpy as np
import pytest

import hybridtof
from inference.estimates import TechniqueResult
from tests.posterior.scenes import OBJECT, SIGNAL_AT_1M, UNKNOWN_CROSSTALK


def answered(seed: int, farthest_m: float, understated: float) -> tuple[TechniqueResult, float]:
    """Fit a plate that goes to the end of a pulse's reach, 1.5 m, where noise puts frames beyond.

    The result, and its largest error in its own standard deviations within that reach.
    """
    read = SIGNAL_AT_1M / 30.0
    pulse = {"kind": "pulsed", "pulse_width_s": 1e-8}
    sensor = hybridtof.parse_sensor({**pulse, "noise": {"read": [read, read]}})
    true = hybridtof.parse_sensor({**pulse, "noise": {"read": [understated * read] * 2}})
    path = hybridtof.RadialTrajectory(from_m=0.25, to_m=farthest_m, frames=16)
    truth = {"object": OBJECT, "crosstalk": [0.002, 0.01], "discrepancy": 0}
    seen = hybridtof.simulate(true, hybridtof.parse_scene(truth), path, seed)
    scene = hybridtof.parse_scene({"crosstalk": UNKNOWN_CROSSTALK})
    (result,) = hybridtof.estimate(sensor, scene, seen.frames, ["joint_fit"]).results
    within = np.isfinite(result.range_m) & (seen.range_m < sensor.max_range_m)
    off = np.abs(result.range_m - seen.range_m)[within] / result.sd_m[within]
    return result, float(off.max(initial=0.0))


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_noise_that_is_understated_is_a_misfit_or_fits(seed: int) -> None:
    """It was refused: what ranges beyond the end would still gain was waited for."""
    result, off = answered(seed, 1.49, 2.0)
    assert result.fit is not None
    assert result.fit["misfit"] or off < 5.0


def test_an_object_that_leaves_the_reach_of_a_pulse_is_told_within_it() -> None:
    result, off = answered(0, 1.75, 1.0)
    assert result.fit is not None
    assert not result.fit["misfit"]
    assert np.isfinite(result.range_m).sum() > 8
    assert off < 4.0  # one of a dozen frames beyond it in a thousand runs
