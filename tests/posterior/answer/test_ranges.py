"""Draws of ranges against the integrated density, and replicated readings against their law."""

import math
from typing import Any, cast

import numpy as np
import pytest
from scipy import integrate, stats

from inference.density.collapsed import collapsed_density
from inference.posterior.answer.replicate import replicate
from simulator.frames import Frames
from simulator.readings import covariance
from simulator.scene import parse_scene
from tests.density.reference import Case, log_density, mean_readings
from tests.posterior.scenes import KINDS, sensor_of

PLATE = (0.0769, -0.123, 0.0957)
STEEP = (0.08, -1.97 * math.sqrt(0.08), 0.1)  # its intensity falls, rises and falls again
DRAWS = 20_000


def case_of(
    kind: str,
    r: float,
    noise: tuple[float, float],
    c: tuple[float, float, float] = PLATE,
    **more: float,
) -> Case:
    """A frame at range r; read noise as shares of the second reading."""
    scene = parse_scene(
        {
            "object": dict(zip(("c0", "c1", "c2"), c, strict=True)),
            "range_m": {"prior": "loguniform", "low": 0.05, "high": 10.0},
        }
    )
    case = Case(sensor_of(kind), scene, c, None, None, 0.05, 10.0, (0.0, 0.0))
    m1, m2, _, _ = (float(part[0]) for part in mean_readings(case, np.array([math.log(r)])))
    size = math.hypot(m1, m2)
    sensor = case.sensor.model_copy(
        update={
            "noise": case.sensor.noise.model_copy(
                update={"read": (noise[0] * size, noise[1] * size), **more}
            )
        }
    )
    return Case(sensor, scene, c, None, None, 0.05, 10.0, (m1, m2))


CASES = {
    "narrow": case_of("pulsed", 0.7, (1e-4, 1e-4)),
    "broad": case_of("pulsed", 0.7, (1.0, 0.7)),
    "nothing known": case_of("pulsed", 5.0, (1e4, 1e4)),
    "two turns of a phase": case_of("sine_wave", 0.7, (0.3, 0.3)),
    "three modes": case_of("pulsed", STEEP[0] ** 0.5 * 0.75, (10.0, 0.01), STEEP),
    "relative": case_of("sine_wave", 0.7, (1e-3, 1e-3), relative=0.2),
    "shot": case_of("pulsed", 0.7, (0.05, 0.05), shot=1e-3),
    "at an end": case_of("pulsed", 9.99, (0.05, 0.05)),
}


@pytest.mark.parametrize("name", list(CASES))
def test_draws_have_the_law_of_the_range(name: str) -> None:
    """Kolmogorov-Smirnov, each with a false-alarm rate of 1e-4 of another seed."""
    case = CASES[name]
    density = collapsed_density(case.sensor, case.scene, case.frames)
    drawn = density.draw_log_ranges(np.empty((DRAWS, 0)), np.random.default_rng(90))[:, 0]
    low, high = math.log(case.low), math.log(case.high)
    grid = np.linspace(low, high, 400_001)
    values = log_density(case, grid)
    mass = integrate.cumulative_trapezoid(np.exp(values - values.max()), grid, initial=0)
    assert low <= drawn.min() <= drawn.max() <= high
    result = stats.kstest(drawn, lambda u: np.interp(u, grid, mass / mass[-1]))
    assert result.pvalue > 1e-4


class _Even:
    """Uniforms of one frame that are evenly spaced, and lead to its only mode."""

    @staticmethod
    def random(shape: tuple[int, int, int]) -> np.ndarray[Any, np.dtype[np.float64]]:
        uniforms = np.full(shape, 0.5)
        uniforms[:, 0, 1] = (np.arange(shape[0]) + 0.5) / shape[0]
        return uniforms


@pytest.mark.parametrize("noise", [1e-4, 5e-3, 0.02, 0.05])
@pytest.mark.parametrize("kind", KINDS)
def test_draws_of_one_mode_are_its_quantiles(kind: str, noise: float) -> None:
    """Linear in cells of its grid, whose widest that counts is a fifth of a standard deviation."""
    case, many = case_of(kind, 0.7, (noise, noise)), 2001
    density, even = collapsed_density(case.sensor, case.scene, case.frames), _Even()
    drawn = density.draw_log_ranges(np.empty((many, 0)), cast("np.random.Generator", even))[:, 0]
    reach = 9 * drawn.std()
    grid = np.linspace(drawn.mean() - reach, drawn.mean() + reach, 100_001)
    values = log_density(case, grid)
    mass = integrate.cumulative_trapezoid(np.exp(values - values.max()), grid, initial=0)
    share = np.interp(drawn, grid, mass / mass[-1])
    assert share == pytest.approx((np.arange(many) + 0.5) / many, abs=1e-3)


