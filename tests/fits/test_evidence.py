"""Which of several maxima a fit by default answers with, and how wide."""

import dataclasses
import math

import numpy as np
import pytest

from benchmarks.coverage.classes import CLASSES, draw, told
from benchmarks.coverage.paths import PathSet
from benchmarks.random_sets.sets import random_set
from inference.estimate import estimate
from inference.estimates import TechniqueResult
from inference.fits.answer.erring_search import judged
from inference.fits.answer.ranges import WITHIN
from inference.fits.answer.report import describe
from inference.fits.answer.rivals import rivals_of
from inference.fits.likelihood.erring import Erring, end_from, erring_maxima, softened
from inference.fits.likelihood.evidence import evidence_of
from inference.fits.likelihood.frame_modes import frame_modes, nearest_modes
from inference.fits.likelihood.law_mode import LawMode, is_glossy, law_modes, place_of
from inference.fits.likelihood.multistart import find_starts
from inference.fits.likelihood.other_starts import other_crosstalk
from inference.fits.likelihood.problem import FitProblem, fit_problem
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of
from tests.simulator.test_joint import CALIBRATION, JOINT, PRIOR

# errors so small that the frames tell everything
SMALL = {"flux": 1e-6, "range_m": 1e-8, "shadow": 0.0}


def fitted(one: PathSet) -> TechniqueResult:
    (result,) = estimate(one.sensor, parse_scene(one.scene), one.frames, ["joint_fit"]).results
    assert result.fit is not None
    assert not result.fit["misfit"]
    return result


def off(one: PathSet, result: TechniqueResult) -> float:
    """Largest distance from the truth in standard deviations, of ranges and what is identified."""
    ranges = (result.range_m - one.range_m) / result.sd_m
    ranges[result.near_fold] = np.nan
    worst = float(np.nanmax(np.abs(ranges)))
    for name, entry in (result.parameters or {}).items():
        if entry["status"] == "identified" and name in one.parameters:
            worst = max(worst, abs(entry["value"] - one.parameters[name]) / entry["sd"])
    return worst


@pytest.mark.parametrize(
    ("seed", "number"), [(27112026, 2), pytest.param(771204993, 97, marks=pytest.mark.thorough)]
)
def test_a_narrow_maximum_is_no_answer(seed: int, number: int) -> None:
    """Ranges were 58 and 23 sd off, and crosstalk 4,991 and 599 sd, `identified` and no misfit.

    Nine frames at rest in the dark told crosstalk to the noise of one reading: the fit was better
    by a deviance of 9, and its widths told that it was less probable all the same. Of the other set
    no maximum was found but such narrow ones.
    """
    one = random_set(seed, number)
    assert off(one, fitted(one)) < 4.0


@pytest.mark.thorough
def test_crosstalk_reaches_to_where_a_frame_in_the_dark_is_bright() -> None:
    """Its w2 was 6.4 sd off: the darkest frame had gone to the end of the ranges, and stayed there.

    Where crosstalk is less than that frame reads, nothing leads a range back from there.
    """
    one = random_set(771204993, 8)
    result = fitted(one)
    assert result.parameters is not None
    entry = result.parameters["crosstalk.w2"]
    assert abs(entry["value"] - one.parameters["crosstalk.w2"]) < 3.0 * entry["sd"]


def test_a_glossy_object_before_crosstalk_is_told() -> None:
    """Ranges were 21 % short and 4.8 sd off, by priors of a diffuse object."""
    one = draw(CLASSES["crosstalk"], 19)
    scene = parse_scene(told(one, "default"))
    (result,) = estimate(one.sensor, scene, one.frames, ["joint_fit"]).results
    away = (result.range_m - one.range_m) / result.sd_m
    assert np.nanmax(np.abs(away)) < 2.0
    assert abs(np.nanmedian(result.range_m / one.range_m) - 1.0) < 0.1


def problem_of(scene: dict[str, object], kind: str = "pulsed") -> FitProblem:
    sensor = sensor_of(kind, 1e5)
    frames = data(sensor, {"discrepancy": 0, "crosstalk": [0.002, 0.01]}, 14).frames
    return fit_problem(sensor, parse_scene(scene), frames)


@pytest.fixture(scope="module")
def told_by_frames() -> Erring:
    """A maximum that owes next to nothing to its priors."""
    problem = problem_of({"discrepancy": SMALL, "crosstalk": UNKNOWN_CROSSTALK})
    return erring_maxima(problem, find_starts(problem, softened(problem)))[0]


