"""A smooth error of the flux in the posterior: likelihood, draws and linearisation."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.discrepant import DiscrepantDensity, with_discrepancy
from inference.density.profile import linearise
from inference.frame.gaussian import log_top
from inference.posterior import fold
from inference.posterior.answer.replicate import replicate
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, Sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.density.discrepancy_reference import matern_path_covariance, sum_over_paths
from tests.posterior.scenes import KINDS, OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

NOTHING = np.empty((1, 0))
C = (OBJECT["c0"], OBJECT["c1"], OBJECT["c2"])
CROSSTALK = [0.002, 0.01]
SPAN = {"prior": "loguniform", "low": 0.3, "high": 1.5}


def density_of(
    sensor: Sensor, scene: dict[str, Any], frames: Frames, sd: float
) -> DiscrepantDensity:
    return with_discrepancy(collapsed_density(sensor, parse_scene(scene), frames), sd)


@pytest.fixture(params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.mark.parametrize("snr", [3.0, 15.0])
def test_likelihood_and_ranges_agree_with_a_sum_over_paths(kind: str, snr: float) -> None:
    """Weak frames, one of them without information, and a size of the error that matters."""
    sensor, sd = sensor_of(kind, snr), 0.15
    truth = {"crosstalk": CROSSTALK, "discrepancy": sd}
    frames = data(sensor, truth, 4, seed=5, span=(0.45, 1.3)).frames
    scene = {"object": OBJECT, "crosstalk": CROSSTALK, "range_m": SPAN}
    density = density_of(sensor, scene, frames, sd)
    wanted = sum_over_paths(
        sensor, C, (0.002, 0.01), frames.readings, (0.3, 1.5), sd, paths=8000, seed=1
    )
    # four standard errors, and what Laplace's method leaves out: of the order of the squared
    # skewness of log-normal noise of this size, sd^2 a frame
    allowed = 4 * wanted.error + len(frames) * sd**2 / 12
    assert density(NOTHING)[0] == pytest.approx(wanted.log_likelihood, abs=allowed)
    drawn = density.draw_log_ranges(np.empty((4000, 0)), np.random.default_rng(2))
    error = np.hypot(wanted.mean_u_error, drawn.std(axis=0) / math.sqrt(len(drawn)))
    np.testing.assert_array_less(
        np.abs(drawn.mean(axis=0) - wanted.mean_u), 4 * error + 0.05 * drawn.std(axis=0)
    )


def test_likelihoods_found_while_drawing_are_those_of_the_density(kind: str) -> None:
    """To the last bit, an empty frame among them; and the draws are the same as without them."""
    frames = data(sensor_of(kind, 100.0), {"discrepancy": 0.05}, 5, seed=1).frames
    frames = dataclasses.replace(frames, object_present=np.arange(5) != 2)
    scene = parse_scene({"object": {**OBJECT, "c2": {"prior": "normal", "mean": 1e4, "sd": 1e3}}})
    plain = collapsed_density(sensor_of(kind, 100.0), scene, frames)
    z = np.random.default_rng(1).standard_normal((20, len(plain.parameters)))
    z[3] = z[17]  # equal ones share what is found of the error
    for density in (plain, with_discrepancy(plain, 0.05)):
        log_r, values, _ = density.draw_with_likelihoods(z, np.random.default_rng(2))
        np.testing.assert_array_equal(values, density.frame_log_likelihoods(z))
        again = density.draw_log_ranges(z, np.random.default_rng(2))
        np.testing.assert_array_equal(log_r, again)


def test_with_little_noise_the_process_is_seen_directly() -> None:
    """Readings are then range and flux, and p(y) the density of a path times a Jacobian."""
    sensor = sensor_of("pulsed", 1e4)
    assert isinstance(sensor, PulsedSensor)
    scene = {"object": OBJECT, "crosstalk": [0.0, 0.0], "range_m": SPAN}
    for n in (1, 2, 7):
        frames = data(sensor, {"discrepancy": 0.05}, n, seed=n, span=(0.4, 1.2)).frames
        w1, w2 = frames.readings.T
        r = sensor.r0 * w1 / w2
        c0, c1, c2 = C
        quadratic = r**2 + c1 * r + c0
        delta = np.log(w2 * r**2 * quadratic / (c0 * c2))
        slope = 2 + r * (2 * r + c1) / quadratic
        read = sensor.noise.read
        blur = (slope / w1 * read[0]) ** 2 + ((1 - slope) / w2 * read[1]) ** 2
        covariance = matern_path_covariance(np.log(r), 0.05) + np.diag(blur)
        path = stats.multivariate_normal(np.zeros(n), covariance).logpdf(delta)
        prior = -math.log(math.log(1.5 / 0.3))
        jacobian = -np.log(w1 * w2).sum()  # d(log r, log flux) / d(w1, w2)
        wanted = path + n * prior + jacobian
        found = density_of(sensor, scene, frames, 0.05)(NOTHING)[0]
        # readings relative to their noise are what is neglected, and a ten thousandth of the
        # variance of the process
        allowed = 5 * n * float(np.max(read[0] / w1)) + n * 0.05**2 * 1e-4 / blur.min()
        assert found == pytest.approx(wanted, abs=allowed), n


def test_a_vanishing_error_leaves_the_plain_density(kind: str) -> None:
    sensor = sensor_of(kind)
    scene = {"crosstalk": UNKNOWN_CROSSTALK, "range_m": {"prior": "stroke", "low": 0.05, "high": 4}}
    frames = data(sensor, {"crosstalk": CROSSTALK}, 12).frames
    plain = collapsed_density(sensor, parse_scene(scene), frames)
    natural = np.array([[*C, *CROSSTALK, 0.5, 0.8]])
    z = plain.parameters.standard(natural) + 1e-3 * np.random.default_rng(1).normal(size=(5, 7))
    sd = 1e-9
    found = with_discrepancy(plain, sd)(z)
    # half the squared pull of all frames on a common factor, at most chi-square times (sd x SNR)^2
    signal = np.linalg.norm(frames.readings / sensor.noise.read, axis=1).max()
    allowed = 2 * (1 + np.abs(plain.log_likelihood(z))) * len(frames) * (sd * signal) ** 2
    assert (allowed < 1e-2 * np.abs(plain(z))).all()
    np.testing.assert_array_less(np.abs(found - plain(z)), allowed + 1e-9 * np.abs(plain(z)))


@pytest.mark.parametrize("scale", [pytest.param(1e-12, marks=pytest.mark.thorough), 1e12])
def test_units_do_not_matter(scale: float) -> None:
    sensor = sensor_of("sine_wave", 300.0, shot=1e-6, relative=0.01)
    noise = {
        "read": [scale * x for x in sensor.noise.read],
        "shot": scale * 1e-6,
        "relative": 0.01,
    }
    other = sensor.model_copy(update={"gain": scale, "noise": sensor.noise.model_validate(noise)})
    frames = data(sensor, {"crosstalk": CROSSTALK, "discrepancy": 0.05}, 6).frames
    wall = {"strength": 0.03, "distance_m": 4.0, "shadow": {"c0": 0.06, "c1": 0.01}}
    scene = {"object": OBJECT, "crosstalk": CROSSTALK, "background": wall}
    scaled = {
        **scene,
        "crosstalk": [scale * x for x in CROSSTALK],
        "background": {**wall, "strength": scale * 0.03},
    }
    found = density_of(other, scaled, Frames(scale * frames.readings), 0.05)(NOTHING)[0]
    wanted = density_of(sensor, scene, frames, 0.05)(NOTHING)[0]
    assert found == pytest.approx(wanted - 12 * math.log(scale), abs=1e-5)


def test_an_empty_frame_counts_as_without_discrepancy(kind: str) -> None:
    sensor = sensor_of(kind)
    frames = data(sensor, {"crosstalk": CROSSTALK}, 5, span=(0.4, 1.2)).frames
    scene = {"object": OBJECT, "crosstalk": CROSSTALK, "range_m": SPAN}
    empty = Frames(np.array([[0.0021, 0.0099]]), object_present=np.array([False]))
    both = Frames(
        np.concatenate([frames.readings, empty.readings]),
        object_present=np.array([True] * 5 + [False]),
    )
    alone = collapsed_density(sensor, parse_scene(scene), empty).log_likelihood(NOTHING)
    five = density_of(sensor, scene, frames, 0.05).log_likelihood(NOTHING)
    density = density_of(sensor, scene, both, 0.05)
    assert density.log_likelihood(NOTHING) == pytest.approx(alone + five, rel=1e-9)
    assert density_of(sensor, scene, empty, 0.05).log_likelihood(NOTHING) == pytest.approx(alone)
    drawn = density.draw_log_ranges(np.empty((3, 0)), np.random.default_rng(1))
    assert np.isnan(drawn[:, 5]).all()
    assert np.isfinite(drawn[:, :5]).all()
    again = replicate(density, np.empty((3, 0)), drawn, np.random.default_rng(1))
    assert np.isfinite(again).all()


def test_far_from_the_data_the_density_stays_finite_and_never_nan() -> None:
    sensor = sensor_of("sine_wave", shot=1e-6, relative=0.01)
    scene = {
        "crosstalk": UNKNOWN_CROSSTALK,
        "background": {
            "strength": {"prior": "lognormal", "median": 0.03, "sigma": 1.0},
            "distance_m": {"prior": "uniform", "low": 1.0, "high": 10.0},
        },
    }
    frames = data(sensor, {"crosstalk": CROSSTALK}, 6).frames
    density = density_of(sensor, scene, frames, 0.05)
    z = density.parameters.sample(np.random.default_rng(3), 60)
    found, plain = density(z), collapsed_density(sensor, parse_scene(scene), frames)(z)
    assert not np.isnan(found).any()
    np.testing.assert_array_equal(np.isfinite(found), np.isfinite(plain))


def test_where_nothing_fits_laplace_takes_over_without_a_step() -> None:
    """Beyond a hundred nats a frame; along z the integral stays as far below its maximum."""
    sensor = sensor_of("pulsed", 1000.0)
    scene = {
        "object": {**OBJECT, "c2": {"prior": "lognormal", "median": OBJECT["c2"], "sigma": 0.3}},
        "crosstalk": [0.0, 0.0],
        "range_m": SPAN,
    }
    frames = data(sensor, {}, 10, span=(0.4, 1.2)).frames
    density = density_of(sensor, scene, frames, 0.05)
    z = np.linspace(6.0, 9.0, 61)[:, None]
    joint = density.best_ranges(z)[:, :, 1].sum(axis=1)
    below = joint - 10 * log_top(density.instrument.read)
    assert below.min() < -1000.0 < below.max()
    steps = np.abs(np.diff(density.log_likelihood(z) - joint))
    # ranges are nearly normal: what their curvature leaves out is below half a nat a frame
    takeover = int(np.argmax(below < -1000.0))
    assert steps[takeover - 2 : takeover + 2].max() < 5.0
    # beyond, where another mode of a frame takes over, no step is a hundredth of what is lost
    assert (steps < 0.01 * -below[1:]).all()


def test_the_gradient_of_the_joint_maximum_is_that_of_its_linearisation(kind: str) -> None:
    """The envelope theorem: what has been eliminated moves along without changing the value."""
    sensor = sensor_of(kind, 300.0)
    scene = {"crosstalk": UNKNOWN_CROSSTALK, "range_m": SPAN}
    frames = data(sensor, {"crosstalk": CROSSTALK, "discrepancy": 0.05}, 12, span=(0.4, 1.2)).frames
    density = density_of(sensor, scene, frames, 0.05)
    z = density.parameters.standard(np.array([[*C, 0.0023, 0.011]]))[0]
    line = linearise(density, z, density.best_ranges(z[None])[0, :, 0])
    h = 1e-3
    steps = h * np.eye(z.size)
    value = density.best_ranges(np.concatenate([z + steps, z - steps]))[:, :, 1].sum(axis=1)
    difference = (value[: z.size] - value[z.size :]) / (2 * h)
    gradient = -np.einsum("ni,nid->d", line.residual, line.jacobian)
    # the climb ends within a hundredth of a nat of the top
    scale = np.sqrt(np.einsum("nid,nid->d", line.jacobian, line.jacobian))
    np.testing.assert_allclose(difference, gradient, atol=float(0.05 * scale.max()))


def test_drawn_anew_the_flux_errs_by_its_standard_deviation() -> None:
    sensor = sensor_of("pulsed", 1e6)
    frames = data(sensor, None, 3).frames
    density = density_of(sensor, {"object": OBJECT, "crosstalk": [0.0, 0.0]}, frames, 0.05)
    n = 4000
    log_r = np.tile(np.log([0.4, 0.41, 1.5]), (n, 1))
    again = replicate(density, np.empty((n, 0)), log_r, np.random.default_rng(1))
    log_flux = np.log(again[:, :, 1])
    wanted = matern_path_covariance(log_r[0], 0.05)
    # five standard errors of a covariance of normal variates
    np.testing.assert_allclose(np.cov(log_flux.T), wanted, atol=5 * math.sqrt(2 / n) * wanted.max())


def test_ranks_of_ranges_and_of_the_amplitude_are_uniform(kind: str) -> None:
    """Simulation-based calibration; the amplitude's posterior by quadrature, without a sampler."""
    snr, sd, sets, n = 60.0, 0.1, 120, 5
    sensor = sensor_of(kind, snr)
    shape = {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}
    amplitude = {"prior": "lognormal", "median": OBJECT["c2"], "sigma": 0.3}
    scene = parse_scene(
        {
            "object": {**shape, "c2": amplitude},
            "crosstalk": CROSSTALK,
            "range_m": SPAN,
            "discrepancy": sd,
        }
    )
    ranks: dict[str, list[float]] = {"amplitude": [], "first": [], "last": []}
    grid = np.linspace(-4, 4, 161)[:, None]
    for seed in range(sets):
        rng = np.random.default_rng([seed, 5])
        truth = np.exp(rng.uniform(math.log(0.3), math.log(1.5), n))
        made = simulate(sensor, scene, SampledTrajectory(range_m=truth.tolist()), rng)
        density = fold.prepare(sensor, scene, made.frames, SamplerSettings(seed=1)).density()
        weight = density(grid)
        weight = np.exp(weight - weight.max())
        total = np.cumsum(weight) / weight.sum()
        z = np.interp(rng.random(99), total, grid[:, 0])[:, None]
        drawn = np.exp(density.draw_log_ranges(z, rng))
        true_z = density.parameters.standard(np.array([[made.parameters["object.c2"]]]))[0, 0]
        ranks["amplitude"].append(float(np.interp(true_z, grid[:, 0], total)))
        for name, j in (("first", 0), ("last", n - 1)):
            below = np.sum(drawn[:, j] < truth[j])
            ranks[name].append(float((below + rng.random()) / 100))
    for name, found in ranks.items():
        # false alarms: 1e-3 each, six of them
        assert stats.kstest(found, "uniform").pvalue > 1e-3, name


