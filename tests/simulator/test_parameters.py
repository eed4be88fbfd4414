"""Unknowns of a scene: which exist, what they mean, and the joint law of those that are cut."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from simulator.errors import InvalidInputError, RefusedError
from simulator.parameters import Parameters, parameters_of
from simulator.scene import Reference, parse_scene
from simulator.sensor import Sensor, parse_sensor

PULSED = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1, 1]}})
SINE = parse_sensor({"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1, 1]}})
NORMAL = {"prior": "normal", "mean": 0.0, "sd": 0.1}
WIDE = {"prior": "uniform", "low": 0.5, "high": 9.0}
KNOWN = {"c0": 0.1, "c1": -0.1, "c2": 0.2}
RATE = 1e-5  # false alarms of each statistical test; its seed is fixed


def made(scene: dict[str, Any], sensor: Sensor = PULSED) -> Parameters:
    return parameters_of(sensor, parse_scene(scene))


def test_order_and_names_of_everything_unknown() -> None:
    scene = {
        "crosstalk": {"values": [NORMAL, NORMAL], "optional": True},
        "background": {"strength": WIDE, "distance_m": WIDE},
        "range_m": {"prior": "stroke", "low": 0.1, "high": 3.0},
    }
    tail = (
        "background.strength",
        "background.distance_m",
        "background.shadow.c0",
        "background.shadow.c1",
        "range_m.centre",
        "range_m.spread",
    )
    head = ("object.c0", "object.c1", "object.c2")
    assert made(scene).names == (*head, "crosstalk.w1", "crosstalk.w2", *tail)
    assert made(scene, SINE).names == (*head, "crosstalk.i", "crosstalk.q", *tail)
    assert len(made(scene)) == 11


@pytest.mark.parametrize(
    ("scene", "names"),
    [
        ({"object": KNOWN}, ()),
        ({"object": KNOWN | {"c1": NORMAL}}, ("object.c1",)),
        ({"object": {"c0": 0.1}}, ("object.c1", "object.c2")),
        ({"object": KNOWN, "crosstalk": [0.1, 0.2]}, ()),
        ({"object": KNOWN, "crosstalk": [0.1, NORMAL]}, ("crosstalk.w2",)),
        (
            {
                "object": KNOWN,
                "background": {"strength": 1, "distance_m": WIDE, "shadow": "object"},
            },
            ("background.distance_m",),
        ),
        (
            {
                "object": KNOWN,
                "background": {"strength": 1, "distance_m": 3, "shadow": {"c0": 0.1}},
            },
            ("background.shadow.c1",),
        ),
        ({"object": KNOWN, "range_m": WIDE, "discrepancy": 0.1}, ()),
    ],
)
def test_what_is_known_or_absent_has_no_parameter(
    scene: dict[str, Any], names: tuple[str, ...]
) -> None:
    parameters = made(scene)
    assert parameters.names == names
    z = np.zeros((3, len(names)))
    terms = parameters.terms(z)
    assert (terms.crosstalk is None) == ("crosstalk" not in scene)
    assert (terms.background is None) == ("background" not in scene)
    assert parameters.natural(z).shape == parameters.standard(parameters.natural(z)).shape
    assert parameters.natural(z).shape == (3, len(names))


def test_terms_hold_the_known_numbers_and_the_unknown_ones() -> None:
    scene = {
        "object": KNOWN | {"c1": NORMAL},
        "crosstalk": [NORMAL, 0.7],
        "background": {"strength": 2.0, "distance_m": WIDE, "shadow": "object"},
    }
    parameters = made(scene)
    z = np.random.default_rng(0).standard_normal((5, 3))
    natural = dict(zip(parameters.names, parameters.natural(z).T, strict=True))
    terms = parameters.terms(z)
    assert terms.crosstalk is not None
    assert terms.background is not None
    one = np.ones(5)
    np.testing.assert_array_equal(
        terms.object, np.column_stack([0.1 * one, natural["object.c1"], 0.2 * one])
    )
    np.testing.assert_array_equal(
        terms.crosstalk, np.column_stack([natural["crosstalk.w1"], 0.7 * one])
    )
    columns = [2.0 * one, natural["background.distance_m"], 0.1 * one, natural["object.c1"]]
    np.testing.assert_array_equal(terms.background, np.column_stack(columns))


def test_default_priors_are_those_of_the_documents() -> None:
    parameters = made({"background": {"strength": 1.0, "distance_m": 3.0}})
    z = np.random.default_rng(1).standard_normal((50, 5))
    c0, c1, c2, s0, s1 = parameters.natural(z).T
    np.testing.assert_allclose(c0, 0.1 * np.exp(2 * z[:, 0]), rtol=1e-13)
    np.testing.assert_allclose(c1, 2 * np.sqrt(c0) * np.expm1(0.4 * z[:, 1]), rtol=1e-13)
    np.testing.assert_allclose(c2, 0.1 * np.exp(z[:, 2]), rtol=1e-13)
    np.testing.assert_allclose(s0, 0.75 * c0 * np.exp(0.5 * z[:, 3]), rtol=1e-13)
    half = stats.halfnorm(scale=0.3 * np.sqrt(c0))
    np.testing.assert_allclose(half.cdf(s1), stats.norm.cdf(z[:, 4]), rtol=1e-9)


@pytest.mark.parametrize(
    ("sensor", "low", "high"),
    [
        (PULSED, 0.02, PULSED.max_range_m),
        (SINE, 0.02, 20.0),
        (PULSED.model_copy(update={"pulse_width_s": 1e-9}), 0.02, 0.149896229),
        (PULSED.model_copy(update={"pulse_width_s": 1e-6}), 0.02, 20.0),
        (SINE.model_copy(update={"frequency_hz": 1e8}), 0.02, 1.49896229),
        # the whole range of the sensor lies nearer than 2 cm
        (SINE.model_copy(update={"frequency_hz": 1e10}), 1.49896229e-4, 1.49896229e-2),
    ],
)
def test_default_prior_of_a_range(sensor: Sensor, low: float, high: float) -> None:
    """The reference prior; of the one range of an object at rest, a log-uniform one."""
    for motion, constant in (("radial", 0.0), ("static", -math.log(math.log(high / low)))):
        parameters = parameters_of(sensor, parse_scene({"object": KNOWN, "motion": motion}))
        assert isinstance(parameters.range_prior, Reference) == (motion == "radial")
        law = parameters.terms(np.zeros((1, 0))).ranges[0]
        np.testing.assert_allclose(law[6:], [low, high], rtol=1e-14)
        np.testing.assert_allclose(law[0], constant, rtol=1e-12)
        assert law[1:6].tolist() == [-1.0, 0.0, 0.0, 0.0, 0.0]


def test_ranges_that_a_shadow_forbids_have_no_mass() -> None:
    """S < 0 below -c1': the law is renormalised above, and vanishes where nothing is left."""
    wall = {"strength": 1.0, "distance_m": 3.0}
    scene = {"object": KNOWN, "range_m": {"prior": "uniform", "low": 0.1, "high": 0.5}}
    for c1, (low, normaliser) in {
        0.4: (0.1, 0.4),
        -0.05: (0.1, 0.4),
        -0.3: (0.3, 0.2),
        -0.5: (0.5, 0.0),
        -0.7: (0.7, 0.0),
    }.items():
        shadow = {"c0": 1.0, "c1": c1}
        law = made(scene | {"background": wall | {"shadow": shadow}}).terms(np.zeros((1, 0)))
        found = law.ranges[0]
        assert found[6] == low
        if normaliser > 0.0:
            assert math.exp(-found[0]) == pytest.approx(normaliser, rel=1e-12)
        else:
            assert found[0] == -math.inf


