"""An object that does not move: one range for all frames."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.profile import linearise
from inference.density.static import with_common_range
from inference.density.whitened import whitened
from inference.frame.arguments import scene_of
from inference.frame.blocks import Block, Frame
from inference.frame.gaussian import log_top
from inference.frame.log_density import log_density
from inference.frame.range_prior import log_range_density
from inference.posterior import fold
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, sensor_of

Array = NDArray[np.float64]

QUICK = SamplerSettings(seed=7, target_ess=50, max_seconds=60)
WALL = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": 3.0,
    "shadow": {"c0": 0.056, "c1": 0.02},
}


def standing(
    sensor: Sensor, n: int, range_m: float = 0.7, scene: dict[str, Any] | None = None, seed: int = 1
) -> Frames:
    """Return frames of an object at rest."""
    path = SampledTrajectory(range_m=[range_m] * n)
    return simulate(sensor, parse_scene({"object": OBJECT, **(scene or {})}), path, seed).frames


def along(density: CollapsedDensity, z: Array, u: Array) -> Array:
    """Log joint density of all frames and of log r, less the top of the read noise's."""
    rows = density.rows(density.parameters.terms(z[None]))
    scene = scene_of(rows, density.instrument, 0)
    values = np.zeros(u.size)
    for k in range(u.size):
        prior = log_range_density(math.exp(u[k]), u[k], scene.range_prior)
        values[k] = prior
        for frame in density.frames:
            values[k] += log_density(u[k], Block(Frame(*frame.tolist()), None), scene) - prior
    return values


def by_quadrature(density: CollapsedDensity, z: Array) -> tuple[float, Array, Array]:
    """Log of the joint integral over u on a dense grid, and the density along it.

    Dense where a coarse grid has all but e^-60 of the mass: its steps are as wide as a peak, of
    whose top they miss an eighth of a nat.
    """
    coarse = np.linspace(math.log(0.05), math.log(5.0), 1001)
    seen = along(density, z, coarse)
    near = np.flatnonzero(seen > seen.max() - 60.0)
    first, last = max(int(near[0]) - 1, 0), min(int(near[-1]) + 1, coarse.size - 1)
    u = np.linspace(coarse[first], coarse[last], 20 * (last - first) + 1)
    values = along(density, z, u)
    # the trapezoidal rule is exact to rounding for peaks wider than two steps
    constant = len(density.frames) * log_top(density.instrument.read) + math.log(u[1] - u[0])
    return float(special.logsumexp(values) + constant), u, values


CASES: dict[str, tuple[str, dict[str, Any], dict[str, float]]] = {
    "pulsed": ("pulsed", {"crosstalk": UNKNOWN_CROSSTALK}, {}),
    "sine wave": ("sine_wave", {"background": WALL}, {"shot": 1e-7, "relative": 0.02}),
}


def density_of(name: str, n: int) -> CollapsedDensity:
    kind, scene, noise = CASES[name]
    sensor = sensor_of(kind, 30.0, **noise)
    frames = standing(sensor, n)
    gain = np.linspace(0.5, 1.5, n) if n > 1 else None
    frames = Frames(frames.readings, gain=gain)
    stated = parse_scene({**scene, "range_m": {"prior": "loguniform", "low": 0.05, "high": 5.0}})
    return collapsed_density(sensor, stated, frames)


@pytest.mark.parametrize("name", CASES)
def test_one_range_of_all_frames_is_integrated_out_as_by_quadrature(name: str) -> None:
    density = density_of(name, 6)
    static = with_common_range(density)
    rng = np.random.default_rng(2)
    for z in density.parameters.sample(rng, 4):
        wanted, u, values = by_quadrature(density, z)
        assert static.log_likelihood(z[None])[0] == pytest.approx(wanted, abs=1e-8 * abs(wanted))
        top = static.best_ranges(z[None])[0]
        assert (top[:, 0] == top[0, 0]).all()
        # shot noise leaves kinks, at which the best of two neighbouring tops may be missed
        highest = float(values.max()) + 6 * log_top(static.instrument.read)
        assert top[:, 1].sum() == pytest.approx(highest, abs=0.1)
        assert top[0, 0] == pytest.approx(u[values.argmax()], abs=0.01)
        # not the product of integrals of their own, which reward every frame for its own range
        assert abs(density.log_likelihood(z[None])[0] - wanted) > 1e-3


