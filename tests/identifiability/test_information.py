"""Rank, bounds and singular values against 50 digits, by counting, and by Monte Carlo."""

import dataclasses
import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from inference.identifiability.elimination import eliminate
from inference.identifiability.experiment import Experiment, information
from tests.identifiability.precise import DIGITS, precise_jacobian, projected
from tests.identifiability.published import (
    BARE,
    CROSSTALK,
    OBJECT,
    SENSOR,
    SHADOW,
    System,
    is_printed,
)

Array = NDArray[np.float64]

A = (*OBJECT, *BARE)
B = (*A, *SHADOW)
EVERYTHING = (*B, *CROSSTALK)
HARD = [
    System(A, 3.0, "P", frames=5, shared=True),
    System(B, 3.0, "P", frames=7),
    System(B, 3.0, "A", frames=7),
    System(B, 10.0, "A", frames=9, gone=2),
    System(EVERYTHING, 3.0, "P", crosstalk=True, frames=9),
    System(EVERYTHING, 10.0, "A", crosstalk=True, frames=12),
    System((*OBJECT, *CROSSTALK), None, "A", crosstalk=True, frames=5),
]


@pytest.mark.parametrize("system", HARD, ids=lambda s: f"{len(s.unknown)}-{s.noise}-{s.frames}")
def test_against_fifty_digits(system: System) -> None:
    """Exactly determined systems are the worst: the bounds are compared with those of 50 digits.

    A singular value s has a relative error of about eps |J| / s, the condition number times eps.
    """
    found = system.information()
    experiment, sds = system.experiment(), system.sds()
    frames = precise_jacobian(system, experiment, sds)
    with mp.workdps(DIGITS):
        matrix = projected(frames)
        values = mp.svd_r(matrix, compute_uv=False)
        least = float(min(values))
        covariance = (matrix.T * matrix) ** -1
        sd = np.array([float(mp.sqrt(covariance[j, j])) for j in range(matrix.cols)])
        # the differences of 1e-20 leave 20 digits, and the least singular value far above them
        assert min(values) > mp.mpf(10) ** -15 * max(values)
    assert found.rank == len(system.unknown)
    before = float(np.linalg.norm(found.before))
    tolerance = 100 * np.finfo(float).eps * before / least
    assert tolerance < 1e-2
    assert found.singular_values[-1] == pytest.approx(least, rel=tolerance)
    assert found.sd == pytest.approx(sd, rel=tolerance)


@pytest.mark.parametrize("common", [False, True])
def test_a_range_that_moves_readings_by_no_number_is_one_that_moves_none(common: bool) -> None:
    """The variance of its log, one over the square of 1e-157, overflowed."""
    jacobian = np.random.default_rng(1).normal(size=(2, 2, 1))
    still = eliminate(("a",), jacobian, np.zeros((2, 2)), common_range=common)
    found = eliminate(("a",), jacobian, np.full((2, 2), 1e-157), common_range=common)
    assert np.isposinf(found.own_variance).all()
    np.testing.assert_array_equal(found.jacobian, still.jacobian)
    np.testing.assert_array_equal(found.response, still.response)


@pytest.mark.parametrize(("unknown", "shared"), [(A, True), (B, False)])
@pytest.mark.parametrize("noise", ["P", "A"])
def test_each_distinct_range_tells_one_number(
    unknown: tuple[str, ...], shared: bool, noise: str
) -> None:
    for frames in range(1, len(unknown) + 3):
        found = System(unknown, 3.0, noise, frames=frames, shared=shared).information()
        assert found.rank == min(frames, len(unknown))
        told = np.isfinite(found.sd)
        assert told.all() == (found.rank == len(unknown))
        assert (found.singular_values[found.rank :] == 0).all()


def test_an_object_that_does_not_move() -> None:
    """Forty frames at one range tell one number; three empty ones two more, which are R and B."""
    still = System(A, 3.0, "P", shared=True, span=(1.0, 1.0))
    assert still.information().rank == 1
    assert np.isinf(still.information().sd).all()
    assert np.isinf(still.information().range_sd).all()
    emptied = System(A, 3.0, "P", shared=True, span=(1.0, 1.0), gone=3).information()
    assert emptied.rank == 3
    told = dict(zip(emptied.names, np.isfinite(emptied.sd), strict=True))
    assert told == {name: name in BARE for name in A}
    assert np.isinf(emptied.range_sd[:37]).all()
    assert np.isnan(emptied.range_sd[37:]).all()
    # each of three frames gives R with 1.4 and B with 1 at a signal-to-noise ratio of one
    sd = dict(zip(emptied.names, emptied.sd, strict=True))
    assert sd[BARE[1]] == pytest.approx(math.sqrt(2 / 3), rel=1e-9)
    assert sd[BARE[0]] == pytest.approx(math.sqrt(1 / 3), rel=1e-9)