def test_a_pulse_bounds_the_prior_of_ranges_and_of_a_background() -> None:
    prior = {"prior": "uniform", "low": 1.0, "high": 40.0}
    scene = {"object": KNOWN, "range_m": prior}
    assert made(scene).terms(np.zeros((1, 0))).ranges[0, 7] == PULSED.max_range_m
    assert made(scene, SINE).terms(np.zeros((1, 0))).ranges[0, 7] == 40.0
    scene = {
        "object": KNOWN,
        "background": {"strength": 1, "distance_m": prior, "shadow": "object"},
    }
    z = np.array([[8.0]])
    assert made(scene).natural(z)[0, 0] <= PULSED.max_range_m
    assert made(scene, SINE).natural(z)[0, 0] > 39.0


def test_a_stroke_has_a_centre_inside_and_a_spread() -> None:
    parameters = made({"object": KNOWN, "range_m": {"prior": "stroke", "low": 0.1, "high": 40.0}})
    assert parameters.names == ("range_m.centre", "range_m.spread")
    z = np.random.default_rng(2).standard_normal((40, 2))
    centre, spread = parameters.natural(z).T
    uniform = stats.uniform(math.log(0.1), math.log(PULSED.max_range_m / 0.1))
    np.testing.assert_allclose(uniform.cdf(np.log(centre)), stats.norm.cdf(z[:, 0]), rtol=1e-9)
    np.testing.assert_allclose(spread, 0.5 * np.exp(z[:, 1]), rtol=1e-13)
    law = parameters.terms(z).ranges
    np.testing.assert_allclose(law[:, 4], np.log(centre), rtol=1e-13)
    np.testing.assert_allclose(law[:, 5], 1 / spread, rtol=1e-13)
    for row in law:
        log_r = stats.norm(row[4], 1 / row[5])
        a, b = np.log(row[6:8])
        # log p(r) = a0 - log r - ((log r - a4) a5)^2 / 2 on [a6, a7]
        share = log_r.cdf(b) - log_r.cdf(a) if row[4] < a else log_r.sf(a) - log_r.sf(b)
        wanted = -math.log(share) - 0.5 * math.log(2 * math.pi) + math.log(row[5])
        assert row[0] == pytest.approx(wanted, rel=1e-9, abs=1e-9)


