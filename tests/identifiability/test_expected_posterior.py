"""The predicted spread: the prior's without information, the bound's with much."""

import math
from typing import Any

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.identifiability.before_data import identifiability
from inference.identifiability.expected_posterior import expected_posterior, log_range_spread
from inference.identifiability.experiment import Experiment, information
from inference.posterior.sampling.start import refine
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from tests.posterior.scenes import UNKNOWN_CROSSTALK, sensor_of

BACKGROUND = {
    "strength": {"prior": "lognormal", "median": 0.03, "sigma": 0.5},
    "distance_m": {"prior": "uniform", "low": 2.0, "high": 10.0},
    "shadow": {"c0": 0.05, "c1": 0.01},
}
SCENES: dict[str, dict[str, Any]] = {
    "object": {},
    "crosstalk": {"crosstalk": UNKNOWN_CROSSTALK},
    "background": {"background": BACKGROUND, "object": {"c0": 0.08, "c1": 0.0}},
    "stroke": {"range_m": {"prior": "stroke", "low": 0.05, "high": 5.0}},
    "reference": {"range_m": {"prior": "reference", "low": 0.05, "high": 5.0}},
    "known law": {"range_m": {"prior": "lognormal", "median": 0.5, "sigma": 0.7}},
}
LOG_R = np.log(np.geomspace(0.15, 1.5, 12))


def experiment_of(scene: dict[str, Any], kind: str = "pulsed", snr: float = 1000.0) -> Experiment:
    sensor = sensor_of(kind, snr)
    parameters = parameters_of(sensor, parse_scene(scene))
    return Experiment(sensor, parameters, np.zeros(len(parameters)), LOG_R)


@pytest.mark.parametrize("name", list(SCENES))
def test_noise_without_bound_leaves_the_prior(name: str) -> None:
    found = expected_posterior(experiment_of(SCENES[name], snr=1e-9))
    assert found.sd == pytest.approx(np.ones(found.sd.size), abs=1e-6)
    wide = log_range_spread(experiment_of(SCENES[name]).parameters)
    assert (found.range_sd <= wide * (1 + 1e-12)).all()


def test_a_stated_law_of_the_ranges_counts_once() -> None:
    """Log-normal with 0.7: that is what stands where no reading tells.

    The sensor's domain cuts off the last 1e-6 of it.
    """
    found = expected_posterior(experiment_of(SCENES["known law"], snr=1e-9))
    assert found.range_sd == pytest.approx(0.7, rel=1e-5)


def test_a_range_that_nothing_tells_is_known_as_well_as_from_its_ends() -> None:
    """Evenly spread in log r from 0.05 to 5 m: the width over the root of 12, counted once."""
    found = expected_posterior(experiment_of(SCENES["reference"], snr=1e-9))
    assert found.range_sd == pytest.approx(math.log(100.0) / math.sqrt(12.0), rel=1e-9)


@pytest.mark.parametrize("name", ["object", "crosstalk", "background"])
def test_readings_without_noise_leave_the_bound(name: str) -> None:
    """The prior adds its unit information to 1 / variance: a relative part of variance / 2."""
    experiment = experiment_of(SCENES[name], snr=1e7)
    bounds, found = information(experiment), expected_posterior(experiment)
    exact = parse_scene(SCENES[name] | {"discrepancy": 0})
    foreseen = identifiability(experiment.sensor, exact, np.exp(LOG_R).tolist())
    worst = float(found.sd.max())
    assert worst < 1e-2
    for parameter, sd in foreseen.posterior_sd.items():
        assert sd == pytest.approx(foreseen.sd[parameter], rel=10 * worst**2 + 1e-6)
    assert found.range_sd == pytest.approx(bounds.range_sd, rel=10 * worst**2 + 1e-6)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("name", list(SCENES))
def test_curvature_of_the_collapsed_density(name: str, kind: str) -> None:
    """At noise-free readings the Hessian of the posterior density itself says the same.

    It sees what the linearisation leaves out, which falls with the noise: 3 % are allowed at a
    signal-to-noise ratio of 1e4. The spread of a stroke has a skewed density: 15 %.
    """
    experiment = experiment_of(SCENES[name], kind, 1e4)
    density = collapsed_density(
        experiment.sensor, parse_scene(SCENES[name]), Frames(experiment.readings.mean)
    )
    optimum = refine(density, np.zeros(len(experiment.parameters)))
    assert optimum is not None
    there = Experiment(experiment.sensor, experiment.parameters, optimum.z, LOG_R)
    found = expected_posterior(there)
    wanted = np.linalg.norm(optimum.factor, axis=1)
    of_stroke = np.array(
        [n.startswith("range_m.") for n in experiment.parameters.names], dtype=bool
    )
    assert found.sd[~of_stroke] == pytest.approx(wanted[~of_stroke], rel=0.03)
    assert found.sd[of_stroke] == pytest.approx(wanted[of_stroke], rel=0.15)