@pytest.mark.parametrize("name", CASES)
def test_a_single_frame_has_one_range_anyway(name: str) -> None:
    density = density_of(name, 1)
    z = density.parameters.sample(np.random.default_rng(3), 20)
    static = with_common_range(density)
    # the frame integral is good to 1e-4
    assert static.log_likelihood(z) == pytest.approx(density.log_likelihood(z), abs=2e-4)


def test_drawn_ranges_are_common_and_follow_the_joint_density() -> None:
    static = with_common_range(density_of("pulsed", 6))
    z = np.zeros((1, len(static.parameters)))
    drawn = static.draw_log_ranges(np.repeat(z, 4000, axis=0), np.random.default_rng(4))
    assert (drawn == drawn[:, :1]).all()
    width = np.ptp(drawn)
    u = np.linspace(drawn.min() - width, drawn.max() + width, 4001)
    values = along(static, z[0], u)
    weights = np.exp(values - values.max())
    cumulative = (np.cumsum(weights) - 0.5 * weights) / weights.sum()
    rank = np.interp(drawn[:, 0], u, cumulative)
    # Kolmogorov: 1.95 / sqrt(n) is exceeded once in a thousand runs, and the seed is fixed
    gap = np.abs(np.sort(rank) - (np.arange(4000) + 0.5) / 4000).max()
    assert gap < 1.95 / math.sqrt(4000)


def test_the_linearisation_gives_way_to_one_range_alone() -> None:
    static = with_common_range(density_of("pulsed", 6))
    z = np.zeros(len(static.parameters))
    positions = static.best_ranges(z[None])[0, :, 0]
    line = linearise(static, z, positions)
    # two readings a frame less one range: the residual's rows span more than with own ranges
    own = linearise(density_of("pulsed", 6), z, positions)
    assert np.sum(line.residual**2) > np.sum(own.residual**2)
    # what is left of the readings and of their derivatives by least squares over the one range
    kind, _, noise = CASES["pulsed"]
    at = whitened(sensor_of(kind, 30.0, **noise), static.parameters, static.frames, z, positions)
    along = at.along.reshape(-1, 1)
    for left, whole in (
        (line.residual.reshape(-1, 1), at.residual.reshape(-1, 1)),
        (line.jacobian.reshape(along.size, -1), -at.jacobian.reshape(along.size, -1)),
    ):
        wanted = whole - along @ np.linalg.lstsq(along, whole)[0]
        np.testing.assert_allclose(left, wanted, rtol=1e-9, atol=1e-12 * np.abs(whole).max())


def test_the_range_of_an_object_at_rest_is_known_better_the_more_frames_there_are() -> None:
    sensor = sensor_of("pulsed", 100.0)
    spread = {}
    for motion in ("radial", "static"):
        # an error of the model is common to all frames, and no number of them averages it down
        scene = parse_scene({"object": OBJECT, "motion": motion, "discrepancy": 0})
        posterior = infer(sensor, scene, standing(sensor, 16), QUICK)
        assert posterior.verdict.converged
        spread[motion] = float(posterior.range_m.sd.mean())
        assert abs(posterior.range_m.q50[0] - 0.7) < 5 * posterior.range_m.sd[0]
    # sixteen frames halve it twice; standard deviations of 1000 draws are good to 2 %
    assert spread["static"] == pytest.approx(spread["radial"] / 4, rel=0.25)


def test_at_rest_with_unknown_crosstalk_the_answer_says_what_it_cannot_tell() -> None:
    sensor = sensor_of("pulsed", 100.0)
    frames = standing(sensor, 16, scene={"crosstalk": [0.002, 0.01]})
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK, "motion": "static"})
    job = fold.prepare(sensor, scene, frames, QUICK)
    checkpoint = fold.start(job)
    # no time limit: the first chunks that draw, however long the populations take
    while (fold.progress(job, checkpoint).steps or 0) == 0:
        pieces = [fold.run(task) for task in fold.tasks(job, checkpoint)]
        checkpoint = fold.merge(job, checkpoint, pieces)
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    assert posterior.drawn
    status = {row.parameter: row.status for row in posterior.identifiability}
    assert status["range_m"] != "identified"
    assert status["object.c2"] != "identified"
    assert not posterior.fit.misfit
    assert posterior.range_m.q05[0] < 0.7 < posterior.range_m.q95[0]