def test_a_job_with_discrepancy_answers_for_every_frame() -> None:
    sensor = sensor_of("pulsed", 300.0)
    scene = parse_scene(
        {
            "object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]},
            "crosstalk": CROSSTALK,
            "range_m": SPAN,
            "discrepancy": 0.03,
        }
    )
    frames = data(sensor, {"crosstalk": CROSSTALK, "discrepancy": 0.03}, 8, span=(0.4, 1.2)).frames
    job = fold.prepare(sensor, scene, frames, SamplerSettings(seed=1, method="importance"))
    assert isinstance(job.density(), DiscrepantDensity)
    assert type(job.from_bytes(job.to_bytes()).density()) is DiscrepantDensity
    posterior = fold.summarise(job, fold.start(job), 0.0, 0.0)
    assert posterior.verdict.converged
    assert np.isfinite(posterior.range_m.sd).all()
    assert not posterior.fit.misfit
    assert "discrepancy" not in [term.term for term in posterior.left_out]


def test_without_a_discrepancy_nothing_of_it_exists() -> None:
    sensor = sensor_of("pulsed")
    frames = data(sensor, None, 3).frames
    job = fold.prepare(sensor, parse_scene({}), frames, SamplerSettings(seed=1))
    assert type(job.density()) is CollapsedDensity


def test_an_error_of_the_flux_hides_the_reflectance_by_as_much() -> None:
    """Ten frames of one place share one error of 5 %: slopes tell log c2 to that and no better.

    The noise adds 3e-5 of it.
    """
    sensor = sensor_of("pulsed")
    assert isinstance(sensor, PulsedSensor)
    flux = sensor.known_gain * 0.0769 * 0.1 / (0.25 * (0.25 - 0.0615 + 0.0769))
    frames = Frames(np.tile([flux * 0.5 / sensor.r0, flux], (10, 1)))
    known = {"object": {"c0": 0.0769, "c1": -0.123}}
    density = density_of(sensor, known, frames, 0.05)
    assert density.parameters.names == ("object.c2",)  # lognormal of sigma 1: z is log c2
    line = linearise(density, np.zeros(1), np.full(10, np.log(0.5)))
    assert float(np.sum(line.jacobian**2)) ** -0.5 == pytest.approx(0.05, rel=0.02)
