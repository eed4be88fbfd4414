"""How many numbers a point, a straight line and a curve of readings tell."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.fits.answer.motion_seen import numbers_shown
from inference.fits.likelihood.maximum import Maximum
from inference.fits.likelihood.problem import fit_problem
from tests.fits.scenes import OBJECT, SIGNAL_AT_1M, data, exact_scene, path, sensor_of, values_of

SHAPES = [((0.7, 0.7), 1.0), ((0.69, 0.71), 2.0), ((0.3, 1.5), math.inf)]


def shown(
    read: float, span: tuple[float, float], seed: int, kind: str = "pulsed", **noise: float
) -> float:
    sensor = sensor_of(kind, SIGNAL_AT_1M / read, **noise)
    frames = data(sensor, {"object": OBJECT}, path(40, span=span), seed)
    problem = fit_problem(sensor, exact_scene({}), frames)
    known = values_of(sensor, {"object": OBJECT})
    truth = problem.coordinates(np.array([[known[name] for name in problem.names]]))[0]
    ranges = np.log(np.linspace(*span, 40))
    return numbers_shown(problem, Maximum(truth, 0.0, 0.0, ranges))


def mean_readings_of(span: tuple[float, float]) -> NDArray[np.float64]:
    """Without noise."""
    sensor = sensor_of("pulsed", 1e15)
    return data(sensor, {"object": OBJECT}, path(40, span=span), 0).readings


@pytest.mark.parametrize(("span", "numbers"), SHAPES)
def test_point_line_and_curve(span: tuple[float, float], numbers: float) -> None:
    """Of 100 sets each more than 3 are called wrong once in 250,000 times."""
    found = [shown(1e-5, span, seed) for seed in range(100)]
    assert sum(value != numbers for value in found) <= 3


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize(("span", "numbers"), [SHAPES[0], SHAPES[2]])
def test_light_that_errs_by_more_than_it_is_read(
    span: tuple[float, float], numbers: float, kind: str
) -> None:
    """Relative errors a trillion times the read noise; five sets, one is wrong in 5e-3 of cases."""
    for seed in range(5):
        assert shown(1e-15, span, seed, kind, relative=0.05) == numbers


def test_shot_noise_of_a_pulse_is_shared_by_its_windows() -> None:
    """Thirty sets at rest: more than 2 are called moving in 4e-6 of cases."""
    found = [shown(1e-7, (0.7, 0.7), seed, shot=1e-8) for seed in range(30)]
    assert sum(value != 1.0 for value in found) <= 2


def test_a_motion_twice_as_large_as_chance_allows_is_seen() -> None:
    """Motion adds 80 to a chi-square of 78: at least half of 20 sets above its limit of 121.

    One is with 95 %, so that fewer than half are once in 1e9 times.
    """
    read, half = 1e-5, 4.0e-4
    for _ in range(20):
        moves = mean_readings_of((0.7 - half, 0.7 + half))
        added = float(np.square((moves - moves.mean(axis=0)) / read).sum())
        half *= math.sqrt(80 / added)
    found = [shown(read, (0.7 - half, 0.7 + half), seed) for seed in range(20)]
    assert sum(value > 1.0 for value in found) >= 10
