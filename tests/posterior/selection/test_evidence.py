"""Evidence and cross-validated predictive density against quadrature in up to three dimensions."""

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.static import with_common_range
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.start import find_optima
from inference.posterior.selection import evidence
from inference.posterior.selection.cross_validation import cross_validate
from inference.posterior.selection.evidence import log_prior_mass, weigh
from inference.posterior.selection.leave_one_out import leave_one_out
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.simulate import mean_readings
from tests.posterior.scenes import OBJECT, data, sensor_of

Array = NDArray[np.float64]

CROSSTALK = [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2
C1_MEAN, C1_SD = -0.4, 0.3
C1 = {"prior": "normal", "mean": C1_MEAN, "sd": C1_SD}
SCENES: dict[str, dict[str, Any]] = {
    "c2": {"object": OBJECT | {"c2": {"prior": "lognormal", "median": 0.1, "sigma": 1.0}}},
    # the joint truncation of c0 and c1 takes a good part of this prior away
    "c0 and c1": {"object": {"c0": {"prior": "uniform", "low": 1e-3, "high": 0.2}, "c1": C1}},
    "crosstalk": {"object": OBJECT, "crosstalk": CROSSTALK},
    "c2 and crosstalk": {"object": {"c0": 0.0769, "c1": -0.123}, "crosstalk": CROSSTALK},
}
SCENES["c0 and c1"]["object"]["c2"] = OBJECT["c2"]


def density_of(name: str, snr: float = 300.0) -> CollapsedDensity:
    sensor = sensor_of("pulsed", snr)
    return collapsed_density(sensor, parse_scene(SCENES[name]), data(sensor, frames=8).frames)


def quadrature(density: CollapsedDensity, points: int = 41) -> tuple[Array, Array]:
    """Nodes in z and log weights of the prior, on a box that draws have been seen to fill."""
    parameters = density.parameters
    z = weigh(density, np.random.default_rng(99)).z
    weighed = density(z)
    centre = z[np.argmax(weighed)]
    inside = z[weighed > weighed.max() - 30]
    low, high = inside.min(axis=0), inside.max(axis=0)
    reach = 1.2 * np.maximum(centre - low, high - centre)
    x, w = np.polynomial.legendre.leggauss(points)
    axes = [c + r * x for c, r in zip(centre, reach, strict=True)]
    nodes = np.array(list(itertools.product(*axes)))
    weights = np.array([math.prod(p) for p in itertools.product(*[r * w for r in reach])])
    rng = np.random.default_rng(98)
    constant = 0.5 * len(parameters) * math.log(2 * math.pi) + prior_mass(parameters, rng)
    return nodes, np.log(weights) + parameters.log_prior(nodes) - constant


def prior_mass(parameters: Any, rng: np.random.Generator) -> float:
    """The share of independent priors that the joint truncation leaves, by rejection."""
    if not any(unknown.log_correction for unknown in parameters.unknowns):
        return 0.0
    c0 = rng.uniform(1e-3, 0.2, 4_000_000)
    c1 = rng.normal(C1_MEAN, C1_SD, c0.size)
    return math.log(np.mean(c1 > -2 * np.sqrt(c0)))


def test_the_prior_is_normalised_over_its_joint_truncation() -> None:
    scene = parse_scene(SCENES["c0 and c1"])
    parameters = parameters_of(sensor_of("pulsed"), scene)
    value, error = log_prior_mass(parameters, np.random.default_rng(0))
    # four million draws of a probability above 0.8: 2.5e-4; five standard errors
    assert abs(value - prior_mass(parameters, np.random.default_rng(1))) < 5 * (error + 2.5e-4)
    assert value < -0.05


@pytest.mark.parametrize("name", SCENES)
def test_evidence_agrees_with_quadrature(name: str) -> None:
    density = density_of(name)
    nodes, weights = quadrature(density)
    wanted = special.logsumexp(weights + density.log_likelihood(nodes))
    found = weigh(density, np.random.default_rng(3)).evidence
    # five standard errors, four scenes: a false alarm once in 4e5
    assert abs(found.log_evidence - wanted) < 5 * found.error + 1e-3
    assert found.error < 0.05


@pytest.mark.parametrize(
    "name", ["c0 and c1", pytest.param("c2 and crosstalk", marks=pytest.mark.thorough)]
)
def test_evidence_by_bridge_agrees_with_quadrature(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    density = density_of(name)
    nodes, weights = quadrature(density)
    wanted = special.logsumexp(weights + density.log_likelihood(nodes))
    monkeypatch.setattr(evidence, "_MAX_K_HAT", -math.inf)  # as if weights could not be trusted
    found = weigh(density, np.random.default_rng(4)).evidence
    assert found.k_hat is None
    assert abs(found.log_evidence - wanted) < 5 * found.error + 1e-3
    assert found.error < 0.1


def test_where_populations_die_the_error_is_what_two_accounts_differ_by(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    density = density_of("crosstalk")
    none = np.empty((0, 2))
    dead = Population(none, none[:, 0], none[:, 0], 0.0, 0.0, 1, 0)
    monkeypatch.setattr(evidence, "_MAX_K_HAT", -math.inf)  # as if weights could not be trusted
    monkeypatch.setattr(evidence, "carried", lambda *_: dead)
    found = weigh(density, np.random.default_rng(5)).evidence
    (optimum,) = find_optima(density, np.random.default_rng(5))
    laplace = optimum.log_mass - math.log(2 * math.pi)  # two unknowns with standard normal priors
    assert found.k_hat is not None
    # optima are found to a hundredth of a standard deviation: 1e-3 nat
    assert found.error >= abs(found.log_evidence - laplace) - 1e-3
    assert abs(found.log_evidence - laplace) > 1e-3


@pytest.mark.parametrize("name", ["c2", "crosstalk"])
def test_every_frame_is_predicted_as_by_quadrature_without_it(name: str) -> None:
    density = density_of(name)
    found, _ = cross_validate(
        density, weigh(density, np.random.default_rng(5)), np.random.default_rng(6)
    )
    for j in range(len(density.frames)):
        others = dataclasses.replace(density, frames=np.delete(density.frames, j, axis=0))
        nodes, weights = quadrature(others)
        rest = weights + others.log_likelihood(nodes)
        own = density.frame_log_likelihoods(nodes)[:, j]
        wanted = special.logsumexp(rest + own) - special.logsumexp(rest)
        # 2000 draws, weights of k-hat below 0.7: a few percent
        assert found.k_hat[j] < 0.7
        assert found.log_predictive[j] == pytest.approx(wanted, abs=0.2)


def test_frames_at_one_range_are_predicted_given_the_others() -> None:
    """A static object, nothing unknown but its range: the predictive density in closed form.

    Frames with independent additive noise depend on one another through the range alone.
    """
    sensor = sensor_of("pulsed", 300.0)
    frames = data(sensor, frames=6, span=(0.7, 0.7000001)).frames
    density = with_common_range(
        collapsed_density(sensor, parse_scene({"object": OBJECT, "motion": "static"}), frames)
    )
    found, _ = cross_validate(
        density, weigh(density, np.random.default_rng(0)), np.random.default_rng(1)
    )
    u = np.linspace(math.log(0.69), math.log(0.71), 20_001)
    means = mean_readings(sensor, density.parameters.terms(np.empty((1, 0))), np.exp(u))
    read = np.array(sensor.noise.read)
    residual = (frames.readings[:, None] - means) / read
    single = -0.5 * (residual**2).sum(axis=2) - np.log(read).sum() - math.log(2 * math.pi)
    whole = special.logsumexp(single.sum(axis=0))
    for j in range(6):
        rest = special.logsumexp(np.delete(single, j, axis=0).sum(axis=0))
        # the loguniform prior is flat over u; the integrals are good to 1e-6
        assert found.log_predictive[j] == pytest.approx(whole - rest, abs=1e-4)


def test_scale_of_readings_shifts_the_evidence_by_its_jacobian_alone() -> None:
    name = "c2 and crosstalk"
    sensor = sensor_of("pulsed", 300.0)
    frames = data(sensor, frames=8).frames
    unit = 2.0**-30
    scene = SCENES[name] | {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.02 * unit}] * 2}
    small = sensor.model_copy(
        update={
            "gain": sensor.known_gain * unit,
            "noise": sensor.noise.model_copy(
                update={"read": tuple(read * unit for read in sensor.noise.read)}
            ),
        }
    )
    plain = collapsed_density(sensor, parse_scene(SCENES[name]), frames)
    scaled = collapsed_density(
        small, parse_scene(scene), dataclasses.replace(frames, readings=frames.readings * unit)
    )
    first, second = (weigh(d, np.random.default_rng(7)).evidence for d in (plain, scaled))
    shift = 2 * 8 * math.log(unit)
    assert second.log_evidence - first.log_evidence == pytest.approx(-shift, abs=1e-6)


def test_leave_one_out_of_draws_of_equal_weight_and_weighted_ones() -> None:
    """Normal data of known variance: the predictive density of each datum in closed form."""
    rng = np.random.default_rng(8)
    y = rng.normal(size=12)
    n = y.size
    mean, sd = y.sum() / (n + 1), 1 / math.sqrt(n + 1)  # standard normal prior of the mean
    draws = rng.normal(mean, sd, 4000)
    wide = rng.normal(mean, 1.5 * sd, 4000)
    log_weights = -0.5 * ((wide - mean) / sd) ** 2 + 0.5 * ((wide - mean) / 1.5 / sd) ** 2

    def log_density(theta: Array) -> Array:
        return -0.5 * (y - theta[:, None]) ** 2 - 0.5 * math.log(2 * math.pi)

    plain = leave_one_out(log_density(draws))
    weighted = leave_one_out(log_density(wide), log_weights)
    for j in range(n):
        rest = np.delete(y, j)
        centre, variance = rest.sum() / n, 1 + 1 / n
        wanted = -0.5 * (y[j] - centre) ** 2 / variance - 0.5 * math.log(2 * math.pi * variance)
        # the relative spread of a likelihood over such draws is below one: 5 / sqrt(4000)
        assert plain.log_predictive[j] == pytest.approx(wanted, abs=0.08)
        assert weighted.log_predictive[j] == pytest.approx(wanted, abs=0.08)
    assert plain.worst_k_hat < 0.5


def test_a_frame_without_density_under_some_draw_has_no_k_hat() -> None:
    likelihoods = np.zeros((100, 2))
    likelihoods[3, 1] = -np.inf
    found = leave_one_out(likelihoods)
    assert found.k_hat[0] < 0.7
    assert found.k_hat[1] == math.inf
    assert found.log_predictive[1] == -math.inf


def test_weights_of_any_span_and_equal_draws_have_a_k_hat() -> None:
    """Resampled draws are equal to one another; under a misfit weights span hundreds of nats."""
    rng = np.random.default_rng(9)
    for likelihoods in (
        np.repeat(rng.normal(size=(20, 1)), 100, axis=0),
        1e3 * rng.normal(size=(2000, 1)),
        np.zeros((2000, 1)),
    ):
        found = leave_one_out(likelihoods)
        assert not np.isnan(found.k_hat[0])
        assert found.log_predictive[0] <= likelihoods.max() + 1e-12
