"""The pieces of a fit: slopes, coordinates, triangles, profile."""

from typing import Any

import numpy as np
import pytest

from inference.fits.likelihood.arguments import SLOTS
from inference.fits.likelihood.coordinates import chain, physical
from inference.fits.likelihood.polish import _Profile
from inference.fits.likelihood.problem import FitProblem, fit_problem
from inference.fits.likelihood.triangle import damped_step, reduce_columns, solve_least_squares
from tests.fits.scenes import OBJECT, VAGUE, WALL, data, exact_scene, path, sensor_of

EVERYTHING: dict[str, Any] = {
    "crosstalk": [VAGUE, VAGUE],
    "background": {
        "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
        "distance_m": {"prior": "uniform", "low": 2.2, "high": 8.0},
    },
}
TRUTH = {"object": OBJECT, "crosstalk": [0.002, -0.003], "background": WALL}


def problem_of(
    kind: str, scene: dict[str, Any], truth: dict[str, Any], **noise: float
) -> FitProblem:
    sensor = sensor_of(kind, **noise)
    return fit_problem(sensor, exact_scene(scene), data(sensor, truth, path(14, 2)))


@pytest.mark.parametrize("shadow", ["object", "free"])
def test_chain_is_the_derivative_of_the_physical_values(shadow: str) -> None:
    scene: dict[str, Any] = dict(EVERYTHING)
    if shadow == "object":
        scene["background"] = {**EVERYTHING["background"], "shadow": "object"}
    problem = problem_of("pulsed", scene, TRUTH)
    rng = np.random.default_rng(5)
    for _ in range(20):
        x = rng.normal(0, 0.5, len(problem))
        x[-1] = abs(x[-1]) + 0.01  # a default shadow has c1' >= 0
        at = problem.chain(x)
        for j in range(x.size):
            step = 1e-6 * np.eye(x.size)[j]
            wanted = (problem.values(x + step) - problem.values(x - step))[:SLOTS] / 2e-6
            np.testing.assert_allclose(at[:, j], wanted, rtol=1e-7, atol=1e-8)


def test_values_that_are_kept_are_those_of_the_coordinates_asked_for() -> None:
    problem, other = (problem_of(kind, EVERYTHING, TRUTH) for kind in ("pulsed", "sine_wave"))
    x = np.random.default_rng(6).normal(0, 0.3, len(problem))
    x[-1] = 0.1
    for _ in range(3):
        values, slopes = problem.opened(x)
        np.testing.assert_array_equal(values, problem.values(x))
        np.testing.assert_array_equal(slopes, problem.chain(x.copy()))
        assert not np.array_equal(slopes, other.chain(x))
        x += 0.01  # in its place


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_many_coordinates_at_once_are_each_alone(kind: str) -> None:
    problem = problem_of(kind, EVERYTHING, TRUTH)
    points = np.random.default_rng(7).normal(0, 0.3, (8, len(problem)))
    points[:, -1] = np.abs(points[:, -1]) + 0.01
    alone = [problem.natural(point) for point in points]
    np.testing.assert_allclose(problem.naturals(points), alone, rtol=1e-13)


def test_coordinates_are_the_inverse_of_natural() -> None:
    problem = problem_of("pulsed", EVERYTHING, TRUTH)
    natural = np.array([[0.2, -0.3, 0.4, 1e-3, -2e-3, 0.02, 3.0, 0.1, 0.05]])
    x = problem.coordinates(natural)
    np.testing.assert_allclose(problem.natural(x[0]), natural[0], rtol=1e-12)


def test_bounds_follow_the_support_of_a_prior() -> None:
    """c1 in [-0.05, 0.2] bounds log(1 + c1 / (2 sqrt c0)) for every c0."""
    scene = {"object": {"c1": {"prior": "uniform", "low": -0.05, "high": 0.2}}}
    problem = problem_of("pulsed", scene, {"object": OBJECT})
    x = np.array([np.log(0.04), 0.0, -2.0])
    values, bounds = problem.values(x), problem.bounds(x)
    for end, c1 in ((bounds.low, -0.05), (bounds.high, 0.2)):
        x[1] = end[1]
        assert problem.values(x)[1] == pytest.approx(c1, rel=1e-12)
    out = np.empty((SLOTS, 3))
    chain(out, problem.values(x), x, problem.layout, bounds)
    assert out[1, 0] == 0.0  # a c1 that its bound holds does not move with c0
    assert physical(values, x, problem.layout)


def test_triangles_solve_graded_least_squares() -> None:
    """Columns over 24 orders of magnitude; error bound: condition (scaled) squared times eps."""
    rng = np.random.default_rng(2)
    for n in (1, 3, 9):
        scales = 10.0 ** rng.uniform(-12, 12, n)
        plain = rng.standard_normal((30, n))
        target = rng.standard_normal(30)
        matrix = np.column_stack([plain * scales, target])
        solution = np.empty(n)
        solve_least_squares(solution, matrix.copy())
        wanted = np.linalg.lstsq(plain, target, rcond=None)[0]
        tolerance = 100 * np.linalg.cond(plain) ** 2 * np.finfo(float).eps
        np.testing.assert_allclose(solution * scales, wanted, rtol=tolerance, atol=tolerance)
        reduce_columns(matrix, n)
        norms = np.linalg.norm(plain * scales, axis=0)
        for damping in (0.0, 0.3):
            damped_step(solution, matrix[:n], norms, damping)
            stacked = np.concatenate(
                [plain / np.linalg.norm(plain, axis=0), np.sqrt(damping) * np.eye(n)]
            )
            wanted = np.linalg.lstsq(stacked, np.concatenate([target, np.zeros(n)]), rcond=None)[0]
            np.testing.assert_allclose(solution * norms, wanted, rtol=1e-9, atol=1e-10)


def test_a_held_coordinate_stays() -> None:
    matrix = np.random.default_rng(1).standard_normal((10, 4))
    matrix[:, 1] = 0.0
    reduce_columns(matrix, 3)
    step = np.empty(3)
    damped_step(step, matrix[:3], np.array([1.0, 0.0, 1.0]), 0.0)
    assert step[1] == 0.0
    assert np.isfinite(step).all()


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("noise", [{}, {"shot": 1e-6, "relative": 0.01}])
def test_gradient_of_the_profile_is_exact(kind: str, noise: dict[str, float]) -> None:
    """The likelihood at best ranges has the gradient that the projected rows give.

    The best ranges are found to 1e-3 standard deviations, so the profile is exact to 1e-6 a frame,
    and its central difference over 0.02 standard deviations to 1e-6 * 16 / 0.02 < 1e-3.
    """
    problem = problem_of(kind, EVERYTHING, TRUTH, **noise)
    natural = np.array([[0.07, -0.1, 0.1, 0.0021, -0.0028, 0.018, 3.1, 0.05, 0.02]])
    x = problem.coordinates(natural)[0]
    profile = _Profile(problem)
    _, gradient = profile(x)
    sizes = np.linalg.norm(profile.matrix[:, :-1], axis=0)
    for j in range(x.size):
        h = 0.02 / sizes[j]
        step = h * np.eye(x.size)[j]
        slope = (profile(x + step)[0] - profile(x - step)[0]) / (2 * h)
        assert slope / sizes[j] == pytest.approx(gradient[j] / sizes[j], rel=2e-3, abs=3e-3)
