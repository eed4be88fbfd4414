"""Best ranges against a dense grid, and the linearisation against differences."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.profile import linearise
from simulator.frames import Frames
from simulator.readings import background_readings, covariance, object_readings
from simulator.scene import parse_scene
from tests.density.reference import FEW_TERMS, log_density, random_case
from tests.posterior.scenes import KINDS, UNKNOWN_CROSSTALK, data, sensor_of

Array = NDArray[np.float64]

TRUTH: dict[str, Any] = {
    "crosstalk": [0.002, 0.01],
    "background": {"strength": 0.03, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}},
}
FREE: dict[str, Any] = {
    "crosstalk": UNKNOWN_CROSSTALK,
    "background": {"strength": {"prior": "lognormal", "median": 0.03, "sigma": 0.5}}
    | {"distance_m": {"prior": "uniform", "low": 2.0, "high": 10.0}},
}


def means(density: CollapsedDensity, z: Array, positions: Array) -> Array:
    """Mean readings of every frame at given ranges, shape (frames, 2)."""
    terms = density.parameters.terms(z[None])
    c0, c1, c2 = terms.object[0]
    r0, wave = density.instrument.r0, density.instrument.wave
    out = []
    for u, gain in zip(positions, density.frames[:, 2], strict=True):
        r, mean = math.exp(u), np.zeros(2)
        strength = density.sensor.known_gain * c0 * c2 * gain
        mean += object_readings(r, r0, wave, strength, c0, c1)
        if terms.background is not None:
            background = tuple(terms.background[0])
            assert len(background) == 4
            mean += gain * np.array(background_readings(r, r0, wave, background))
        if terms.crosstalk is not None:
            mean += terms.crosstalk[0]
        out.append(mean)
    return np.array(out)


def test_best_ranges_are_the_tops_of_a_dense_grid() -> None:
    rng = np.random.default_rng(30)
    for _ in range(30):
        case = random_case(rng, FEW_TERMS)
        density = collapsed_density(case.sensor, case.scene, case.frames)
        u, top, sd = density.best_ranges(np.empty((1, 0)))[0, 0]
        grid = np.linspace(math.log(case.low), math.log(case.high), 100_001)
        assert top >= log_density(case, grid).max() - 1e-3
        assert top == pytest.approx(float(log_density(case, np.array([u]))[0]), abs=1e-6, rel=1e-9)
        assert sd > 0


@pytest.mark.parametrize("kind", list(KINDS))
@pytest.mark.parametrize(("truth", "free"), [({}, {}), (TRUTH, FREE)], ids=["object", "all"])
def test_jacobian_is_that_of_residuals_at_their_best_ranges(
    kind: str, truth: dict[str, Any], free: dict[str, Any]
) -> None:
    """Where the residuals vanish the derivative of the projection does not matter, so that the
    linearisation is exact: noise-free readings, z at their truth."""
    sensor = sensor_of(kind)
    simulated = data(sensor, truth)
    density = collapsed_density(sensor, parse_scene(free), simulated.frames)
    d = len(density.parameters)
    z = 0.1 * np.random.default_rng(31).standard_normal(d)
    ranges = np.log(np.geomspace(0.1, 2.0, len(simulated.frames)))
    frames = Frames(means(density, z, ranges))
    density = collapsed_density(sensor, parse_scene(free), frames)
    best = density.best_ranges(z[None])[0, :, 0]
    assert best == pytest.approx(ranges, abs=1e-4)
    line = linearise(density, z, ranges)
    h = 1e-4
    for j in range(d):
        ends = []
        for sign in (1, -1):
            moved = z + sign * h * np.eye(d)[j]
            positions = density.best_ranges(moved[None])[0, :, 0]
            ends.append((frames.readings - means(density, moved, positions)) / sensor.noise.read)
        slope = (ends[0] - ends[1]) / (2 * h)
        # best ranges are known to a thousandth of their sd, which moves residuals along the curve
        # alone; across it only second-order terms of h are left
        scale = np.abs(line.jacobian[:, :, j]).max()
        across = slope - _along(density, z, ranges, slope, sensor.noise.read)
        assert across == pytest.approx(line.jacobian[:, :, j], abs=2e-3 * scale + 1e-3)


def _along(
    density: CollapsedDensity, z: Array, positions: Array, vector: Array, read: tuple[float, float]
) -> Array:
    """Part of each frame's whitened vector along its range."""
    h = 1e-6
    curve = (means(density, z, positions + h) - means(density, z, positions - h)) / read
    unit = curve / np.linalg.norm(curve, axis=1, keepdims=True)
    return np.asarray(unit * np.sum(unit * vector, axis=1, keepdims=True))


@pytest.mark.parametrize("kind", list(KINDS))
def test_residuals_are_white(kind: str) -> None:
    """The squared residual of an empty frame is its Mahalanobis distance."""
    sensor = sensor_of(kind, shot=1e-4)
    readings = np.array([[0.013, 0.042], [0.004, 0.02]])
    frames = Frames(readings, object_present=np.zeros(2, dtype=bool))
    density = collapsed_density(sensor, parse_scene(FREE), frames)
    z = 0.1 * np.random.default_rng(32).standard_normal(len(density.parameters))
    terms = density.parameters.terms(z[None])
    assert terms.crosstalk is not None
    assert terms.background is not None
    background = tuple(terms.background[0])
    assert len(background) == 4
    r0, wave, read, shot, _, _ = density.instrument
    bare = background_readings(math.inf, r0, wave, background)
    mean = terms.crosstalk[0] + bare
    v1, v2, v12 = covariance(read, shot, None, wave is None, (mean[0], mean[1]), (0.0, 0.0))
    line = linearise(density, z, np.full(2, np.nan))
    for k in range(2):
        e = readings[k] - mean
        wanted = e @ np.linalg.solve(np.array([[v1, v12], [v12, v2]]), e)
        assert np.sum(line.residual[k] ** 2) == pytest.approx(wanted, rel=1e-9)
