"""What frames alone leave open is answered with the priors of the scene, and says so."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from inference.estimate import estimate
from inference.estimates import Estimates
from inference.fits.answer import likelihood_answer as likelihood
from inference.fits.answer.determined import LeftOpenError
from inference.fits.answer.likelihood_answer import likelihood_answer
from inference.fits.answer.model_checks import model_checks
from inference.fits.answer.report import disputed
from inference.fits.likelihood import integrated, other_places
from inference.fits.likelihood import prior_maxima as maxima
from inference.fits.likelihood.erring import Erring, end_of
from inference.fits.likelihood.erring_climb import begun, climbed
from inference.fits.likelihood.erring_point import standard
from inference.fits.likelihood.frame_modes import frame_modes
from inference.fits.likelihood.integrated import integrated_deviance, with_integrated_first
from inference.fits.likelihood.maximum import Maximum
from inference.fits.likelihood.multistart import find_maxima, find_near
from inference.fits.likelihood.other_places import beyond_walls
from inference.fits.likelihood.polish import polish
from inference.fits.likelihood.prior_maxima import polished, prior_maxima
from inference.fits.likelihood.problem import FitProblem, fit_problem
from inference.fits.likelihood.range_walks import range_walks
from inference.frame.range_prior import LEAST_INFORMATION
from inference.known import known_of
from inference.technique import Task
from simulator.errors import RefusedError
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.fits.random_sets import RandomSet, outcome_of, random_set
from tests.fits.scenes import OBJECT, data, exact_scene, path, sensor_of

Array = NDArray[np.float64]

# whose ranges the frames alone leave open: class, kind, seed, decade of the SNR
OPEN = [
    ("crosstalk", "pulsed", 8005, 1.5),
    ("free shadow", "pulsed", 8000, 2.5),
    ("everything", "pulsed", 9002, None),
]


@pytest.fixture
def near_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for nothing beyond walls: the best of these sets lie before them."""
    monkeypatch.setattr(maxima, "_BASES", 0)


def open_set(name: str, kind: str, seed: int, decade: float | None) -> RandomSet:
    return random_set(name, kind, seed, 0, 0, (1.5, 5.0) if decade is None else (decade, decade))


def problem_of(one: RandomSet) -> FitProblem:
    found = fit_problem(one.sensor, one.scene, one.simulation.frames)
    return dataclasses.replace(found, priors=True)


def starts_of(problem: FitProblem) -> list[Maximum]:
    alone = dataclasses.replace(problem, priors=False)
    return [*find_maxima(alone), *find_near(alone)]


def profile_of(problem: FitProblem, x: Array) -> float:
    """Deviance with every range at its best, and what the priors say."""
    _, deviances = frame_modes(problem, x)
    z = standard(problem, x[None])[0]
    return float(deviances[:, 0].sum() + z @ z)