def test_a_reference_prior_has_no_unknowns_and_ends_at_the_background() -> None:
    wall = {"strength": 1.0, "distance_m": WIDE, "shadow": "object"}
    law = {"prior": "reference", "low": 0.1, "high": 3.0}
    parameters = made({"object": KNOWN, "background": wall, "range_m": law})
    assert parameters.names == ("background.distance_m",)
    z = np.random.default_rng(3).standard_normal((20, 1))
    distance = parameters.natural(z)[:, 0]
    found = parameters.terms(z).ranges
    assert (found[:, 6] == 0.1).all()
    np.testing.assert_array_equal(found[:, 7], np.minimum(distance, 3.0))
    # a density for every range that the readings tell apart: no constant goes with its support
    np.testing.assert_array_equal(found[distance > 0.1, 0], 0.0)


SCENES: list[dict[str, Any]] = [
    {"crosstalk": [NORMAL, WIDE]},
    {"background": {"strength": WIDE, "distance_m": WIDE}},
    {"background": {"strength": WIDE, "distance_m": 3.0, "shadow": {"c1": -0.2}}},
    {"background": {"strength": 1.0, "distance_m": 3.0, "shadow": {"c1": NORMAL}}},
    {"object": {"c0": WIDE, "c1": NORMAL}},
    {"object": {"c0": WIDE, "c1": -2.5}},
    {"object": {"c1": {"prior": "uniform", "low": -0.7, "high": -0.5}}},
    {"range_m": {"prior": "stroke", "low": 0.1, "high": 3.0}},
    {"range_m": {"prior": "reference", "low": 0.1, "high": 3.0}},
]


@settings(deadline=None)
@given(st.sampled_from(SCENES), st.sampled_from([PULSED, SINE]), st.integers(0, 2**32))
def test_draws_are_physical_and_coordinates_inverse(
    scene: dict[str, Any], sensor: Sensor, seed: int
) -> None:
    parameters = made(scene, sensor)
    z = parameters.sample(np.random.default_rng(seed), 4)
    assert z.shape == (4, len(parameters))
    natural = parameters.natural(z)
    # a coordinate near 6 is known to 1e-6: an eps of a probability of 1e-9 from an end
    np.testing.assert_allclose(parameters.standard(natural), z, atol=1e-6)
    terms = parameters.terms(z)
    assert np.all(terms.object[:, 1] > -2 * np.sqrt(terms.object[:, 0]))
    if terms.background is not None:
        assert np.all(terms.background[:, 3] > -2 * np.sqrt(terms.background[:, 2]))
    assert np.all(np.isfinite(parameters.log_prior(z)))


@settings(deadline=None)
@given(st.sampled_from(SCENES), st.lists(st.floats(-1e3, 1e3), min_size=11, max_size=11))
def test_far_out_nothing_warns_and_no_prior_is_nan(scene: dict[str, Any], far: list[float]) -> None:
    parameters = made(scene)
    z = np.array([far[: len(parameters)]])
    density = parameters.log_prior(z)
    assert not np.isnan(density).any()
    assert np.all(density <= -0.5 * np.sum(z**2) * (1 - 1e-12) + 1e-9)
    parameters.natural(z)
    parameters.terms(z)


def test_joint_law_of_an_object() -> None:
    """p(c0, c1) p with c1 > -2 sqrt(c0): the marginal of c0 and c1 given c0, each
    Kolmogorov-Smirnov with 1e-5 false alarms."""
    law0, law1 = stats.lognorm(1.0, scale=0.1), stats.norm(-0.8, 0.4)
    scene = {
        "object": {
            "c0": {"prior": "lognormal", "median": 0.1, "sigma": 1.0},
            "c1": {"prior": "normal", "mean": -0.8, "sd": 0.4},
            "c2": 0.1,
        }
    }
    parameters = made(scene)
    c0, c1 = parameters.natural(parameters.sample(np.random.default_rng(3), 5000)).T

    def weight(u: np.ndarray) -> np.ndarray:
        """Density of u = Phi^-1 of c0's own law, not normalised."""
        x = law0.ppf(stats.norm.cdf(u))
        return np.asarray(stats.norm.pdf(u) * law1.sf(-2 * np.sqrt(x)))

    u = np.linspace(-8, 8, 4001)
    cdf = integrate.cumulative_simpson(weight(u), x=u, initial=0.0)
    drawn = stats.norm.ppf(law0.cdf(c0))
    assert stats.kstest(np.interp(drawn, u, cdf / cdf[-1]), "uniform").pvalue > RATE
    tail = law1.sf(c1) / law1.sf(-2 * np.sqrt(c0))
    assert stats.kstest(tail, "uniform").pvalue > RATE


