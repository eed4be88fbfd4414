"""What an answer owes to the default priors of the object, which are those of a diffuse one."""

import functools
import math
from typing import Any

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from benchmarks.coverage.classes import CLASSES, DataSet, draw
from inference.density.collapsed import CollapsedDensity
from inference.identifiability.status import Identifiability
from inference.posterior import fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.criticism.glossy_object import GlossyObject, glossy_object
from inference.posterior.criticism.prior_sensitivity import mark_sensitive
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.stage import Weighted
from simulator.catalogue import plate_scene
from simulator.optics.appendix_b import simulate
from simulator.scene import parse_scene

Array = NDArray[np.float64]

NAMES = ("object.c0", "object.c1", "object.c2")
DIFFUSE = {
    "c0": {"prior": "lognormal", "median": 0.1, "sigma": 2.0},
    "c2": {"prior": "lognormal", "median": 0.1, "sigma": 1.0},
}
GLOSSY = {
    "c0": {"prior": "lognormal", "median": 0.1 * math.exp(4.0), "sigma": 2.0},
    "c2": {"prior": "lognormal", "median": 0.1 / 4, "sigma": 1.0},
}
LEARNT = {"unknowns": ["object.c0"], "modes": [{"weight": 1, "mean": [0.1], "covariance": [[0.1]]}]}
COUNT = 40_000
SLOPE = np.array([0.5, 0.0, 0.25])


def _found(mean: Array, sd: Array, scene: dict[str, Any]) -> GlossyObject:
    """Draws of the object whose posterior is normal, and of three ranges that follow them."""
    z = mean + sd * np.random.default_rng(1).standard_normal((COUNT, 3))
    log_r = (z @ SLOPE)[:, None] + np.array([0.0, 1.0, np.nan])
    found = glossy_object(parse_scene(scene), NAMES, z, log_r)
    assert found is not None
    return found


def _log_evidence(mean: Array, sd: Array, prior: Array) -> float:
    """Of the likelihood that makes a normal posterior of a standard normal prior, by a prior of
    another mean: by hand, up to a constant of the likelihood."""
    precision = 1 / sd**2 - 1
    middle = mean / sd**2 / precision
    return float(np.sum(scipy.stats.norm.logpdf(middle, prior, np.sqrt(1 + 1 / precision))))


@pytest.mark.parametrize(
    ("mean", "sd"),
    [
        ([1.0, 0.0, -0.5], [0.3, 0.9, 0.5]),
        ([-1.5, 0.0, 0.5], [0.4, 0.9, 0.7]),
        ([0.0, 0.0, 0.0], [0.05, 0.5, 0.9]),
        ([1.2, -1.0, -1.4], [0.8, 0.9, 0.2]),
    ],
)
@pytest.mark.parametrize("told", [{}, {"c2": {"prior": "halfnormal", "sd": 1.0}}])
def test_a_normal_posterior_is_mixed_with_that_of_the_other_prior(
    mean: list[float], sd: list[float], told: dict[str, Any]
) -> None:
    """Five standard errors of covariances of so many draws. A prior of c2 that is stated stands."""
    a = np.array([2.0, 0.0, 0.0 if told else -math.log(4.0)])
    middle, spread = np.array(mean), np.array(sd)
    found = _found(middle, spread, {"object": told})
    odds = _log_evidence(middle, spread, a) - _log_evidence(middle, spread, np.zeros(3))
    probability = scipy.special.expit(odds)
    error = 5 / math.sqrt(COUNT) * float(np.linalg.norm(a * spread))
    assert found.probability == pytest.approx(probability, abs=error)
    # by the other prior means are those of middles weighted by their precisions
    assert found.of_z[:, 0] == pytest.approx(probability * spread**2 * a, abs=4 * error)
    assert found.of_log_r[:2, 0] == pytest.approx(SLOPE @ found.of_z[:, 0])
    assert np.all(found.of_log_r[2] == 0.0)
    # the variance of a mixture, beside that of its parts: p (1 - p) times the distance squared
    apart = found.of_z[:, 0] / found.probability
    between = found.probability * (1 - found.probability) * apart**2
    assert found.of_z[:, 1] ** 2 == pytest.approx(between)


def _rows(found: GlossyObject) -> dict[str, Identifiability]:
    rows = tuple(Identifiability(n, "identified", 0.9, "why") for n in (*NAMES, "range_m"))
    return {row.parameter: row for row in mark_sensitive(NAMES, rows, found.open)}


def test_what_hangs_on_whether_it_is_glossy_says_so_and_is_weak_at_best() -> None:
    """c0 moves by twice its standard deviation of 0.9, and the scale with it; c2 by 0.3 of 0.2."""
    found = _found(np.array([0.9, 0.0, -0.5]), np.array([0.9, 0.9, 0.2]), {})
    assert found.moves.parameters == pytest.approx([1.8, 0.0, -0.28], abs=0.05)
    by_z = found.moves.parameters
    assert found.moves.scale == pytest.approx(by_z @ (SLOPE * [0.9, 0.9, 0.2]) / 0.4528, 0.02)
    rows = _rows(found)
    assert [rows[name].status for name in NAMES] == ["weak", "identified", "identified"]
    assert rows["range_m"].status == "weak"
    assert f"object glossy (probability {found.probability:.0%})" in rows["range_m"].reason
    assert "move by 1.8 standard deviations of what was drawn" in rows["object.c0"].reason
    assert rows["object.c1"].reason == "why"