def test_the_hard_cases_are_what_they_say() -> None:
    def tops(case: Case) -> int:
        grid = np.linspace(math.log(case.low), math.log(case.high), 20_001)
        values = log_density(case, grid)
        peak = (values[1:-1] > values[:-2]) & (values[1:-1] > values[2:])
        return int((peak & (values[1:-1] > values.max() - 5)).sum())

    assert tops(CASES["three modes"]) == 3
    assert tops(CASES["narrow"]) == 1


def test_frames_without_object_have_no_range() -> None:
    frames = Frames(np.ones((3, 2)), object_present=np.array([True, False, True]))
    density = collapsed_density(sensor_of("pulsed"), parse_scene({}), frames)
    drawn = density.draw_log_ranges(np.zeros((5, 3)), np.random.default_rng(91))
    assert np.isnan(drawn[:, 1]).all()
    assert np.isfinite(drawn[:, [0, 2]]).all()


def test_one_seed_gives_the_same_draws() -> None:
    case = CASES["broad"]
    density = collapsed_density(case.sensor, case.scene, case.frames)
    first, again, other = (
        density.draw_log_ranges(np.empty((50, 0)), np.random.default_rng(seed))
        for seed in (1, 1, 2)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


SCENE: dict[str, Any] = {
    "object": dict(zip(("c0", "c1", "c2"), PLATE, strict=True)),
    "crosstalk": [0.002, -0.003],
    "background": {"strength": 0.03, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}},
}


@pytest.mark.parametrize("kind", list(KINDS))
@pytest.mark.parametrize("noise", [{}, {"shot": 1e-3}, {"relative": 0.1}], ids=str)
def test_replicates_have_the_mean_and_covariance_of_the_readings(
    kind: str, noise: dict[str, float]
) -> None:
    """Bands of five standard errors over 30 numbers: a false alarm in 2e-5 runs of another seed."""
    sensor = sensor_of(kind, 30.0, **noise)
    gain = np.array([1.0, 2.5])
    frames = Frames(np.ones((2, 2)), gain=gain, object_present=np.array([True, False]))
    density = collapsed_density(sensor, parse_scene(SCENE), frames)
    positions = np.tile([math.log(0.8), math.nan], (DRAWS, 1))
    drawn = replicate(density, np.empty((DRAWS, 0)), positions, np.random.default_rng(92))
    background = (0.03, 3.0, 0.056, 0.013)
    for k in range(2):
        bare = Case(sensor, density_scene(), PLATE, None, background, 0.1, 9.0, (0.0, 0.0))
        # an object at 1e9 m is none
        u = math.log(0.8) if k == 0 else math.log(1e9)
        m1, m2, o1, o2 = (gain[k] * float(part[0]) for part in mean_readings(bare, np.array([u])))
        mean = (m1 + SCENE["crosstalk"][0], m2 + SCENE["crosstalk"][1])
        v1, v2, v12 = covariance(
            sensor.noise.read,
            noise.get("shot"),
            noise.get("relative"),
            kind == "pulsed",
            mean,
            (o1, o2),
        )
        sample = drawn[:, k]
        found = np.cov(sample.T)
        assert sample.mean(axis=0) == pytest.approx(
            mean, abs=5 * math.sqrt(max(v1, v2) / DRAWS), rel=0
        )
        assert found[0, 0] == pytest.approx(v1, rel=5 * math.sqrt(2 / DRAWS))
        assert found[1, 1] == pytest.approx(v2, rel=5 * math.sqrt(2 / DRAWS))
        assert found[0, 1] == pytest.approx(v12, abs=5 * math.sqrt((v1 * v2 + v12**2) / DRAWS))


def density_scene() -> Any:
    return parse_scene({"object": SCENE["object"], "background": SCENE["background"]})
