"""Fits of a source that flickers decide against ranges that would send far more light than came."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.fits.likelihood.erring_point import left_of_frames
from inference.fits.likelihood.lacking_light import share_of_light
from inference.fits.likelihood.problem import fit_problem
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

READ, RELATIVE, WAVE = 1e-4, 5e-3, 4 * math.pi * 2e7 / 299792458.0
CROSSTALK = np.array([0.24, -0.18])
NOISE = {"read": [READ, READ], "relative": RELATIVE, "relative_of": "source"}
SENSOR = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": NOISE})
WIDE = {"prior": "normal", "mean": 0.0, "sd": 1.0}


def light(r: NDArray[np.float64]) -> NDArray[np.float64]:
    flux = 0.06 * 0.1 / (r**2 * (r**2 + 0.04 * r + 0.06))
    return np.asarray(flux[:, None] * np.column_stack([np.cos(WAVE * r), np.sin(WAVE * r)]))


def test_no_end_of_the_ranges_explains_what_is_a_hundredth_of_its_light() -> None:
    """Half of the frames had the near end for their range, in place of the one beside the others.

    Read and flicker are drawn by the law itself.
    """
    rng = np.random.default_rng(1)
    ranges = np.geomspace(0.4, 1.1, 10)
    mean = np.vstack([np.zeros((5, 2)), light(ranges)]) + CROSSTALK
    drawn = mean * (1.0 + RELATIVE * rng.standard_normal((15, 1)))
    frames = Frames(
        drawn + READ * rng.standard_normal(drawn.shape), object_present=np.arange(15) >= 5
    )
    scene = parse_scene({"object": {"c1": 0.04}, "crosstalk": [WIDE, WIDE]})
    (found,) = estimate(SENSOR, scene, frames, ["joint_fit"]).results
    off = np.abs(found.range_m[5:] - ranges) / found.sd_m[5:]
    assert np.isfinite(off).all()
    assert off.max() < 4.0


@pytest.mark.parametrize("times", [0.01, 0.5, 1.0, 2.0])
def test_light_that_lacks_counts_by_its_logarithm(times: float) -> None:
    """What is left of light over what linear errors of it are worth is the logarithm."""
    ranges = np.array([0.4, 0.7])
    scene = parse_scene({"crosstalk": CROSSTALK.tolist(), "discrepancy": {"flux": 0.1}})
    bright = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [1e-9] * 2}})
    problem = fit_problem(bright, scene, Frames(times * light(ranges) + CROSSTALK))
    x = problem.coordinates(
        np.array([[{"0": 0.06, "1": 0.04, "2": 0.1}[p[-1]] for p in problem.names]])
    )
    share = share_of_light(problem, x[0], np.log(ranges))
    wanted = (1.0 - times) / -math.log(times) if times < 1.0 else 1.0
    assert share == pytest.approx(np.full(2, wanted), rel=1e-4)


def test_a_range_that_cannot_give_way_counts_both_readings_each_by_what_moves_it() -> None:
    """A reading that nothing moves is not explained by what moves the other one."""
    scene = parse_scene({"crosstalk": CROSSTALK.tolist(), "discrepancy": {"flux": 0.1}})
    problem = fit_problem(SENSOR, scene, Frames(light(np.array([0.4, 0.7]))))
    rng = np.random.default_rng(2)
    residual, more = rng.standard_normal((2, 2)), rng.standard_normal((2, 2, 3))
    more[0, 0] = 0.0
    more[0, 1] *= 1e3
    none, at = np.zeros((2, 2, 0)), np.log([0.4, 0.7])
    left = left_of_frames(problem, at, residual, np.zeros((2, 2)), none, more)
    each = [
        e @ np.linalg.solve(np.eye(2) + m @ m.T, e) for e, m in zip(residual, more, strict=True)
    ]
    assert left == pytest.approx(np.array(each), rel=1e-6)
    assert left[0] == pytest.approx(residual[0, 0] ** 2, abs=1e-4)