def test_spread_of_a_stroke_known_exactly() -> None:
    """n ranges without noise tell the spread w to w / sqrt(2 n), the centre to w / sqrt(n)."""
    experiment = experiment_of(SCENES["stroke"], snr=1e9)
    found = expected_posterior(experiment)
    names = experiment.parameters.names
    law, n = experiment.terms.ranges[0], LOG_R.size
    w = 1 / law[5]
    h = 1e-5 * np.eye(len(names))
    plus, minus = (experiment.parameters.terms(sign * h).ranges for sign in (1, -1))
    for name, change, sd in (
        ("range_m.centre", (plus[:, 4] - minus[:, 4]) / 2e-5, w / math.sqrt(n)),
        ("range_m.spread", (1 / plus[:, 5] - 1 / minus[:, 5]) / 2e-5, w / math.sqrt(2 * n)),
    ):
        j = names.index(name)
        own = sd / change[j]  # in z
        assert found.sd[j] == pytest.approx(own / math.sqrt(1 + own**2), rel=1e-3)


@pytest.mark.parametrize("frames", [2, 200])
def test_one_range_read_often_tells_no_more_of_a_stroke_than_one_range(frames: int) -> None:
    """Of a static object there is one draw from the law, however often it is seen.

    What noise of 1e-4 leaves open of log r is 1e-8 of the variance of the law.
    """
    scene = {
        "object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957},
        "motion": "static",
        "range_m": {"prior": "stroke", "low": 0.2, "high": 2.0},
    }
    sensor = sensor_of("pulsed", 1e6)
    one, many = (
        identifiability(sensor, parse_scene(scene), [0.7] * n).posterior.sd for n in (1, frames)
    )
    assert many == pytest.approx(one, rel=1e-6)


def test_error_of_the_flux() -> None:
    """A smooth error of the flux widens all bounds, more the larger it is; a vanishing one none."""
    scene = {"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}, "crosstalk": UNKNOWN_CROSSTALK}
    ranges = np.geomspace(0.2, 0.4, 24).tolist()
    sensor = sensor_of("pulsed")
    exact = identifiability(sensor, parse_scene(scene | {"discrepancy": 0}), ranges)
    before = exact.information.range_sd
    last = 1.0
    for size, least in ((1e-9, 0.99), (1e-3, 1.0), (0.02, 5.0), (0.07, 20.0)):
        found = identifiability(sensor, parse_scene(scene | {"discrepancy": size}), ranges)
        wider = found.information.range_sd / before
        assert (wider >= 1 - 1e-6).all()
        assert np.median(wider) > max(least, 0.999 * last)
        last = float(np.median(wider))
        assert found.information.rank == exact.information.rank
        assert found.posterior.range_sd == pytest.approx(found.information.range_sd, rel=0.2)
        before_now = found.information.scale_sd
        if size == 1e-9:
            assert wider == pytest.approx(np.ones(24), rel=1e-6)
            assert before_now == pytest.approx(exact.information.scale_sd, rel=1e-6)
    # with the noise gone, what is left of the bound is the error's
    quiet = identifiability(
        sensor_of("pulsed", 1e7), parse_scene(scene | {"discrepancy": 0.07}), ranges
    )
    assert quiet.information.scale_sd == pytest.approx(found.information.scale_sd, rel=0.5)
    assert quiet.information.scale_sd > 1e3 * 1e-4 * exact.information.scale_sd


UNENDING = (
    {"prior": "normal", "mean": 1.0, "sd": 0.3},
    {"prior": "lognormal", "median": 1.0, "sigma": 0.7},
    {"prior": "halfnormal", "sd": 1.0},
)


@pytest.mark.parametrize("law", UNENDING, ids=lambda law: law["prior"])
def test_an_error_of_the_flux_where_ranges_have_no_end(law: dict[str, Any]) -> None:
    """A sine wave sets no end of its own; the error reaches as far as their prior does."""
    scene = parse_scene({"range_m": law, "discrepancy": 0.05})
    found = identifiability(sensor_of("sine_wave"), scene, [0.4, 0.8, 1.2])
    assert np.isfinite(found.posterior.range_sd).all()


def test_a_range_that_is_as_good_as_known() -> None:
    law = {"prior": "normal", "mean": 1.0, "sd": 1e-30}
    found = identifiability(sensor_of("pulsed"), parse_scene({"range_m": law}), [1.0])
    assert found.posterior.range_sd.tolist() == [0.0]


def test_what_cannot_be_foreseen_is_refused() -> None:
    ranges = [0.3, 0.6, 1.2]
    still = parse_scene({"motion": "static", "discrepancy": 0.05})
    with pytest.raises(RefusedError, match="at rest"):
        identifiability(sensor_of("pulsed"), still, [1.0, 1.0])
    nowhere = parse_scene({"object": {"c2": {"prior": "normal", "mean": -1e9, "sd": 1.0}}})
    with pytest.raises(InvalidInputError, match="/scene/object/c2: the prior has no mass"):
        identifiability(sensor_of("pulsed"), nowhere, ranges)
    with pytest.raises(InvalidInputError) as caught:
        identifiability(sensor_of("pulsed"), parse_scene({}), ranges, at={"a/b~c": 1.0})
    assert [problem.pointer for problem in caught.value.problems] == ["/at/a~1b~0c"]


def test_a_known_object_at_rest_has_one_unknown_range() -> None:
    """Frames add up: the bound of the common range falls with the root of their number."""
    known = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
    scene = {"object": known, "motion": "static", "discrepancy": 0}
    one, four = (
        identifiability(sensor_of("pulsed"), parse_scene(scene), [1.0] * n).information.range_sd
        for n in (1, 4)
    )
    assert four == pytest.approx(np.full(4, one[0] / 2), rel=1e-12)