def test_one_frame_tells_the_distance_where_all_else_is_known() -> None:
    """Published: rank 1 of 1, 1.2 to 1.4 at a signal-to-noise ratio of one and a range of 1.1 m."""
    for distance, printed in ((3.0, 1.2), (10.0, 1.4)):
        system = System((BARE[1],), distance, "P", frames=2, span=(1.1, 1.1))
        found = system.information()
        assert found.rank == 1
        assert is_printed(float(found.sd[0]) * math.sqrt(2), printed)


def test_nothing_unknown_and_no_frame_that_tells() -> None:
    known = System((), 3.0, "P").information()
    assert (known.rank, known.sd.size, known.singular_values.size) == (0, 0, 0)
    assert np.isfinite(known.range_sd).all()
    assert math.isfinite(known.scale_sd)
    dark = eliminate(("x",), np.zeros((3, 2, 1)), np.zeros((3, 2)))
    assert dark.rank == 0
    assert np.isinf(dark.sd).all()
    assert np.isinf(dark.range_sd).all()
    assert math.isinf(dark.scale_sd)


def test_directions() -> None:
    """Published: the weak direction of a known distance and a free shadow is c0 with c0'."""
    (worst,) = System((*OBJECT, *SHADOW), 3.0, "P").information().directions()
    found = System((*OBJECT, *SHADOW), 3.0, "P").information()
    assert worst[0] == pytest.approx(1 / found.singular_values[-1], rel=1e-9)
    assert {"object.c0", "background.shadow.c0", "background.shadow.c1"} <= worst[1].keys()
    few = System(B, 3.0, "P", frames=4).information()
    open_ones = few.directions()
    assert [sd for sd, _ in open_ones[:3]] == [math.inf] * 3
    assert math.isfinite(open_ones[3][0])
    size = np.linalg.norm(few.before)
    for _, weights in open_ones[:3]:
        vector = np.array([weights.get(name, 0.0) for name in few.names])
        # weights below 1 % are left out
        assert np.linalg.norm(few.jacobian @ vector) < 0.03 * size


def test_companions_leave_the_readings_as_they_are() -> None:
    found = System(B, 3.0, "P", frames=4).information()
    size = np.linalg.norm(found.before)
    for index in range(len(B)):
        direction = found.companions(index)
        assert direction[index] == pytest.approx(1.0)
        change = found.jacobian @ direction
        assert np.abs(change).max() < 1e-12 * size * np.linalg.norm(direction)


@settings(max_examples=40, deadline=None)
@given(
    exponent=st.integers(-12, 12),
    system=st.sampled_from([System(A, 3.0, "P", frames=12, shared=True), HARD[4], HARD[2]]),
)
def test_units_of_readings_do_not_matter(exponent: int, system: System) -> None:
    factor = 10.0**exponent
    plain = system.information()
    jacobian, along, _ = system.experiment().whitened(
        np.einsum("ni,ij->nij", 1 / system.sds() / factor, np.eye(2))
    )
    scaled = eliminate(plain.names, jacobian, along)
    assert scaled.rank == plain.rank
    # rounding, amplified by the condition number
    tolerance = 100 * np.finfo(float).eps * np.linalg.norm(plain.before) / plain.singular_values[-1]
    assert tolerance < 1e-2
    assert scaled.sd / factor == pytest.approx(plain.sd, rel=float(tolerance))


def test_bound_is_attained() -> None:
    """Least squares over everything in 150 data sets at a signal-to-noise ratio of 1e4.

    Published: 3.05e-3 in 40 trials against a bound of 2.69e-3. The sum of squared errors over the
    bound is chi-square; the interval has a false-alarm rate of 1e-6 for an exact normal, widened
    by 5 % for what the curvature adds.
    """
    system, snr, trials = System(A, 10.0, "P", shared=True), 1e4, 150
    bound = system.information().sd[A.index(BARE[1])] / snr
    experiment, sds = system.experiment(), system.sds() / snr
    clean, p, d = experiment.readings.mean, experiment.parameters, len(A)
    centre = p.natural(experiment.z[None])[0]

    def mean(x: Array) -> Array:
        values = centre * np.exp(x[:d])
        values[1] = (centre[1] / math.sqrt(centre[0]) + x[1]) * math.sqrt(values[0])
        z = p.standard(values[None])[0]
        return Experiment(SENSOR, p, z, experiment.log_r + x[d:]).readings.mean

    jacobian, along, _ = experiment.whitened(np.einsum("ni,ij->nij", 1 / sds, np.eye(2)))
    every = np.concatenate([jacobian, np.einsum("ni,nm->nim", along, np.eye(40))], axis=2)
    solve = np.linalg.pinv(every.reshape(80, -1))
    rng = np.random.default_rng(4)
    errors = []
    for _ in range(trials):
        noisy = clean + sds * rng.standard_normal(clean.shape)
        x = np.zeros(d + 40)
        for _ in range(30):  # Gauss-Newton with one Jacobian: steps shrink by the relative error
            step = solve @ ((noisy - mean(x)) / sds).ravel()
            x = x + step
            if np.abs(step).max() < 1e-3 * bound:
                break
        assert np.abs(step).max() < 1e-3 * bound
        errors.append(x[A.index(BARE[1])])
    square = float(np.sum(np.square(np.array(errors)))) / bound**2
    low, high = stats.chi2.ppf(0.5e-6, trials), stats.chi2.isf(0.5e-6, trials)
    assert 0.95**2 * low < square < 1.05**2 * high