def test_joint_law_of_a_shadow_that_follows_the_object() -> None:
    """A known c1' = -0.6 needs c0' > 0.09, and c0' scales with c0, which is thereby drawn up.

    Kolmogorov-Smirnov on the marginal of c0 and on c0' given c0, 1e-5 false alarms each."""
    scene = {
        "object": {"c1": 0.0, "c2": 0.1},
        "background": {"strength": 1.0, "distance_m": 3.0, "shadow": {"c1": -0.6}},
    }
    parameters = made(scene)
    assert parameters.names == ("object.c0", "background.shadow.c0")
    c0, s0 = parameters.natural(parameters.sample(np.random.default_rng(4), 5000)).T
    ratio = stats.lognorm(0.5, scale=0.75)
    u = np.linspace(-8, 8, 4001)
    weight = stats.norm.pdf(u) * ratio.sf(0.09 / (0.1 * np.exp(2 * u)))
    cdf = integrate.cumulative_simpson(weight, x=u, initial=0.0)
    drawn = np.log(c0 / 0.1) / 2
    assert stats.kstest(np.interp(drawn, u, cdf / cdf[-1]), "uniform").pvalue > RATE
    assert np.all(s0 > 0.09)
    tail = ratio.sf(s0 / c0) / ratio.sf(0.09 / c0)
    assert stats.kstest(tail, "uniform").pvalue > RATE


def test_a_far_tail_of_c0_is_drawn_where_c1_demands_it() -> None:
    """c1 < -9 needs c0 > 20.25, fifty-three standard deviations above its own median."""
    c0 = {"prior": "lognormal", "median": 0.1, "sigma": 0.1}
    c1 = {"prior": "uniform", "low": -10.0, "high": -9.0}
    parameters = made({"object": {"c0": c0, "c1": c1, "c2": 0.1}})
    values = parameters.natural(parameters.sample(np.random.default_rng(5), 20))
    assert np.all(values[:, 0] > 20.25)
    assert np.all((values[:, 1] > -2 * np.sqrt(values[:, 0])) & (values[:, 1] <= -9.0))


def test_priors_that_all_but_exclude_one_another_are_refused_when_drawn() -> None:
    c0 = {"prior": "lognormal", "median": 0.1, "sigma": 0.01}
    c1 = {"prior": "normal", "mean": -10.0, "sd": 0.1}
    parameters = made({"object": {"c0": c0, "c1": c1}})
    with pytest.raises(RefusedError, match="c0 and c1"):
        parameters.sample(np.random.default_rng(6), 1)


def test_a_scene_that_the_sensor_forbids_has_no_parameters() -> None:
    with pytest.raises(InvalidInputError):
        made({"background": {"strength": 1.0, "distance_m": 16.0}})


@pytest.mark.parametrize("distance", [1.5, {"prior": "lognormal", "median": 1.5, "sigma": 0.3}])
def test_an_object_stands_before_its_background(distance: Any) -> None:
    """Behind it a dark object could lie anywhere, and nothing would contradict."""
    law = {"prior": "loguniform", "low": 0.02, "high": 20.0}
    wall = {"strength": 0.02, "distance_m": distance}
    scene = parse_scene({"background": wall, "range_m": law})
    parameters = parameters_of(PULSED, scene)
    terms = parameters.terms(np.random.default_rng(6).standard_normal((50, len(parameters))))
    assert terms.background is not None
    np.testing.assert_array_equal(terms.ranges[:, 7], terms.background[:, 1])
    low, high = np.log(terms.ranges[:, 6]), np.log(terms.ranges[:, 7])
    np.testing.assert_allclose(terms.ranges[:, 0], -np.log(high - low), rtol=1e-12)


def test_ranges_behind_a_known_background_are_refused() -> None:
    scene = parse_scene(
        {
            "background": {"strength": 0.02, "distance_m": 1.5},
            "range_m": {"prior": "uniform", "low": 2.0, "high": 3.0},
        }
    )
    with pytest.raises(InvalidInputError) as caught:
        parameters_of(PULSED, scene)
    assert [problem.pointer for problem in caught.value.problems] == ["/range_m"]


def test_a_background_as_near_as_can_be_stated_leaves_ranges_before_it() -> None:
    scene = parse_scene({"background": {"strength": 0.1, "distance_m": 1e-50}})
    parameters = parameters_of(PULSED, scene)
    assert parameters.reach_m == pytest.approx((1e-52, 1e-50), rel=1e-2)
