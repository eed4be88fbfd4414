"""Frames at one place share what following errors of the model leaves of them."""

import dataclasses

import numpy as np
import pytest

import hybridtof
from benchmarks.random_sets.sets import random_set
from inference.fits.likelihood.erring_point import linearised
from inference.fits.likelihood.model_error import own_share_left, share_left
from inference.fits.likelihood.places import Places, places_of
from inference.fits.likelihood.problem import fit_problem
from inference.frame.arguments import Instrument
from simulator.discrepancy import NEGLECTED
from tests.fits.random_sets import random_set as drawn
from tests.fits.scenes import values_of


def _places(shot: float | None, gain: float, relative: float = 0.0) -> list[int]:
    """Ten frames at each of three places, one alone, one without object; noise 1."""
    rng = np.random.default_rng(4)
    light = np.repeat([[300.0, 4000.0], [250.0, 2500.0], [200.0, 1500.0]], 10, axis=0)
    light = np.concatenate([light, [[100.0, 500.0], [0.0, 0.0]]])
    light[:, :] *= gain
    light *= 1.0 + relative * rng.standard_normal((len(light), 1))
    light += rng.standard_normal(light.shape) * np.sqrt(1.0 + (shot or 0.0) * light)
    frames = np.column_stack([light, np.full(len(light), gain)])
    present = np.arange(len(light)) < len(light) - 1
    order = rng.permutation(len(light))
    at = Instrument(15.0, None, (1.0, 1.0), shot, relative if shot else None)
    found = places_of(frames[order], present[order], at)
    assert found is not None
    of_frame = np.empty(len(light), dtype=int)
    of_frame[order] = found.of_frame
    assert found.select(np.array([3, 5])).number == found.number
    return of_frame.tolist()


@pytest.mark.parametrize(
    ("shot", "gain", "relative"),
    [(None, 1.0, 0.0), (2.0, 1.0, 0.0), (None, 0.5, 0.0), (1e-3, 1.0, 0.01)],
)
def test_frames_that_read_alike_but_for_noise_are_at_one_place(
    shot: float | None, gain: float, relative: float
) -> None:
    assert _places(shot, gain, relative) == [2] * 10 + [1] * 10 + [0] * 10 + [-1, -1]


def test_frames_along_a_path_are_at_no_place() -> None:
    path = np.geomspace(1000.0, 2000.0, 400)
    frames = np.column_stack([0.1 * path, path, np.ones(path.size)])
    at = Instrument(15.0, None, (1.0, 1.0), None, None)
    assert places_of(frames, np.ones(path.size, dtype=bool), at) is None
    apart = frames[::20]
    assert places_of(apart, np.ones(len(apart), dtype=bool), at) is None


def test_what_errors_leave_of_frames_at_one_place_is_one_error_of_all_of_them() -> None:
    """As large as that of a frame that is alone, which is its own."""
    errors = {"flux": 0.07, "range_m": 1e-3}
    one = drawn("crosstalk", "pulsed", 3, errors, errors)
    alone = fit_problem(one.sensor, one.scene, one.simulation.frames)
    known, u = values_of(one.sensor, one.truth), np.log(one.simulation.range_m)
    x = alone.coordinates(np.array([[known[name] for name in alone.names]]))[0]
    of_frame = np.full(u.size, -1)
    for place, there in enumerate(([0, 4, 7], [2, 5])):
        of_frame[there], u[there] = place, u[there[0]]
    together = dataclasses.replace(alone, places=Places(of_frame, 2))
    own, both = (linearised(problem, x, u)[3] for problem in (alone, together))
    np.testing.assert_array_equal(both[:, :, : own.shape[2]], own)
    share, shared = share_left(alone, u), both[:, :, own.shape[2] :]
    np.testing.assert_allclose(own_share_left(together, u), np.where(of_frame < 0, share, 0.0))
    found = np.einsum("nik,mjk->nmij", shared, shared)
    single = share * np.einsum("nik,njk->nij", own, own)
    same = (of_frame[:, None] == of_frame) & (of_frame >= 0)
    assert not found[~same].any()
    for n, m in zip(*np.nonzero(same), strict=True):
        # functions of log r leave that much of the variance out
        size = float(np.abs(single[n]).max())
        np.testing.assert_allclose(found[n, m], single[n], atol=2.0 * NEGLECTED * size)


@pytest.mark.thorough
@pytest.mark.parametrize("number", [22, 80])
def test_another_optimum_behind_less_crosstalk_is_found(number: int) -> None:
    """Two random sets, whose crosstalk was `identified` 11 and 7,389 standard deviations off.

    Set 80 has 40 frames at four places, and its ranges were 40 off.
    """
    data = random_set(20_261_125, number)
    scene = hybridtof.parse_scene(data.scene)
    (result,) = hybridtof.estimate(data.sensor, scene, data.frames, ["joint_fit"]).results
    assert result.parameters is not None
    assert np.nanmax(np.abs(result.range_m - data.range_m) / result.sd_m) < 3.5
    for name, told in result.parameters.items():
        if told["status"] == "identified":
            assert abs(told["value"] - data.parameters[name]) < 3.5 * told["sd"]