@pytest.mark.parametrize("wider", [2.0, 5.0])
def test_the_evidence_of_a_wider_prior_is_less_by_its_width(
    told_by_frames: Erring, wider: float
) -> None:
    """The mass of a normal prior where the likelihood is, to its curvature over the likelihood's.

    The frames tell the object to 1e-3 of its prior's standard deviations or better.
    """
    d = told_by_frames.x.size
    broad = LawMode(np.zeros(d), wider * np.eye(d), 2.0 * d * math.log(wider), 0)
    problem = problem_of({"discrepancy": SMALL, "crosstalk": UNKNOWN_CROSSTALK})
    at = end_from(problem, told_by_frames)
    there = end_from(dataclasses.replace(problem, mode=broad), told_by_frames)
    z = problem.parameters.standard(problem.natural(at.x)[None, np.argsort(problem.columns)])[0]
    lost = 2.0 * d * math.log(wider) + float(z @ z) * (1.0 / wider**2 - 1.0)
    assert evidence_of(at) - evidence_of(there) == pytest.approx(lost, abs=0.02)


def test_the_priors_as_a_mode_have_their_evidence(told_by_frames: Erring) -> None:
    d = told_by_frames.x.size
    mode = LawMode(np.zeros(d), np.eye(d), 0.0, 0)
    as_mode = dataclasses.replace(
        told_by_frames, clean=dataclasses.replace(told_by_frames.clean, mode=mode)
    )
    assert evidence_of(as_mode) == pytest.approx(evidence_of(told_by_frames), abs=1e-9)


def test_an_unknown_that_is_held_has_the_density_of_its_marginal(told_by_frames: Erring) -> None:
    """At its top a normal law is 1 / sd of what it holds as a whole."""
    sds = np.linalg.norm(told_by_frames.whole.factors[0], axis=1)
    for j, sd in enumerate(sds):
        more = evidence_of(told_by_frames, j) - evidence_of(told_by_frames)
        assert more == pytest.approx(-2.0 * math.log(sd), abs=1e-6)


@pytest.mark.parametrize("ratio", [1e-3, 0.9])
def test_the_interval_of_a_size_reaches_to_its_farther_end(
    told_by_frames: Erring, ratio: float
) -> None:
    """Of large objects c0 was up to 6.9 standard deviations off, and in 64 % of 90 % intervals.

    A size that is told to a factor e has 5.2 times itself as the upper end of that interval.
    """
    top = told_by_frames
    linear = describe(top.clean, top, top.facts)
    c0, c2 = (linear[name]["sd"] / linear[name]["value"] for name in ("object.c0", "object.c2"))
    for name, own in (("object.c0", c0), ("object.c2", c2)):
        found = describe(top.clean, top, top.facts, wider=ratio / own)
        wanted = math.expm1(1.645 * ratio) / 1.645
        assert found[name]["sd"] == pytest.approx(wanted * found[name]["value"], rel=1e-3)
        light = found["crosstalk.w2"]["sd"] / linear["crosstalk.w2"]["sd"]
        assert light == pytest.approx(ratio / own, rel=1e-6)


def test_what_fits_as_well_is_a_rival_however_large_its_errors_could_have_been(
    told_by_frames: Erring,
) -> None:
    """Of 105 of the random sets log determinants decided for a shadow a hundred times too large."""
    problem = problem_of({"discrepancy": SMALL, "crosstalk": UNKNOWN_CROSSTALK})
    top, decided = told_by_frames, told_by_frames.deviance + 9.0
    larger = dataclasses.replace(top, deviance=top.deviance + 50.0)
    worse = dataclasses.replace(larger, chi_square=top.chi_square + 0.1)
    far = dataclasses.replace(larger, x=top.x + 20.0)  # of logarithms: far out in the priors
    near = dataclasses.replace(worse, deviance=top.deviance + 5.0)
    first, second = rivals_of(problem, [top, larger, worse, far, near], decided)
    assert (first.x is top.x, first.deviance) == (True, top.deviance)
    assert second is near
    (better,) = rivals_of(problem, [worse, top], worse.deviance + 9.0)
    assert better.deviance == top.deviance


def test_an_object_of_which_nothing_is_said_has_a_glossy_mode() -> None:
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK})
    parameters = parameters_of(sensor_of("pulsed"), scene)
    diffuse, glossy = law_modes(scene, parameters)
    assert diffuse is None
    assert glossy is not None
    assert is_glossy(glossy)
    assert place_of(glossy) == place_of(diffuse)
    natural = dict(
        zip(parameters.names, parameters.natural(glossy.centre[None])[0].tolist(), strict=True)
    )
    middle = dict(zip(parameters.names, parameters.natural(np.zeros((1, 5)))[0], strict=True))
    assert natural["object.c0"] == pytest.approx(math.exp(4.0) * middle["object.c0"])
    assert natural["object.c2"] == pytest.approx(0.25 * middle["object.c2"])
    assert natural["crosstalk.w2"] == middle["crosstalk.w2"]


