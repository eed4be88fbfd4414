"""Frames that ask for a larger error of the model than its default get no sure answer by it."""

import numpy as np
import pytest

from benchmarks.random_sets.sets import random_set
from inference.estimate import estimate
from inference.estimates import Estimates
from inference.fits.answer.report import DOUBTFUL
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

TRUTH = [0.1025, 0.1425, 0.185, 0.2225, 0.2625, 0.305, 0.3425, 0.3825]
# recorded photons, whose flux errs by three times the default, behind a tenth of crosstalk
W1 = [847011.8, 792604.8, 705754.4, 631321.9, 566848.8, 509212.9, 468333.0, 432718.2]
W2 = [14214782.3, 9510922.4, 6595955.7, 4992841.6, 3890302.6, 3095053.3, 2610657.0, 2231831.1]
SIGNAL = 613364.9, 5330125.7
READ = 259.834, 852.894


def asked(unit: float, discrepancy: object) -> Estimates:
    sensor = parse_sensor(
        {
            "kind": "pulsed",
            "pulse_width_s": 1.1648e-8,
            "gain": 1e6 * unit,
            "noise": {"read": [unit * sd for sd in READ], "relative": 7.95672e-4},
        }
    )
    scene = parse_scene(
        {
            "object": {"c2": {"prior": "lognormal", "median": 1.0, "sigma": 3.0}},
            "crosstalk": [{"prior": "halfnormal", "sd": unit * sd} for sd in SIGNAL],
            "discrepancy": discrepancy,
        }
    )
    frames = Frames(unit * np.column_stack([W1, W2]))
    return estimate(sensor, scene, frames, ["joint_fit"])


@pytest.mark.parametrize("unit", [1e-12])
def test_recorded_photons_without_empty_frames_are_refused(unit: float) -> None:
    """Was 15 to 27 sd off in every frame, without a misfit."""
    said = asked(unit, "default")
    assert not said.results
    assert "without the object" in (said.do_first or "")


def test_a_size_that_is_stated_stands() -> None:
    said, *_ = asked(1.0, {"flux": 0.072, "range_m": 8e-4, "shadow": 0.2}).results
    assert (np.abs(said.range_m - TRUTH) > 5.0 * said.sd_m).all()


def test_a_fit_that_is_nearly_a_misfit_takes_the_error_as_larger() -> None:
    """Exact optics: p was 0.0011, and the farthest range 2.7 sd off."""
    case = random_set(4711, 2)
    (said,) = estimate(case.sensor, parse_scene(case.scene), case.frames, ["joint_fit"]).results
    assert said.fit is not None
    assert said.fit["p_value"] > DOUBTFUL
    off = np.abs(said.range_m - case.range_m) / said.sd_m
    assert np.nanmax(off) < 2.0
