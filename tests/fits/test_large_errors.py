"""Errors of the model that are far larger than the noise."""

import numpy as np
import pytest
from scipy import special

import hybridtof
from inference.fits.likelihood import erring_point
from inference.fits.likelihood.erring_climb import FEW, begun, climbed, with_other_ranges
from inference.fits.likelihood.problem import fit_problem
from simulator.model_error import ModelError
from tests.fits.random_sets import RandomSet, random_set
from tests.fits.scenes import values_of
from tests.thorough import first

_DEFAULT = ModelError.stated(None)


@pytest.mark.parametrize(
    ("name", "seeds"),
    [
        ("free shadow", (7, 11, 13, 2, 9, 15)),
        pytest.param("everything", (1, 5, 13), marks=pytest.mark.thorough),
    ],
)
def test_intervals_by_default_hold_the_truth_behind_errors_of_the_default(
    name: str, seeds: tuple[int, ...]
) -> None:
    """Fits of these sets that take their model for exact end up to 6 standard deviations off.

    The frames of a set share their errors: a median of |z| is above 3.3 in 1e-3 of sets, and so is
    the sum of the squares of the medians above the limit of its chi-square. `make test` takes half.
    """
    errors = {"flux": _DEFAULT.flux, "range_m": _DEFAULT.range_m}
    medians = []
    for seed in first(3, seeds):
        one = random_set(name, "pulsed", seed, "default", errors)
        answer = hybridtof.estimate(one.sensor, one.scene, one.simulation.frames, ["joint_fit"])
        (result,) = answer.results
        assert result.fit is not None
        assert not result.fit["misfit"]
        assert result.sd_parts_m is not None
        squares = sum(part**2 for part in result.sd_parts_m)
        # other ends of the search widen what frames share
        np.testing.assert_allclose(squares, result.roots_sd_m**2, rtol=1e-9)
        misses = np.abs(result.range_m - one.simulation.range_m) / result.sd_m
        assert np.isfinite(misses).sum() > 10
        # and no interval is as wide as it was: a fifth of the range and more
        assert np.nanmedian(result.sd_m / result.range_m) < 0.2
        medians.append(float(np.nanmedian(misses)))
    assert max(medians) < 3.3
    assert np.square(medians).sum() < special.chdtri(len(medians), 1e-3)


def bright_set(kind: str, decades: float) -> RandomSet:
    errors = {"flux": _DEFAULT.flux, "range_m": _DEFAULT.range_m}
    return random_set("crosstalk", kind, 7, "default", errors, (decades, decades))


@pytest.mark.parametrize(
    ("kind", "decades", "places", "farther"),
    [("pulsed", 6.0, (5, 20), 1.8), ("sine_wave", 7.0, (12, 22), 2.0)],
)
def test_a_climb_comes_back_from_other_ranges_of_two_frames(
    kind: str, decades: float, places: tuple[int, int], farther: float
) -> None:
    """These are six to seven times too far, and bend everything else towards themselves."""
    one = bright_set(kind, decades)
    problem = fit_problem(one.sensor, one.scene, one.simulation.frames)
    true = values_of(one.sensor, one.truth)
    x = problem.coordinates(np.array([[true[name] for name in problem.names]]))[0]
    positions = np.log(one.simulation.range_m)
    top, _ = climbed(problem, begun(problem, x, positions), 30)
    positions[list(places)] += farther
    at, _ = climbed(problem, begun(problem, x, positions), FEW)
    assert at.deviance > 1e6 + top.deviance
    back = with_other_ranges(problem, at, x, positions)
    assert back.deviance == pytest.approx(top.deviance, abs=1.0)


@pytest.mark.parametrize(
    ("kind", "decades"),
    [("pulsed", 6.0), pytest.param("sine_wave", 7.0, marks=pytest.mark.thorough)],
)
def test_a_frame_that_errors_turn_into_another_range_bends_no_fit(
    kind: str, decades: float
) -> None:
    """Two frames of this set have other ranges by every start near the truth.

    From there no climb comes back: the best end was 42 % too far, or none was a top. A median of
    |z| of frames that share their errors is above 3.3 in 1e-3 of sets.
    """
    one = bright_set(kind, decades)
    answer = hybridtof.estimate(one.sensor, one.scene, one.simulation.frames, ["joint_fit"])
    (result,) = answer.results
    assert result.fit is not None
    assert not result.fit["misfit"]
    misses = np.abs(result.range_m - one.simulation.range_m)
    assert np.isfinite(misses).all()
    assert np.median(misses / result.sd_m) < 3.3
    assert np.median(misses / result.range_m) < 0.02


def test_errors_a_hundred_million_times_the_noise_have_a_root() -> None:
    """The covariance of the noise, 1, is no part of a double beside squared errors of 1e16."""
    along = np.array([[0.0, 0.0], [3.0, 4.0], [3e8, 4e8], [1e8, 1e-9]])
    left = along[:, :, None] * along[:, None, :]
    root = erring_point._root_of(left)
    np.testing.assert_array_equal(root[0], np.eye(2))
    assert np.diagonal(root, axis1=1, axis2=2).min() >= 1.0
    for one, whole in zip(root, left, strict=True):
        expected, size = whole + np.eye(2), 1.0 + np.trace(whole)
        np.testing.assert_allclose(one @ one.T, expected, atol=2e-12 * size)


@pytest.mark.thorough
def test_a_frame_without_late_light_beside_frames_of_little_noise_is_answered() -> None:
    """Of four frames, of which one is next to nothing: fits and techniques answer or refuse."""
    noise = {"read": [1e-6, 1e-6], "derivative": [1e-5, 1e-5]}
    sensor = hybridtof.parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise})
    crosstalk = [{"prior": "normal", "mean": 0.0, "sd": 0.1}] * 2
    scene = hybridtof.parse_scene({"object": {"c0": 0.08, "c1": 0.0}, "crosstalk": crosstalk})
    columns = {
        "time_s": [0.0, 0.1, 0.2, 0.3],
        "w1": [0.0, 0.0119, 0.0099, 0.0085],
        "w2": [0.441, 0.297, 0.212, 0.159],
        "dw1_dt": [-0.033, -0.024, -0.017, -0.012],
        "dw2_dt": [-1.76, -1.13, -0.67, -0.42],
    }
    frames = hybridtof.frames_from_columns(sensor, columns)
    names = ["crosstalk_fit", "joint_fit", "iterative_differential"]
    answer = hybridtof.estimate(sensor, scene, frames, names)
    refused = {each.name for each in answer.left_out}
    assert {each.technique for each in answer.results} | refused >= set(names)


def test_of_a_stroke_a_fit_takes_the_support_alone() -> None:
    """A stroke has two unknowns more, which a fit does not have: it is what `reference` is."""
    one = random_set("object", "pulsed", 7, "default", None, (3.0, 3.0))
    found = []
    for prior in ("stroke", "reference"):
        law = type(one.scene).model_validate(
            one.scene.model_dump(exclude_unset=True)
            | {"range_m": {"prior": prior, "low": 0.05, "high": 3.0}}
        )
        answer = hybridtof.estimate(one.sensor, law, one.simulation.frames, ["joint_fit"])
        found.append(answer.results[0].range_m)
    np.testing.assert_array_equal(found[0], found[1])
