"""Priors against scipy's laws, and the scene's unknowns in their standard normal coordinates."""

import math

import numpy as np
import pytest
from scipy import integrate, stats

from simulator.parameters import parameters_of
from simulator.priors import (
    HalfNormal,
    LogNormal,
    LogUniform,
    Normal,
    TruncatedNormal,
    Uniform,
)
from simulator.priors.distribution import Distribution
from simulator.priors.normal import NormalDistribution
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

LAWS = [
    (Uniform(low=-1.0, high=3.0), stats.uniform(-1, 4)),
    (LogUniform(low=0.02, high=20.0), stats.loguniform(0.02, 20)),
    (Normal(mean=1.0, sd=2.0), stats.norm(1, 2)),
    (HalfNormal(sd=0.5), stats.halfnorm(scale=0.5)),
    (LogNormal(median=0.1, sigma=2.0), stats.lognorm(2.0, scale=0.1)),
    (TruncatedNormal(mean=0.0, sd=1.0, low=3.0, high=5.0), stats.truncnorm(3, 5)),
]
NAMES = ["uniform", "loguniform", "normal", "halfnormal", "lognormal", "truncated_normal"]
PULSED = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1, 1]}})


@pytest.mark.parametrize(("prior", "law"), LAWS, ids=NAMES)
def test_maps_and_densities_are_those_of_the_law(prior, law) -> None:  # type: ignore[no-untyped-def]
    distribution = prior.distribution()
    z = np.linspace(-5, 5, 41)
    # from the nearer tail, where scipy's quantiles keep their digits
    wanted = np.where(z < 0, law.ppf(stats.norm.cdf(z)), law.isf(stats.norm.sf(z)))
    x = distribution.from_normal(z)
    np.testing.assert_allclose(x, wanted, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(distribution.log_density(x), law.logpdf(x), rtol=1e-9, atol=1e-9)
    # a quantile near an end of the support is known to rounding over the density there
    np.testing.assert_allclose(distribution.to_normal(x), z, atol=1e-6)


@pytest.mark.parametrize(("prior", "law"), LAWS, ids=NAMES)
def test_cut_laws(prior, law) -> None:  # type: ignore[no-untyped-def]
    distribution = prior.distribution()
    low, high = (float(q) for q in law.ppf([0.2, 0.7]))
    assert float(distribution.log_mass(low, high)) == pytest.approx(math.log(0.5), rel=1e-9)
    x = distribution.from_normal(np.array([-1.0, 0.0, 2.0]), low, high)
    wanted = law.ppf(0.2 + 0.5 * stats.norm.cdf([-1.0, 0.0, 2.0]))
    np.testing.assert_allclose(x, wanted, rtol=1e-9)
    assert float(distribution.log_mass(high, low)) == -math.inf


@pytest.mark.parametrize(("prior", "law"), LAWS, ids=NAMES)
def test_deviations_are_those_of_the_density(prior, law) -> None:  # type: ignore[no-untyped-def]
    """Whole laws and cut ones, against densities in x, or in log x, on a grid of their support."""
    distribution = prior.distribution()
    for low, high in ((-math.inf, math.inf), tuple(float(q) for q in law.ppf([0.2, 0.7]))):
        x = distribution.from_normal(np.linspace(-6, 6, 4001), low, high)
        density = law.logpdf(x) + (np.log(x) if distribution.log else 0.0)
        wanted = np.sqrt(np.maximum(2 * (density.max() - density), 0.0))
        # the greatest density may lie between two points of the grid
        np.testing.assert_allclose(distribution.deviation(x, low, high), wanted, atol=5e-3)


def test_a_prior_that_is_densest_at_its_end_has_nothing_against_it() -> None:
    """A millionth of the light that it allows has next to no mass below; five times has above."""
    light = {"prior": "halfnormal", "sd": 1.0}
    parameters = parameters_of(PULSED, parse_scene({"crosstalk": [light, light]}))
    values = np.array([[0.1, 0.0, 0.1, 1e-6, 5.0]])
    z = parameters.standard(values)
    off = parameters.deviations(z)
    assert z[0, 3] < -4.4
    np.testing.assert_allclose(off[0, 3:], [1e-6, z[0, 4]], rtol=1e-6)
    assert z[0, 4] > 4.4
    np.testing.assert_allclose(off[0, :3], np.abs(z[0, :3]))


@pytest.mark.parametrize(
    "scene",
    [
        {},
        {"crosstalk": [{"prior": "normal", "mean": 0, "sd": 0.1}, 0.2]},
        {"background": {"strength": 1.0, "distance_m": {"prior": "uniform", "low": 2, "high": 9}}},
        {"object": {"c1": {"prior": "normal", "mean": 0.0, "sd": 1.0}}},
        {"object": {"c1": -0.5}},
        {"range_m": {"prior": "stroke", "low": 0.1, "high": 3.0}},
        {"range_m": {"prior": "reference", "low": 0.1, "high": 3.0}},
    ],
)
def test_coordinates_and_values_are_inverse(scene: dict[str, object]) -> None:
    parameters = parameters_of(PULSED, parse_scene(scene))
    z = parameters.sample(np.random.default_rng(1), 500)
    again = parameters.standard(parameters.natural(z))
    np.testing.assert_allclose(again, z, atol=1e-7)
    c0, c1, _ = parameters.terms(z).object.T
    assert (c1 > -2 * np.sqrt(c0)).all()


def test_joint_truncation_has_the_right_marginal() -> None:
    """c0 given c1 > -2 sqrt(c0) has density p(c0) P(c1 > -2 sqrt(c0)): Kolmogorov-Smirnov,
    false-alarm rate 1e-4."""
    scene = parse_scene(
        {
            "object": {
                "c0": {"prior": "uniform", "low": 0.0, "high": 1.0},
                "c1": {"prior": "normal", "mean": -1.0, "sd": 1.0},
                "c2": 0.1,
            }
        }
    )
    parameters = parameters_of(PULSED, scene)
    drawn = parameters.natural(parameters.sample(np.random.default_rng(2), 4000))[:, 0]

    # in the square root of c0 the density is smooth, and Simpson's rule exact to 1e-12
    root = np.linspace(0.0, 1.0, 1001)
    cdf = integrate.cumulative_simpson(
        2 * root * stats.norm.sf(-2 * root, -1, 1), x=root, initial=0
    )
    uniform = np.interp(np.sqrt(drawn), root, cdf / cdf[-1])
    assert stats.kstest(uniform, "uniform").pvalue > 1e-4


@pytest.mark.parametrize(
    "prior",
    [
        {"prior": "uniform", "low": 0.1, "high": 4.0},
        {"prior": "loguniform", "low": 0.1, "high": 4.0},
        {"prior": "normal", "mean": 1.0, "sd": 0.5},
        {"prior": "halfnormal", "sd": 0.7},
        {"prior": "lognormal", "median": 0.5, "sigma": 0.6},
        {"prior": "truncated_normal", "mean": 1.0, "sd": 0.5, "low": 0.3, "high": 1.1},
        {"prior": "stroke", "low": 0.1, "high": 3.0},
    ],
)
@pytest.mark.parametrize("cut", [False, True])
def test_the_law_of_a_range_integrates_to_one(prior: dict[str, object], cut: bool) -> None:
    shadow = {"c0": 1.0, "c1": -0.4} if cut else {"c0": 1.0, "c1": 0.1}
    wall = {"strength": 1.0, "distance_m": 3.0, "shadow": shadow}
    scene = parse_scene({"range_m": prior, "background": wall})
    law = parameters_of(PULSED, scene).terms(np.zeros((1, len(parameters_of(PULSED, scene)))))
    a = law.ranges[0]
    assert a[6] == pytest.approx(max(0.4 if cut else 0.0, a[6]))

    def density(u: float) -> float:
        r = math.exp(u)
        square = ((r - a[2]) * a[3]) ** 2 + ((u - a[4]) * a[5]) ** 2
        return math.exp(a[0] + (a[1] + 1) * u - 0.5 * square)

    low, high = math.log(max(a[6], 1e-9)), math.log(min(a[7], 1e3))
    total = integrate.quad(density, low, high, limit=500, epsabs=1e-11)[0]
    assert total == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("log", [False, True])
def test_a_whole_normal_law_needs_no_tails(log: bool) -> None:
    law = NormalDistribution(
        log=log, loc=0.3, scale=1.7, low=0.0 if log else -math.inf, high=math.inf
    )
    z = np.linspace(-6.0, 6.0, 25)
    x = law.from_normal(z)
    np.testing.assert_allclose(law.to_normal(x), z, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(law.to_normal(x), Distribution.to_normal(law, x), atol=1e-9)
    if log:
        assert law.to_normal(0.0) == -math.inf