@pytest.mark.parametrize(
    "said",
    [
        {"discrepancy": 0},
        {"object": {"c0": {"prior": "lognormal", "median": 0.1, "sigma": 2.0}}},
        PRIOR | {"joint": JOINT, "calibration": CALIBRATION},
    ],
)
def test_what_is_said_of_an_object_says_whether_it_is_glossy(said: dict[str, object]) -> None:
    scene = parse_scene(said)
    modes = law_modes(scene, parameters_of(sensor_of("pulsed"), scene))
    assert not any(is_glossy(mode) for mode in modes)


def test_each_mode_of_a_law_of_crosstalk_has_a_glossy_one_beside_it() -> None:
    """What is learnt of crosstalk says nothing of the next object."""
    modes = [
        {"weight": 0.5, "mean": [0.1, 0.4], "covariance": [[0.01, 0.0], [0.0, 0.01]]},
        {"weight": 0.5, "mean": [0.3, 0.5], "covariance": [[0.01, 0.0], [0.0, 0.01]]},
    ]
    names = ["crosstalk.w1", "crosstalk.w2"]
    scene = parse_scene(
        {
            "crosstalk": [{"prior": "halfnormal", "sd": 1.0}] * 2,
            "joint": {"unknowns": names, "modes": modes},
        }
    )
    found = law_modes(scene, parameters_of(sensor_of("pulsed"), scene))
    assert [place_of(mode) for mode in found] == [0, 1, 0, 1]
    assert [is_glossy(mode) for mode in found] == [False, False, True, True]


def test_a_diffuse_object_has_to_explain_the_frames_too(told_by_frames: Erring) -> None:
    d = told_by_frames.x.size
    mode = LawMode(np.zeros(d), np.eye(d), 0.0, 0, glossy=True)
    other = LawMode(np.zeros(d), np.eye(d), 0.0, 1)

    def of(mode: LawMode | None) -> Erring:
        return dataclasses.replace(
            told_by_frames, clean=dataclasses.replace(told_by_frames.clean, mode=mode)
        )

    glossy, elsewhere, diffuse = of(mode), of(other), of(None)
    assert judged([glossy, elsewhere, diffuse]) == [glossy, diffuse]
    assert judged([diffuse, glossy]) == [diffuse]
    assert judged([glossy, elsewhere]) == [glossy]


def test_a_rival_widens_by_its_own_width_as_far_as_its_excess_leaves(
    told_by_frames: Erring,
) -> None:
    """One at the same place and twice as wide: the 95 % of both together are its own."""
    top, whole = told_by_frames, told_by_frames.whole
    wider = dataclasses.replace(whole, jacobian=0.5 * whole.jacobian, errors=0.5 * whole.errors)

    def sd_beside(excess: float) -> np.ndarray:
        rival = dataclasses.replace(top, whole=wider, deviance=top.deviance + excess)
        found = describe(top.clean, top, top.facts, whole=whole, maxima=[rival])
        return np.array([entry["sd"] for entry in found.values()])

    np.testing.assert_allclose(sd_beside(0.0), 2.0 * sd_beside(WITHIN), rtol=0.01)
    half = 0.75 * WITHIN  # half of the standard deviations of 95 % are left: as wide as the best
    np.testing.assert_allclose(sd_beside(half), sd_beside(WITHIN), rtol=0.01)


def test_a_range_in_the_dark_goes_to_where_a_frame_is_explained() -> None:
    sensor = sensor_of("pulsed")
    problem = problem_of({"crosstalk": UNKNOWN_CROSSTALK})
    x = problem.coordinates(np.array([[*OBJECT.values(), 0.002, 0.01]]))[0]
    modes = frame_modes(problem, x)[0][:, 0]
    dark = np.full(modes.size, math.log(sensor.max_range_m))
    np.testing.assert_array_equal(nearest_modes(problem, x, dark), modes)
    np.testing.assert_array_equal(nearest_modes(problem, x, modes + 0.1), modes + 0.1)
    none = np.where(np.arange(modes.size) == 3, np.nan, modes)
    kept = np.isfinite(nearest_modes(problem, x, none))
    np.testing.assert_array_equal(kept, np.isfinite(none))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_some_starts_leave_every_frame_light_whatever_the_sign_of_crosstalk(sign: float) -> None:
    sensor = sensor_of("pulsed")
    frames = data(sensor, {"discrepancy": 0, "crosstalk": [0.0, sign * 0.05]}, 14).frames
    problem = fit_problem(sensor, parse_scene({"crosstalk": UNKNOWN_CROSSTALK}), frames)
    starts = other_crosstalk(problem, softened(problem)[0])
    column = problem.names.index("crosstalk.w2")
    behind = np.array([problem.natural(start.x)[column] for start in starts])
    assert np.count_nonzero(behind < frames.readings[:, 1].min()) >= 3
    assert len(starts) == 4
