"""An object at rest at an unknown range before unknown crosstalk, drawn from its prior."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special, stats

import hybridtof
from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.static import with_common_range
from inference.frame.arguments import scene_of
from inference.frame.blocks import Block, Frame
from inference.frame.gaussian import log_top
from inference.frame.light_of_vectors import light_of_vectors
from inference.frame.log_density import log_density
from inference.frame.range_prior import log_range_density
from inference.posterior.infer import infer
from inference.posterior.sampling import from_the_prior
from inference.posterior.sampling.from_the_prior import AtRest, at_rest, drawn_from_the_prior
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.sampling.test_light_at_rest import C0, C2, WIDE, units
from tests.posterior.sampling.test_light_at_rest import scene_of as scene
from tests.posterior.scenes import KINDS, data, sensor_of

Array = NDArray[np.float64]

REACH = (0.2, 3.0)
LOOSE: dict[str, Any] = {"shot": 2e-4, "relative": 0.1}
LATE = {"pulsed": "timing_offset_s", "sine_wave": "phase_offset_rad"}
DELAYS: dict[str, dict[str, Any]] = {
    "none": {"pulsed": None, "sine_wave": None},
    "known": {"pulsed": -3e-9, "sine_wave": 0.4},
    "unknown": {
        "pulsed": {"prior": "normal", "mean": 0.0, "sd": 3e-9},
        "sine_wave": {"prior": "normal", "mean": 0.4, "sd": 0.2},
    },
}
HALF: dict[str, Any] = {"prior": "halfnormal", "sd": 0.05}
NORMAL: dict[str, Any] = {"prior": "normal", "mean": 0.0, "sd": 0.05}
PRIORS: dict[str, list[dict[str, Any]]] = {
    "mixed": [HALF, NORMAL],
    "between": [
        {"prior": "uniform", "low": 0.0, "high": 0.1},
        {"prior": "truncated_normal", "mean": 0.05, "sd": 0.02, "low": 0.02, "high": 0.3},
    ],
    "log": [
        {"prior": "loguniform", "low": 1e-3, "high": 0.2},
        {"prior": "lognormal", "median": 0.04, "sigma": 0.5},
    ],
}


def density_of(
    kind: str,
    law: str,
    change: dict[str, Any] | None = None,
    snr: float = 5.0,
    late: Any = None,
    **columns: Any,
) -> CollapsedDensity:
    sensor = sensor_of(kind, snr, **(LOOSE if snr < 1e3 else {}))
    if late is not None:
        sensor = parse_sensor({**sensor.model_dump(exclude_none=True), LATE[kind]: late})
    names = ("w1", "w2") if kind == "pulsed" else ("i", "q")
    read = sensor.noise.read[0] * np.random.default_rng(1).standard_normal((2, 4))
    readings = dict(zip(names, np.array([[0.04], [0.06]]) + read, strict=True))
    frames = hybridtof.frames_from_columns(sensor, {**readings, **columns})
    stated = {**scene("pulsed"), "crosstalk": PRIORS[law], **(change or {})}
    stated["range_m"] = {"prior": "loguniform", "low": REACH[0], "high": REACH[1]}
    return with_common_range(collapsed_density(sensor, parse_scene(stated), frames))


def rest_of(density: CollapsedDensity) -> AtRest:
    rest = at_rest(density)
    assert rest is not None
    return rest


@pytest.mark.parametrize("delay", list(DELAYS))
@pytest.mark.parametrize("kind", list(KINDS))
def test_likelihood_and_light_are_those_of_the_kernels(kind: str, delay: str) -> None:
    density = density_of(kind, "mixed", late=DELAYS[delay][kind], gain=[2.0] * 4)
    rest = rest_of(density)
    z = np.random.default_rng(1).standard_normal((20, len(density.parameters)))
    r = np.exp(np.random.default_rng(2).uniform(math.log(REACH[0]), math.log(REACH[1]), 20))
    terms = density.parameters.terms(z)
    rows = density.rows(terms)
    light = light_of_vectors(rows, r, rest.gain, density.instrument)
    assert terms.crosstalk is not None
    found = rest.log_likelihood(light + terms.crosstalk, light)
    for i in range(20):
        of, u = scene_of(rows, density.instrument, i), math.log(r[i])
        each = [log_density(u, Block(Frame(*frame.tolist()), None), of) for frame in density.frames]
        wanted = sum(each) - 4 * log_range_density(r[i], u, of.range_prior)
        wanted += 4 * log_top(density.instrument.read)
        assert found[i] == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("law", list(PRIORS))
@pytest.mark.parametrize("kind", list(KINDS))
def test_draws_follow_the_posterior_of_unknowns_and_range(kind: str, law: str) -> None:
    """Ten moments of a case, all within 5 standard errors: 1e-4 in all of them."""
    density = density_of(kind, law, snr=0.7)
    rest = rest_of(density)
    draws, calls = drawn_from_the_prior(rest, np.random.default_rng(5), 1000)
    assert draws is not None
    assert draws.worth >= 1000
    assert calls == len(draws.z) < 10_000
    rng, n = np.random.default_rng(6), 300_000
    z = rng.standard_normal((n, draws.z.shape[1]))
    r = np.exp(rng.uniform(math.log(REACH[0]), math.log(REACH[1]), n))
    terms = density.parameters.terms(z)
    light = light_of_vectors(density.rows(terms), r, 1.0, density.instrument)
    assert terms.crosstalk is not None
    weight = special.softmax(rest.log_likelihood(light + terms.crosstalk, light))
    size = 1.0 / float(weight @ weight)
    assert size > 300
    for power in (1, 2):
        wanted, found = weight @ z**power, draws.weights @ draws.z**power
        spread = np.sqrt(weight @ (z**power - wanted) ** 2)
        assert np.all(np.abs(found - wanted) < 5 * spread * math.sqrt(1 / size + 1 / draws.ess))


@pytest.mark.parametrize("kind", list(KINDS))
def test_their_evidence_is_that_of_the_density_with_the_range_integrated_out(kind: str) -> None:
    """Within 5 standard errors: a false alarm in a million."""
    density = density_of(kind, "mixed", snr=0.1)
    draws, _ = drawn_from_the_prior(rest_of(density), np.random.default_rng(5), 400)
    assert draws is not None
    z = np.random.default_rng(6).standard_normal((1000, draws.z.shape[1]))
    each = np.exp(density.log_likelihood(z) - draws.log_density.max())
    error = float(each.std() / each.mean()) / math.sqrt(len(each))
    assert error < 0.1
    norm = 0.5 * z.shape[1] * math.log(2 * math.pi) + float(draws.log_density.max())
    found = draws.log_evidence - norm
    assert found == pytest.approx(math.log(each.mean()), abs=5 * math.hypot(error, 0.01))


@pytest.mark.parametrize(
    ("change", "columns"),
    [
        ({}, {"known_range_m": [0.4] * 4, "known_range_sd_m": [0.01] * 4}),
        ({}, {"object_present": [True, True, True, False]}),
        ({}, {"gain": [1.0, 1.0, 1.0, 2.0]}),
        ({"crosstalk": [0.01, HALF]}, {}),
        ({"background": {"strength": PRIORS["log"][0], "distance_m": 3.0}}, {}),
    ],
    ids=["known range", "empty frame", "two gains", "known crosstalk", "background"],
)
def test_frames_that_may_tell_more_than_two_numbers_are_not_drawn_so(
    change: dict[str, Any], columns: Any
) -> None:
    assert at_rest(density_of("pulsed", "mixed", change, **columns)) is None


def test_where_the_prior_is_far_wider_than_the_posterior_nothing_is_drawn() -> None:
    narrow = {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 1e-6}] * 2}
    rest = rest_of(density_of("pulsed", "mixed", narrow, snr=1e4))
    assert drawn_from_the_prior(rest, np.random.default_rng(1), 400) == (None, 0)


def test_what_draws_from_the_prior_hardly_meet_is_told_by_their_weights() -> None:
    """Crosstalk that may be next to nothing: then the object alone explains all, at few places."""
    spread = {"prior": "loguniform", "low": 1e-6, "high": 0.1}
    rest = rest_of(density_of("pulsed", "mixed", {"crosstalk": [spread] * 2}, snr=1e4))
    for seed in range(5):
        assert drawn_from_the_prior(rest, np.random.default_rng(seed), 100) == (None, 0)


def test_small_weights_are_made_even_and_every_weight_stays_in_the_mean() -> None:
    rng = np.random.default_rng(1)
    weights = special.softmax(2.0 * rng.standard_normal(2000))
    total, tries = np.zeros(2000), 400
    for _ in range(tries):
        kept, now = from_the_prior._evened(weights, 200, rng)
        assert len(kept) == 200 == len(np.unique(kept))
        assert now.sum() == pytest.approx(1.0, abs=1e-12)
        total[kept] += now
    least = 1 / 200
    assert now.max() == pytest.approx(weights.max(), rel=0.01)
    # of a draw that is kept with the probability w / c the mean errs by sqrt(w c / tries)
    assert np.all(np.abs(total / tries - weights) < 6 * np.sqrt(weights * least / tries) + 1e-12)


def exact(kind: str, readings: Array, noise: float) -> tuple[Array, Array]:
    """Return means of both crosstalks and of the range, and standard deviations, shape (3,) each.

    Crosstalk is integrated out of prior draws in closed form.
    """
    rng, n = np.random.default_rng(3), 1_000_000
    c0, c2 = (m * np.exp(s * rng.standard_normal(n)) for m, s in (C0, C2))
    r = np.exp(rng.uniform(math.log(REACH[0]), math.log(REACH[1]), n))
    left = readings - (c0 * c2 / (r**2 * (r**2 + c0)))[:, None] * units(kind, r)
    wide = math.hypot(WIDE, noise)
    middle, sd = left * (WIDE / wide) ** 2, WIDE * noise / wide
    log_weight = stats.norm.logpdf(left, scale=wide).sum(axis=1)
    mean, square = middle, middle**2 + sd**2
    if kind == "pulsed":  # half normal: the normal law is cut at zero
        inside = np.all(middle > -8 * sd, axis=1)
        standard = np.clip(middle / sd, -8.0, None)
        log_tail = stats.norm.logcdf(standard)
        hazard = np.exp(stats.norm.logpdf(standard) - log_tail)
        log_weight = np.where(inside, log_weight + log_tail.sum(axis=1), -np.inf)
        mean = middle + sd * hazard
        square = middle**2 + sd**2 + middle * sd * hazard
    weight = special.softmax(log_weight)
    first = weight @ np.column_stack([mean, r])
    second = weight @ np.column_stack([square, r**2])
    return first, np.sqrt(second - first**2)


@pytest.mark.parametrize("method", ["auto", "emcee"])
@pytest.mark.parametrize("kind", list(KINDS))
def test_an_answer_is_as_by_direct_integration(kind: str, method: Any) -> None:
    """Three means and standard deviations of two seeds: 1e-5 of a false alarm.

    By maps and by walkers sine waves did not converge in 20 s.
    """
    sensor = sensor_of(kind, snr=1000.0)
    truth = {"object": {"c0": 0.1, "c1": 0.0, "c2": 0.1}, "crosstalk": [0.004, 0.02]}
    frames = data(sensor, truth, frames=10, span=(0.6, 0.6 * (1 + 1e-12))).frames
    names = ("w1", "w2") if kind == "pulsed" else ("i", "q")
    wanted, wide = exact(kind, frames.readings.mean(axis=0), sensor.noise.read[0] / math.sqrt(10))
    stated = {**scene(kind), "range_m": {"prior": "loguniform", "low": 0.2, "high": 3.0}}
    for seed in (1, 2):
        settings = SamplerSettings(method=method, seed=seed, max_seconds=5)
        answer = infer(sensor, parse_scene(stated), frames, settings)
        assert answer.verdict.converged
        crosstalk = [answer.parameters[f"crosstalk.{name}"] for name in names]
        found = np.array([*(one.mean for one in crosstalk), answer.range_m.mean[0]])
        sd = np.array([*(one.sd for one in crosstalk), answer.range_m.sd[0]])
        # of 1000 draws of a range; the reference adds a hundredth at most
        error = np.array([*(one.mcse_mean for one in crosstalk), 0.04 * wide[2]])
        assert np.all(np.abs(found - wanted) < 5 * np.hypot(error, 0.01 * wide))
        np.testing.assert_allclose(sd, wide, rtol=0.2)