def test_errors_that_all_frames_share() -> None:
    """Against generalised least squares over parameters and ranges: errors in the covariance."""
    system = System((*OBJECT, *CROSSTALK), None, "A", crosstalk=True, frames=15, gone=2)
    rng = np.random.default_rng(6)
    whitener = np.einsum("ni,ij->nij", 1 / system.sds(), np.eye(2))
    jacobian, along, _ = system.experiment().whitened(whitener)
    errors = 3.0 * rng.standard_normal((15, 2, 4)) * np.linalg.norm(along, axis=1)[:, None, None]
    errors[13:] = rng.standard_normal((2, 2, 4))  # frames without the object have them too
    found = eliminate(system.unknown, jacobian, along, errors)
    ranges = np.zeros((15, 2, 13))
    for i in range(13):
        ranges[i, :, i] = along[i]
    every = np.concatenate([jacobian, ranges], axis=2).reshape(30, -1)
    shared = errors.reshape(30, 4)
    root = np.linalg.cholesky(np.eye(30) + shared @ shared.T)
    inverse = np.linalg.pinv(np.linalg.solve(root, every))
    covariance = inverse @ inverse.T
    sd = np.sqrt(np.diag(covariance))
    # rounding of the reference: its condition number times eps
    assert found.sd == pytest.approx(sd[:5], rel=1e-6)
    assert found.range_sd[:13] == pytest.approx(sd[5:], rel=1e-6)
    assert np.isnan(found.range_sd[13:]).all()
    mean = np.concatenate([np.zeros(5), np.full(13, 1 / 13)])
    assert found.scale_sd == pytest.approx(math.sqrt(mean @ covariance @ mean), rel=1e-6)
    reduced = np.linalg.inv(covariance[:5, :5])
    values = np.sqrt(np.linalg.eigvalsh(reduced)[::-1])
    assert found.singular_values == pytest.approx(values, rel=1e-4)
    assert found.rank == 5


def test_one_range_for_all_frames() -> None:
    """Against least squares over the parameters and one range; frames of several gains."""
    system = System((*CROSSTALK, "object.c2"), None, "A", crosstalk=True, frames=12, gone=2)
    still = dataclasses.replace(
        system.experiment(np.append(np.zeros(10), [np.nan, np.nan])),
        gain=np.linspace(1.0, 3.0, 12),
        common_range=True,
    )
    jacobian, along, _ = still.whitened()
    found = information(still)
    assert found.rank == 3
    every = np.concatenate([jacobian, np.nan_to_num(along)[:, :, None]], axis=2)
    inverse = np.linalg.pinv(every.reshape(24, -1))
    sd = np.linalg.norm(inverse, axis=1)
    assert found.sd == pytest.approx(sd[:3], rel=1e-9)
    assert found.range_sd[:10] == pytest.approx(np.full(10, sd[3]), rel=1e-9)
    assert found.scale_sd == pytest.approx(sd[3], rel=1e-9)
    # of one gain, and without the empty frames, all frames are one, and tell one number
    one = dataclasses.replace(still, gain=None, log_r=np.zeros(10))
    assert information(one).rank == 1
    apart = dataclasses.replace(one, common_range=False)
    assert information(apart).singular_values[0] == pytest.approx(
        information(one).singular_values[0], rel=1e-9
    )


def test_one_range_of_which_something_is_known() -> None:
    """Displacements of a common range tell their offset, a known range the range itself."""
    rng = np.random.default_rng(3)
    n, d = 6, 4
    jacobian, along = rng.standard_normal((n, 2, d)), rng.standard_normal((n, 2))
    jacobian[:, :, -1] = 0.0  # no reading depends on the offset
    told, other = np.zeros((n, 2)), np.zeros((n, 2, d))
    told[2, 0] = 0.7
    told[:, 1] = 3.0
    other[:, 1, -1] = -3.0
    every = np.concatenate([np.concatenate([jacobian, along[:, :, None]], axis=2),
                            np.concatenate([other, told[:, :, None]], axis=2)])  # fmt: skip
    sd = np.linalg.norm(np.linalg.pinv(every.reshape(4 * n, -1)), axis=1)
    found = eliminate(("a", "b", "c", "offset"), jacobian, along, common_range=True,
                      beside=(told, other))  # fmt: skip
    assert found.sd == pytest.approx(sd[:d], rel=1e-9)
    assert found.range_sd == pytest.approx(np.full(n, sd[d]), rel=1e-9)
    # displacements alone leave the range to the readings
    told[2, 0] = 0.0
    found = eliminate(("a", "b", "c", "offset"), jacobian, along, common_range=True,
                      beside=(told, other))  # fmt: skip
    alone = eliminate(("a", "b", "c"), jacobian[:, :, :3], along, common_range=True)
    assert found.range_sd == pytest.approx(alone.range_sd, rel=1e-9)
