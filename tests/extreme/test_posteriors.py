"""Posteriors of one and two unknowns at the ends, held to quadrature; more in `make stress`."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import logsumexp

from inference.density.collapsed import collapsed_density
from inference.posterior import fold
from inference.posterior.answer.error_parts import ParameterErrorParts
from inference.posterior.answer.posterior import ParameterSummary
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.stage import Starting, Tempering, Walking
from inference.posterior.stages.starting import begin
from tests.extreme.nested import Reference, reference_of
from tests.extreme.posteriors import errors_of, held, quadrature_of, random_case
from tests.extreme.wall_curve import wall_curve

Array = NDArray[np.float64]


@pytest.mark.parametrize("number", [0, 3])
def test_a_posterior_is_what_quadrature_has(number: int) -> None:
    """One 1e8 times as precise as its prior, one at its end, each of one unknown."""
    verdict = held(random_case(number))
    # sixteen numbers, each within six of its Monte Carlo errors: a false alarm once in 1e7 runs
    assert verdict.outcome == "held", verdict


def test_a_branch_that_jumps_hardly_reach_calls_for_populations() -> None:
    """A wall whose light all but cancels that of a near object, 0.7 % of a posterior.

    Walkers that had passed every other gate gave its mean 0.07 standard deviations too low. Where
    scouts stood on their way says so before any walks.
    """
    case = random_case(296)
    settings = SamplerSettings(seed=case.seed, target_ess=200)
    job = fold.prepare(case.sensor, case.scene, case.frames, settings)
    checkpoint = begin(job, Starting())
    while isinstance(checkpoint.stage, Walking):
        checkpoint = fold.merge(job, checkpoint, [fold.run(t) for t in fold.tasks(job, checkpoint)])
    assert isinstance(checkpoint.stage, Tempering)
    assert checkpoint.stage.populations == (None, None)


def test_a_ridge_of_a_millionth_is_found_along_its_bend() -> None:
    width = 1e-6

    def ridge(z: Array) -> Array:
        x, y = z.T
        return np.asarray(-0.5 * (x**2 + ((y - x - 0.2 * x**3) / width) ** 2))

    exact = reference_of(ridge, lambda z: z, 2)
    assert exact is not None
    assert exact.log_evidence == pytest.approx(math.log(2 * math.pi * width), abs=0.01)
    # of a normal x: E y^2 = 1 + 0.4 E x^4 + 0.04 E x^6
    assert np.abs(exact.mean / exact.sd).max() < 0.02
    assert exact.sd == pytest.approx(np.array([1.0, math.sqrt(1 + 0.4 * 3 + 0.04 * 15)]), rel=0.02)


def _two_modes(width: float) -> Reference | None:
    """Integrate a wide mode and a round narrow one of a hundredth of its mass."""

    def modes(z: Array) -> Array:
        wide = -0.5 * (((z - [-1.3, 0.4]) / [0.2, 0.01]) ** 2).sum(axis=1) - math.log(0.2 * 0.01)
        near = -0.5 * (((z - [1.1, -0.7]) / width) ** 2).sum(axis=1) - 2 * math.log(width)
        return np.asarray(np.logaddexp(wide + math.log(0.99), near + math.log(0.01)))

    return reference_of(modes, lambda z: z, 2)


def test_a_narrow_mode_beside_a_wide_one_has_its_mass() -> None:
    exact = _two_modes(0.01)
    assert exact is not None
    assert exact.log_evidence == pytest.approx(math.log(2 * math.pi), abs=0.01)
    assert exact.weights[exact.z[:, 0] > 0].sum() == pytest.approx(0.01, rel=0.02)


def test_lines_without_any_density_and_no_density_at_all() -> None:
    """Beyond a hard edge there is nothing: the normal law on a disk, and on none."""

    def disk(radius: float) -> Reference | None:
        def heights(z: Array) -> Array:
            squares = (z**2).sum(axis=1)
            return np.where(squares < radius**2, -0.5 * squares, -np.inf)

        return reference_of(heights, lambda z: z, 2)

    exact = disk(1.5)
    assert exact is not None
    mass = 2 * math.pi * (1 - math.exp(-(1.5**2) / 2))
    assert exact.log_evidence == pytest.approx(math.log(mass), abs=0.01)
    assert disk(0.0) is None


def test_what_one_way_alone_has_is_no_reference() -> None:
    """A mode in a plain, a sixtieth of the grid wide: it is found along one unknown only."""
    assert _two_modes(1e-3) is None


def test_quadrature_has_the_precision_of_a_narrow_peak() -> None:
    exact = quadrature_of(random_case(1))
    assert exact is not None
    assert exact.precision > 1e10
    assert exact.error < 0.1


def _lognormal() -> Reference:
    z = np.linspace(-9, 11, 20001)
    weights = np.exp(-0.5 * z**2)
    return Reference(z[:, None], np.exp(z)[:, None], weights / weights.sum(), 0.0, 0.0)


def _summary(x: Array, mean: float, sd: float) -> ParameterSummary:
    nan = math.nan
    parts = ParameterErrorParts(nan, nan, nan)
    # independent draws, each of them effective
    error = sd / math.sqrt(x.size)
    return ParameterSummary(mean, sd, parts, nan, nan, nan, x.size, x.size, 1.0, error, ())


def test_a_heavy_tail_is_no_wrong_deviation() -> None:
    """Independent draws of a lognormal law: errors of a normal law's deviation would not hold."""
    exact = _lognormal()
    worst, as_normal = 0.0, 0.0
    for seed in range(40):
        x = np.exp(np.random.default_rng(seed).standard_normal((4, 8, 100)))
        summary = _summary(x, float(x.mean()), float(x.std()))
        worst = max(worst, *errors_of(exact, 0, summary, x).values())
        as_normal = max(as_normal, abs(math.log(x.std() / exact.sd[0])) * math.sqrt(2 * x.size))
    assert worst < 6
    assert as_normal > 9