def test_nothing_hangs_on_what_is_all_but_certain() -> None:
    found = _found(np.array([-2.5, 0.0, 1.0]), np.array([0.6, 0.9, 0.9]), {})
    assert found.probability < 0.05
    assert abs(found.moves.parameters[0]) > 1.0
    assert found.open is None
    assert {row.status for row in _rows(found).values()} == {"identified"}


def test_what_the_readings_tell_stays_where_it_is() -> None:
    found = _found(np.array([1.0, 0.0, 0.0]), np.full(3, 1e-3), {})
    assert np.all(np.abs(found.of_log_r) < 1e-5)
    assert np.all(np.abs(found.of_z) < 1e-5)


@pytest.mark.parametrize(
    "scene",
    [
        {"object": {"c0": 0.05}},
        {"object": {"c0": DIFFUSE["c0"]}},
        {"object": {"c0": DIFFUSE["c0"]}, "joint": LEARNT},
        {"discrepancy": 0},
    ],
)
def test_what_is_stated_means_what_it_says(scene: dict[str, Any]) -> None:
    z = np.random.default_rng(1).standard_normal((100, 3))
    assert glossy_object(parse_scene(scene), NAMES, z, z) is None
    assert glossy_object(parse_scene({}), NAMES, z, z) is not None
    assert glossy_object(parse_scene({"discrepancy": 0.05}), NAMES, z, z) is not None
    assert glossy_object(parse_scene({}), NAMES, z, np.full((100, 3), np.nan)) is None


def test_glossy_plates_are_so_much_larger_and_weaker() -> None:
    """c0 of Appendix B's large glossy plates is rounding noise around infinity: of the median
    nothing but that they are the larger ones counts."""
    sizes = ("W01H01", "W02H02", "W04H04", "W08H08", "W16H16", "W01H16", "W02H08")
    logs = []
    for material in ("R00", "R01"):
        scenes = [plate_scene(f"{size}{material}T00") for size in sizes]
        fits = [row.fit for row in simulate("pulsed", converged=True, scenes=scenes)]
        logs.append(np.log([(fit.c0 if fit.c0 > 0 else np.inf, fit.c2) for fit in fits]))
    apart = np.median(logs[1] - logs[0], axis=0)
    # means of uncorrelated draws of unit variance move by the difference itself
    z = math.sqrt(2.0) * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = glossy_object(parse_scene({}), NAMES, np.concatenate([z, -z]), np.zeros((4, 1)))
    assert found is not None
    a = found.of_z[:, 0] / found.probability
    assert apart[0] == pytest.approx(2.0 * a[0], abs=0.5)  # sigma of the default prior of c0
    assert apart[1] == pytest.approx(1.0 * a[2], abs=0.2)


@functools.cache
def _glossy_plate() -> DataSet:
    """Of 20 by 80 cm, behind unknown crosstalk: its c0 is told by its prior alone."""
    return draw(CLASSES["crosstalk"], 22)


@functools.cache
def _answer(told: str) -> tuple[Posterior, float]:
    """By importance draws of the exact model: the answer, and the log evidence."""
    data, settings = _glossy_plate(), SamplerSettings(method="auto", seed=1)
    thing = {"default": {}, "diffuse": {"object": DIFFUSE}, "glossy": {"object": GLOSSY}}[told]
    job = fold.prepare(data.sensor, parse_scene({**data.terms, **thing}), data.frames, settings)
    checkpoint = fold.start(job)
    while tasks := fold.tasks(job, checkpoint):
        checkpoint = fold.merge(job, checkpoint, [fold.run(task) for task in tasks])
    assert isinstance(checkpoint.stage, Weighted)
    assert type(job.density()) is CollapsedDensity
    posterior = fold.summarise(job, checkpoint, 0.0, 0.0)
    return posterior, checkpoint.stage.draws.log_evidence


@pytest.mark.thorough
def test_an_answer_is_near_the_mixture_of_both_priors_asked_apart() -> None:
    """To first order: laws are not normal, and draws in the tail tell how probable the other one
    is; of what is between the two answers, 1.6 standard deviations, four tenths are allowed."""
    answers = [_answer(told) for told in ("diffuse", "glossy", "default")]
    logs = [np.log(each[0].draws.range_m).mean(axis=-1) for each in answers]
    first, second, found = (each.mean() for each in logs)
    apart, share = second - first, scipy.special.expit(answers[1][1] - answers[0][1])
    assert apart > 1.1 * logs[0].std()
    assert found - first == pytest.approx(share * apart, abs=0.4 * apart)
    # it is the scene's part of the error, not the model's
    wide, narrow = answers[2][0].range_m, answers[0][0].range_m
    of = wide.sd_parts.scene**2 - narrow.sd_parts.scene**2
    assert np.median(of / (wide.sd**2 - narrow.sd**2)) > 0.5
    assert answers[2][0].draws.widened
    assert not answers[0][0].draws.widened
    said = ["object glossy" in row.reason for row in answers[2][0].identifiability]
    assert any(said)
    assert not any("object glossy" in row.reason for row in answers[0][0].identifiability)


def test_a_glossy_plate_is_held_that_the_priors_of_a_diffuse_one_lose() -> None:
    true = _glossy_plate().range_m
    default, diffuse = (_answer(told)[0].range_m for told in ("default", "diffuse"))
    assert np.mean((default.q05 <= true) & (true <= default.q95)) > 0.85
    assert np.mean((diffuse.q05 <= true) & (true <= diffuse.q95)) < 0.5