@pytest.mark.parametrize(("name", "kind", "seed", "decade"), OPEN)
def test_ranges_that_frames_leave_open_are_told_by_the_priors(
    name: str,
    kind: str,
    seed: int,
    decade: float | None,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A median of |z| over frames, which share their errors, is above 3.3 in 1e-3 of sets.

    Of a model without errors none of their width is the model's.
    """
    answers: list[Estimates] = []

    def noted(*asked: Any) -> Estimates:
        answers.append(estimate(*asked))
        return answers[-1]

    monkeypatch.setattr("tests.fits.random_sets.estimate", noted)
    if name == "everything":  # which takes most of the time there
        request.getfixturevalue("near_only")
    one = open_set(name, kind, seed, decade)
    outcome = outcome_of(one)
    assert not outcome.refused
    assert outcome.by_priors
    assert outcome.excess < 0.1
    assert len(outcome.misses) > 10
    assert np.median(np.abs(outcome.misses)) < 3.3
    parts = answers[0].results[0].sd_parts_m
    assert parts is not None
    assert (np.nan_to_num(parts.model) == 0.0).all()
    alone = Task(one.sensor, one.scene, one.simulation.frames, known_of(one.scene), exact=True)
    with pytest.raises(RefusedError, match="more than 1"):
        likelihood_answer("joint_fit", alone)


def test_readings_unlike_the_model_are_no_matter_of_priors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A fit of them that ends far off its top was asked again with the priors, for half a minute.

    Crosstalk that the scene does not state is 1e4 times the noise.
    """
    sensor, scene = sensor_of("pulsed", 1e6), exact_scene({})
    frames = data(sensor, {"object": OBJECT, "crosstalk": [1e-4, 1e-4]}, path(12))
    (best, *_) = find_maxima(fit_problem(sensor, scene, frames))
    assert best.deviance > 1e4

    def refused(remaining: float) -> RefusedError:
        end = dataclasses.replace(best, remaining=remaining)
        monkeypatch.setattr(likelihood, "_found", lambda _: [end])
        task = Task(sensor, scene, frames, known_of(scene), exact=True)
        with pytest.raises(RefusedError, match="stopped before the best values") as found:
            likelihood_answer("joint_fit", task)
        return found.value

    assert not isinstance(refused(100.0), LeftOpenError)
    assert isinstance(refused(best.deviance), LeftOpenError)  # what is left may be like it


def test_priors_beside_which_frames_tell_all_are_checked_in_spite_of_rounding(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The share that frames tell of a direction was 1 and a rounding, whose root was no number."""
    sensor = sensor_of("pulsed", 1e8)
    frames = data(sensor, {"object": OBJECT}, path(12))
    problem = fit_problem(sensor, exact_scene({}), frames)
    problem = dataclasses.replace(problem, priors=True)
    top = prior_maxima(problem, list(find_maxima(problem)))[0]
    exactly = np.linalg.eigh

    def rounded(matrix: Array) -> tuple[Array, Array]:
        values, vectors = exactly(matrix)
        return np.where(values > 1.0 - 1e-9, 1.0 + np.finfo(float).eps, values), vectors

    monkeypatch.setattr(np.linalg, "eigh", rounded)
    checks = model_checks(problem, top)
    assert checks["priors"].freedom == 3
    assert 1e-3 < checks["priors"].p_value < 1.0


@pytest.mark.usefixtures("near_only")
@pytest.mark.parametrize(("seed", "decades"), [(9821, (1.5, 3.0)), (9780, (1.5, 2.5))])
def test_ranges_all_but_in_the_dark_are_as_open_as_crosstalk_leaves_them(
    seed: int, decades: tuple[float, float]
) -> None:
    """They were 8.1 standard deviations too near, and 5.0.

    Of the first a step ahead leads where crosstalk is brighter than the frame, and the walk ended;
    of the second another optimum has the frame in the dark, where its own noise decides.
    """
    one = random_set("crosstalk", "pulsed", seed, decades=decades)
    (result,) = estimate(one.sensor, one.scene, one.simulation.frames, ["joint_fit"]).results
    assert result.fit is not None
    assert result.fit["by_priors"]
    off = np.abs(result.range_m - one.simulation.range_m) / result.sd_m
    told = np.isfinite(off)
    assert np.isfinite(result.range_m).all()
    # others may be any range, and say so
    assert told.mean() > 0.8
    assert (result.reason[~told] > 0).all()
    assert off[told].max() < 3.3  # a normal law's is above it in 1e-3


@pytest.mark.usefixtures("near_only")
def test_an_unknown_is_identified_only_as_far_as_it_can_be_held_away() -> None:
    """c2, 5.7 standard deviations of curvature off, was; there all else makes up for it.

    The true value costs 5.0 of deviance, 2.2 standard deviations.
    """
    one = random_set("free shadow", "pulsed", 9877, decades=(1.5, 3.0))
    (result,) = estimate(one.sensor, one.scene, one.simulation.frames, ["joint_fit"]).results
    assert result.fit is not None
    assert result.parameters is not None
    assert result.fit["by_priors"]
    assert one.truth["object"]["c2"] == pytest.approx(0.101, abs=1e-3)
    found = result.parameters["object.c2"]
    assert found["status"] == "weak"
    assert abs(found["value"] - one.truth["object"]["c2"]) < 2.2 * found["sd"]


def test_what_frames_tell_needs_no_priors() -> None:
    sensor = sensor_of("pulsed", 1e5)
    (result,) = estimate(
        sensor, exact_scene({}), data(sensor, {"object": OBJECT}, path(12)), ["joint_fit"]
    ).results
    assert result.fit is not None
    assert not result.fit["by_priors"]


@pytest.mark.thorough
@pytest.mark.usefixtures("near_only")
def test_a_second_place_of_the_ranges_is_not_crowded_out_by_neighbours_of_the_best() -> None:
    """All 27 ranges were twice what they are, and sure to a seventh: 5.3 standard deviations.

    The next optimum is 6.0 worse: five ends of the first valley were all that was kept.
    """
    ranges = [
        0.314, 0.4009, 0.2043, 0.2732, 0.1654, 0.294, 0.2148, 0.422, 0.162, 0.4484, 0.2531, 0.3221,
        0.3213, 0.1181, 0.202, 0.3276, 0.2663, 0.3459, 0.2737, 0.1907, 0.3678, 0.1344, 0.1458,
        0.3984, 0.3016, 0.1231, 0.2814,
    ]  # fmt: skip
    truth: dict[str, Any] = {
        "object": {"c0": 0.01446, "c1": -0.12976, "c2": 0.0058616},
        "crosstalk": [0.143857, 0.3986965],
        "background": {
            "strength": 0.01284,
            "distance_m": 2.748,
            "shadow": {"c0": 0.011871, "c1": 0.07757},
        },
    }
    read = 4.0533e-6
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 1e7, "noise": {"read": [read, read]}}
    )
    frames = simulate(
        sensor, parse_scene({**truth, "discrepancy": 0}), SampledTrajectory(range_m=ranges), 7009
    ).frames
    scene = exact_scene(
        {
            "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 1.1956}] * 2,
            "background": {
                "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
                "distance_m": {"prior": "uniform", "low": 2.5, "high": 7.4},
            },
            "range_m": {"prior": "loguniform", "low": 0.02, "high": 7.0},
        }
    )
    problem = dataclasses.replace(fit_problem(sensor, scene, frames), priors=True)
    found = prior_maxima(problem, starts_of(problem))
    off = [float(np.median(np.abs(end.positions - np.log(ranges)))) for end in found]
    assert off[0] > 0.5
    assert any(
        end.deviance < found[0].deviance + 9.0 and away < 0.2
        for end, away in zip(found, off, strict=True)
    )


def test_a_better_place_behind_a_wall_is_found_by_pulling_the_ranges_through(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ranges a sixth too far, 11 standard deviations: what is best is nowhere near any start."""
    one = random_set("everything", "sine_wave", 5043, 0, 0, (4.0, 6.0))
    problem = problem_of(one)
    truth = np.where(problem.present, np.log(one.simulation.range_m), np.nan)
    z = np.zeros((1, len(problem.parameters)))
    z[0, problem.columns] = [0.5, 0.7, 0.4, -0.3, -0.3, 1.9, 1.0, -1.4, -0.3]
    x = problem.coordinates(problem.parameters.natural(z)[:, problem.columns])[0]
    at, remaining = climbed(problem, begun(problem, x, truth + 0.17), 60)
    base = end_of(problem, *polished(problem, at, remaining))
    assert np.nanmedian(base.positions - truth) > 0.1
    monkeypatch.setattr(other_places, "_HELD", ())  # unknowns held elsewhere do not find it
    ends = [end for end, _ in beyond_walls(problem, base)]
    found = min(ends, key=lambda end: end.deviance)
    assert found.deviance < base.deviance - 3.0
    np.testing.assert_allclose(found.u, truth, atol=0.01)


def test_nothing_is_identified_about_which_optima_disagree() -> None:
    entry = {"value": 1.0, "sd": 0.1, "status": "identified"}
    given = {"a": entry, "b": entry, "c": {**entry, "status": "not_identified"}}
    wide = {path: {**one, "sd": 0.2} for path, one in given.items()}
    found = disputed(wide, given, {"a": [1.05, 0.89], "b": [1.05, 0.91], "c": [2.0]})
    assert [one["status"] for one in found.values()] == ["weak", "identified", "not_identified"]
    assert all(one["sd"] == 0.2 for one in found.values())
    assert disputed(wide, {**given, "b": {**entry, "sd": None}}, {})["b"]["status"] == "weak"


@pytest.mark.usefixtures("near_only")
def test_a_polish_with_priors_ends_where_no_other_way_goes_on() -> None:
    problem = problem_of(open_set("crosstalk", "pulsed", 8005, 1.5))
    top = prior_maxima(problem, starts_of(problem))[0]
    x, deviance, _, _ = polish(problem, top.x)
    assert deviance == pytest.approx(profile_of(problem, x), abs=1e-4)
    assert deviance <= top.deviance + 1e-4  # what a climb leaves

    def cost(there: Array) -> float:
        return profile_of(problem, there)

    found = optimize.minimize(cost, x, method="Nelder-Mead", tol=1e-6, options={"maxfev": 2000})
    assert found.fun > deviance - 1e-3


@pytest.mark.usefixtures("near_only")
def test_walks_of_ranges_reach_as_far_as_any_way_to_where_they_lie() -> None:
    """At the same weighted sum of ranges nothing else is much better, in a bent valley.

    Curvature at the top alone makes intervals half as wide.
    """
    problem = problem_of(open_set("everything", "pulsed", 9002, None))
    found = prior_maxima(problem, starts_of(problem))
    points, better = range_walks(problem, found)
    assert better is None
    top = found[0]
    of_x, of_errors = top.whole.factors
    shared = top.whole.response @ of_x + top.whole.error_response @ of_errors
    curved = np.linalg.norm(np.nan_to_num(shared), axis=1)
    costs = np.array([point.deviance - top.deviance for point in points])
    assert (costs < 9.0).all()
    reaches = [
        np.nanmedian(np.abs(point.positions - top.positions) / curved)
        / math.sqrt(max(point.deviance - top.deviance, 3.84))
        for point in points
    ]
    assert max(reaches) > 1.3
    # the farthest of them, by another method: the mean log range held where it is
    far = points[int(np.argmax(reaches))]
    wanted = float(np.nanmean(far.positions))

    def held(x: Array) -> float:
        mean = float(np.nanmean(frame_modes(problem, x)[0][:, 0]))
        cost = profile_of(problem, x) + (100.0 * (mean - wanted)) ** 2
        return cost if math.isfinite(cost) else 1e9

    other = optimize.minimize(held, far.x, method="Nelder-Mead", options={"maxfev": 1500})
    assert other.fun > far.deviance - 1.0


def test_integrated_ranges_agree_with_quadrature() -> None:
    """Two values of an object, pulses: log likelihoods by sums over a grid of log r."""
    sensor = sensor_of("pulsed", 30.0)
    frames = data(sensor, {"object": OBJECT}, path(6, span=(0.7, 2.0)))
    span = {"prior": "reference", "low": 0.1, "high": 4.0}
    problem = fit_problem(sensor, exact_scene({"range_m": span}), frames)
    problem = dataclasses.replace(problem, priors=True)
    ends = prior_maxima(problem, starts_of(problem))
    first = ends[0]
    second = dataclasses.replace(first, x=first.x + np.array([0.4, 0.0, 0.1]))
    found = integrated_deviance(second) - integrated_deviance(first)
    u = np.linspace(math.log(0.1), math.log(4.0), 20_001)
    read = np.array(sensor.noise.read)

    def by_grid(end: Erring) -> float:
        c0, c1, c2 = (problem.natural(end.x)[problem.names.index(f"object.c{k}")] for k in range(3))
        r = np.exp(u)
        flux = c0 * c2 / (r**2 * (r**2 + c1 * r + c0))
        means = np.stack([flux * r / sensor.max_range_m, flux]) / read[:, None]
        information = np.square(np.gradient(means, u, axis=1)).sum(axis=0)
        told = information / LEAST_INFORMATION
        dark = math.sqrt(LEAST_INFORMATION) * np.trapezoid(1.0 / np.sqrt(1.0 + told), u)
        weight = (told + min(1.0, math.sqrt(2.0 * math.pi * math.e) / dark)) / np.sqrt(1.0 + told)
        logs = []
        for reading in frames.readings / read:
            square = np.square(reading[:, None] - means).sum(axis=0)
            logs.append(math.log(np.trapezoid(weight * np.exp(-0.5 * square), u)))
        z = standard(problem, end.x[None])[0]
        return float(z @ z - 2.0 * sum(logs))

    assert found == pytest.approx(by_grid(second) - by_grid(first), abs=1e-3)


@pytest.mark.usefixtures("near_only")
def test_what_is_best_with_ranges_integrated_out_comes_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = problem_of(open_set("crosstalk", "pulsed", 8005, 1.5))
    top = prior_maxima(problem, starts_of(problem))[0]
    other, beside = dataclasses.replace(top), dataclasses.replace(top)

    def first_of(of_top: float, of_other: float, of_beside: float) -> tuple[Erring, int]:
        told = {id(top): of_top, id(other): of_other, id(beside): of_beside}
        monkeypatch.setattr(integrated, "integrated_deviance", lambda end: told[id(end)])
        found, along = with_integrated_first([top, other], [beside])
        assert along == [beside]
        return found[0], len(found)

    assert first_of(0.0, -8.9, 5.0) == (top, 2)
    assert first_of(0.0, -9.1, 5.0) == (other, 2)
    assert first_of(0.0, -9.1, -9.2) == (beside, 3)


@pytest.mark.parametrize("name", ["crosstalk", "everything"])
def test_unknowns_of_many_points_are_those_of_each(name: str) -> None:
    problem = problem_of(open_set(name, "sine_wave", 1, 3.0))
    z = np.random.default_rng(1).normal(size=(20, len(problem.parameters)))
    points = problem.coordinates(problem.parameters.natural(z)[:, problem.columns])
    wanted = np.array([problem.natural(x) for x in points])
    np.testing.assert_allclose(problem.naturals(points), wanted, rtol=1e-12)