@pytest.mark.parametrize("fault", ["mean", "sd", "place", "width"])
def test_every_number_that_is_off_is_seen(fault: str) -> None:
    exact = _lognormal()
    x = np.exp(np.random.default_rng(1).standard_normal((4, 40, 500)))
    mean, sd = float(x.mean()), float(x.std())
    right = _summary(x, mean, sd)
    assert max(errors_of(exact, 0, right, x).values()) < 6
    error = sd / math.sqrt(x.size)
    if fault == "mean":
        right = dataclasses.replace(right, mean=mean + 8 * error)
    elif fault == "sd":
        right = dataclasses.replace(right, sd=1.5 * sd)
    elif fault == "place":
        x = 1.05 * x
    else:
        x = np.exp(1.05 * np.log(x))
    assert errors_of(exact, 0, right, x)[fault] > 6


@pytest.mark.parametrize("turn", [0, 1])
def test_the_curve_of_one_frame_is_what_the_density_has_across_it(turn: int) -> None:
    """Of one frame with much light; along lines of one strength, up to one constant."""
    case = random_case(241)
    density = collapsed_density(case.sensor, case.scene, case.frames)
    curve = wall_curve(density)
    assert curve is not None
    log_r = np.log(np.array([0.2, 0.4, 0.6, 1.0]))  # 1.6 m before the wall in its first turn
    strength, distance, seen = places = curve.at(np.exp(log_r))
    step = 1e-6
    after, before = (curve.at(np.exp(log_r + d))[0] for d in (step, -step))
    along = np.log(np.abs(after - before) / (2 * step))
    wanted = curve.log_weights(np.exp(log_r), places, np.array([1.0 * turn]))[:, 0] - along
    parameters = density.parameters
    found = np.empty(len(log_r))
    for k in range(len(log_r)):
        wide = curve.read / (seen[k] * strength[k] * 2 * math.pi / curve.sensor.max_range_m)
        to_m = distance[k] + turn * curve.sensor.max_range_m + wide * np.linspace(-12, 12, 241)
        z = parameters.standard(np.column_stack([np.full(241, strength[k]), to_m]))
        heights = logsumexp(density(z) + np.log(np.gradient(z[:, 1])))
        law = parameters.unknowns[0].law
        assert law is not None
        # of the strength, by its coordinate
        found[k] = heights + law.log_density(strength[k : k + 1])[0] + 0.5 * z[0, 0] ** 2
    assert found - wanted == pytest.approx(np.full(len(log_r), found[0] - wanted[0]), abs=1e-4)
