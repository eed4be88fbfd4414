"""`joint_fit` against a slow reference, its bounds against scatter and published figures."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from scipy import special

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from inference.fits.answer import likelihood_answer
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.maximum import Maximum, maximum_from
from inference.fits.likelihood.multistart import find_maxima
from inference.fits.likelihood.problem import fit_problem
from inference.identifiability.experiment import Experiment, information
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.sensor import Sensor, parse_sensor
from tests.fits.scenes import (
    KINDS,
    OBJECT,
    SIGNAL_AT_1M,
    THESIS,
    VAGUE,
    WALL,
    data,
    exact_scene,
    path,
    reference_fit,
    sensor_of,
    values_of,
)

UNKNOWN_WALL: dict[str, Any] = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": {"prior": "uniform", "low": 2.2, "high": 8.0},
    "shadow": {"c0": 0.056, "c1": 0.013},
}
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "crosstalk": ({"crosstalk": [VAGUE, VAGUE]}, {"object": OBJECT, "crosstalk": [0.002, 0.01]}),
    "wall": (
        {"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}, "background": UNKNOWN_WALL},
        {"object": OBJECT, "background": WALL},
    ),
    "shadow": (
        {"background": {**WALL, "shadow": "object"}},
        {"object": OBJECT, "background": {**WALL, "shadow": "object"}},
    ),
}


def fitted(sensor: Sensor, scene: dict[str, Any], frames: Frames) -> TechniqueResult:
    found = estimate(sensor, exact_scene(scene), frames, ["joint_fit"])
    reasons = {item.name: item.reason for item in found.left_out}
    assert found.results, reasons["joint_fit"]
    return found.results[0]


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("case", list(CASES))
def test_a_fit_is_that_of_scipy_over_all_unknowns(kind: str, case: str) -> None:
    """The fit stops where 1e-3 of deviance is left: 0.03 standard deviations of a parameter."""
    scene, truth = CASES[case]
    if case == "shadow":
        truth = {**truth, "object": {**OBJECT, "c1": 0.05}}  # so that no shadow is negative
    sensor = sensor_of(kind, 1e4)
    trajectory = path(14, 2)
    frames = data(sensor, truth, trajectory)
    result = fitted(sensor, scene, frames)
    assert result.parameters is not None
    assert result.fit is not None
    values, ranges, chi_square = reference_fit(
        sensor,
        exact_scene(scene),
        frames,
        values_of(sensor, truth),
        np.array(trajectory.range_m),
    )
    assert result.fit["chi_square"] == pytest.approx(chi_square, abs=2e-3)
    assert result.fit["degrees_of_freedom"] == 2 * 16 - 14 - len(values)
    for name, value in values.items():
        assert result.parameters[name]["value"] == pytest.approx(
            value, abs=0.05 * result.parameters[name]["sd"]
        )
    np.testing.assert_allclose(result.range_m[:14] / ranges, 1.0, atol=1e-3)
    assert (np.abs(result.range_m[:14] - ranges) < 0.05 * result.sd_m[:14]).all()
    assert (result.status[14:] == Status.NONE).all()
    assert "no object" in result.reasons[result.reason[15]]


@pytest.mark.parametrize("frames", [6, 40])
def test_the_example_of_the_thesis(frames: int) -> None:
    """Crosstalk a thousand times the object at 1 m, noise 1e-9 of it, no guess.

    The optimum is that of a start at the truth; chi-square within 1e-5 of both tails.
    """
    sensor = parse_sensor({**KINDS["pulsed"], "gain": 3.0, "noise": {"read": [3e-9, 3e-9]}})
    truth = {"object": THESIS, "crosstalk": [3.0, 3.0]}
    trajectory = path(frames)
    scene = exact_scene({"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 10.0}] * 2})
    shown = data(sensor, truth, trajectory)
    problem = fit_problem(sensor, scene, shown)
    start = problem.coordinates(np.array([[0.1, 10.0, 0.1, 3.0, 3.0]]))[0]
    at_truth = maximum_from(problem, start)
    found = find_maxima(problem)
    assert found[0].deviance == pytest.approx(at_truth.deviance, abs=0.1)
    freedom = frames - 5
    assert special.chdtri(freedom, 1 - 1e-5) < found[0].deviance < special.chdtri(freedom, 1e-5)
    miss = (found[0].positions - np.log(trajectory.range_m)) / np.log(10)
    assert np.abs(miss).max() < (0.01 if frames == 40 else 0.1)


def test_bounds_are_attained() -> None:
    """Scatter of 60 fits against the Cramer-Rao bound at the truth.

    (x - truth)^T I (x - truth) is chi-square with five degrees of freedom a data set where the
    bound is attained; at this noise the third derivatives change it by less than 2 %. Two-sided
    false-alarm rate 1e-4 each for the parameters and for the fits' own chi-square.
    """
    sensor = sensor_of("pulsed", 3e4)
    scene, truth = CASES["crosstalk"]
    trajectory = path(12)
    problem = fit_problem(sensor, exact_scene(scene), data(sensor, truth, trajectory))
    known = values_of(sensor, truth)
    at = problem.coordinates(np.array([[known[name] for name in problem.names]]))[0]
    _, facts = residuals_and_information(problem, at, np.log(trajectory.range_m))
    distance, chi_square = 0.0, 0.0
    sets = 60
    for seed in range(sets):
        shown = data(sensor, truth, trajectory, seed)
        top = maximum_from(fit_problem(sensor, exact_scene(scene), shown), at)
        distance += float(np.sum((facts.jacobian @ (top.x - at)) ** 2))
        chi_square += top.deviance
    for value, freedom in ((distance, 5 * sets), (chi_square, 7 * sets)):
        low, high = special.chdtri(freedom, 1 - 5e-5), special.chdtri(freedom, 5e-5)
        assert 0.98 * low < value < 1.02 * high


# the noise enters pulse and sine wave by the same rows
@pytest.mark.parametrize(
    ("kind", "noise"),
    [("pulsed", {}), ("pulsed", {"shot": 1e-6, "relative": 0.003}), ("sine_wave", {})],
)
def test_bounds_are_those_of_the_identifiability_study(kind: str, noise: dict[str, float]) -> None:
    """Two codes for the same derivatives: standard deviations agree to 1e-7."""
    sensor = sensor_of(kind, **noise)
    truth: dict[str, Any] = {
        "object": OBJECT,
        "crosstalk": [0.002, 0.01],
        "background": WALL,
    }
    scene = exact_scene(
        {
            "crosstalk": [VAGUE, VAGUE],
            "background": UNKNOWN_WALL,
        }
    )
    trajectory = path(20, 2)
    frames = data(sensor, truth, trajectory)
    problem = fit_problem(sensor, scene, frames)
    known = values_of(sensor, truth)
    x = problem.coordinates(np.array([[known[name] for name in problem.names]]))[0]
    u = np.where(frames.present, np.log(trajectory.range_m), np.nan)
    _, facts = residuals_and_information(problem, x, u)
    parameters = parameters_of(sensor, scene)
    z = parameters.standard(np.array([[known[name] for name in parameters.names]]))[0]
    theirs = information(Experiment(sensor, parameters, z, u))
    assert facts.rank == theirs.rank == len(problem)
    np.testing.assert_allclose(facts.range_sd, theirs.range_sd, rtol=1e-7)
    logs = [k for k, name in enumerate(problem.names) if not name.endswith(".c1")]
    crosstalk = np.array([name.startswith("crosstalk") for name in problem.names])
    # its coordinate is the static light
    natural = facts.sd_of(problem.chain(x)[problem.slots]) * problem.unit
    own = np.where(crosstalk, natural, facts.sd)[logs]
    scale = Experiment(sensor, parameters, z, u).unknowns.units[3:5]
    wanted = np.array([theirs.sd[theirs.names.index(problem.names[k])] for k in logs])
    wanted *= [
        scale[0 if problem.names[k] == "crosstalk." + sensor.columns[0] else 1]
        if problem.names[k].startswith("crosstalk")
        else 1.0
        for k in logs
    ]
    np.testing.assert_allclose(own, wanted, rtol=1e-7)


def test_published_bounds_of_the_object_before_crosstalk() -> None:
    """Section 2.2, problem E, additive noise: c0 21, c2 48, ranges 0.87 / 7.4 / 120 (of 1/SNR).

    The study's crosstalk is the signal at 1 m, and its noise is w2 at 0.95 m over the SNR.
    """
    r0 = 15.0
    middle = math.exp(np.log(np.linspace(0.2, 2.0, 40)).mean())
    flux = (
        OBJECT["c0"] * OBJECT["c2"] / middle**2 / (middle**2 + OBJECT["c1"] * middle + OBJECT["c0"])
    )
    snr = 1e6
    crosstalk = OBJECT["c0"] * OBJECT["c2"] / (1 + OBJECT["c1"] + OBJECT["c0"])
    flux += crosstalk
    sensor = parse_sensor(
        {
            "kind": "pulsed",
            "pulse_width_s": 2 * r0 / 299792458,
            "noise": {"read": [flux / snr, flux / snr]},
        }
    )
    scene, _ = CASES["crosstalk"]
    truth = {"object": OBJECT, "crosstalk": [0.2 * crosstalk, crosstalk]}
    trajectory = path(40)
    problem = fit_problem(sensor, exact_scene(scene), data(sensor, truth, trajectory))
    known = values_of(sensor, truth)
    x = problem.coordinates(np.array([[known[name] for name in problem.names]]))[0]
    _, facts = residuals_and_information(problem, x, np.log(trajectory.range_m))
    ranges = np.sort(facts.range_sd) * snr
    found = (facts.sd[0] * snr, facts.sd[2] * snr, ranges[0], ranges[20], ranges[-1])
    for value, printed, unit in zip(
        found, (21, 48, 0.87, 7.4, 120), (1, 1, 0.01, 0.1, 10), strict=True
    ):
        assert abs(value - printed) <= 0.501 * unit


@pytest.mark.parametrize("exponent", [-12, -5, 7, 12])
def test_nothing_depends_on_the_unit_of_the_readings(exponent: int) -> None:
    scale = 10.0**exponent
    scene, truth = CASES["crosstalk"]
    results = []
    for unit in (1.0, scale):
        read = SIGNAL_AT_1M / 1e4 * unit
        sensor = parse_sensor({**KINDS["pulsed"], "gain": unit, "noise": {"read": [read, read]}})
        frames = data(sensor_of("pulsed", 1e4), truth, path(12, 1))
        shown = dataclasses.replace(frames, readings=frames.readings * unit)
        vague = {**VAGUE, "sd": VAGUE["sd"] * unit}
        results.append(fitted(sensor, {**scene, "crosstalk": [vague, vague]}, shown))
    one, other = results
    assert one.parameters is not None
    assert other.parameters is not None
    # the two climbs stop at 1e-3 of deviance, each at its own place
    assert (np.abs(one.range_m - other.range_m)[:12] < 0.05 * one.sd_m[:12]).all()
    for name, item in one.parameters.items():
        factor = scale if name.startswith("crosstalk") else 1.0
        assert other.parameters[name]["value"] / factor == pytest.approx(
            item["value"], abs=0.05 * item["sd"]
        )
        assert other.parameters[name]["sd"] / factor == pytest.approx(item["sd"], rel=1e-2)


def test_gain_of_a_frame_scales_its_signal() -> None:
    scene, truth = CASES["wall"]
    sensor = sensor_of("pulsed", 1e4)
    frames = data(sensor, truth, path(12, 1))
    rng = np.random.default_rng(3)
    gain = rng.uniform(0.5, 2.0, 13)
    rest = rng.standard_normal((13, 2)) * np.asarray(sensor.noise.read)
    plain = fitted(sensor, scene, frames)
    scaled = dataclasses.replace(frames, readings=frames.readings * gain[:, None] + rest, gain=gain)
    result = fitted(sensor, scene, scaled)
    difference = np.abs(result.range_m - plain.range_m)[:12]
    # two noises: six standard deviations of their difference, 24 comparisons, false alarm 5e-8
    allowed = 6 * (result.sd_m + 2 * plain.sd_m)[:12]
    assert (difference < allowed).all()


def test_all_frames_decide_between_the_roots_of_one() -> None:
    """Beyond k R = pi a frame has two roots; their fit over frames leaves the right one."""
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [1e-8, 1e-8]}}
    )
    wall = {"strength": 0.0064, "distance_m": 5.0, "shadow": {"c0": 0.0596, "c1": 0.0132}}
    plate = {"c0": 0.0817, "c1": 0.0574, "c2": 0.103}
    trajectory = path(12, span=(1.3, 2.4))
    frames = data(sensor, {"object": plate, "background": wall}, trajectory)
    unknown = {"object": {**plate, "c2": {"prior": "lognormal", "median": 0.1, "sigma": 1.0}}}
    result = fitted(sensor, {**unknown, "background": wall}, frames)
    assert (result.status == Status.UNIQUE).all()
    # 12 normal variates within 6 standard deviations: false alarm 2e-8
    assert (np.abs(result.range_m - trajectory.range_m) < 6 * result.sd_m).all()


def test_little_noise_walls_no_optimum_off() -> None:
    """Near a turning point of the light the climbs of an exact model end at a chi-square of 1e7."""
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [8e-5, 8e-5]}}
    )
    folded = {"c0": 0.0769, "c1": -0.535, "c2": 0.0957}
    result = fitted(sensor, {}, data(sensor, {"object": folded}, path(151, span=(0.1, 0.8))))
    assert result.fit is not None
    assert not result.fit["misfit"]
    assert result.parameters is not None
    for name, value in folded.items():
        item = result.parameters[f"object.{name}"]
        # false alarm 6e-7
        assert abs(item["value"] - value) < 5 * item["sd"]


def test_settings_of_the_joint_fit_give_its_answer() -> None:
    sensor = sensor_of("pulsed", 1e4)
    for name, case in (
        ("iterative_differential", "crosstalk"),
        ("iterative_background_cancelling", "shadow"),
    ):
        scene, truth = CASES[case]
        truth = {**truth, "object": {**OBJECT, "c1": 0.05}}
        frames = data(sensor, truth, path(12))
        (one,) = estimate(sensor, exact_scene(scene), frames, [name]).results
        (other,) = estimate(sensor, exact_scene(scene), frames, ["joint_fit"]).results
        assert (one.technique, other.technique) == (name, "joint_fit")
        assert one.parameters == other.parameters
        np.testing.assert_array_equal(one.roots_m, other.roots_m)


def test_walks_without_end_leave_an_answer_in_one_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every walk meets a better optimum: values, bounds and optima are those of the same one."""

    def restless(_: Any, top: Maximum, __: Any) -> tuple[float, list[Maximum], Maximum]:
        return 1.0, [], dataclasses.replace(top, x=top.x * (1 + 1e-4), deviance=top.deviance - 1.0)

    monkeypatch.setattr(likelihood_answer, "inflation", restless)
    sensor = sensor_of("pulsed")
    result = fitted(sensor, {}, data(sensor, {"object": OBJECT}, path(16)))
    assert result.parameters is not None
    assert result.fit is not None
    for name, value in result.fit["optima"][0]["parameters"].items():
        assert result.parameters[name]["value"] == value
    assert result.fit["optima"][0]["excess_deviance"] == 0.0


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_a_gain_factor_scales_what_is_found_and_nothing_else(factor: float) -> None:
    """Readings at a millionth of the gain are those of a millionth of the light at full gain."""
    sensor = sensor_of("pulsed", 1e4)
    frames = data(sensor, {"object": OBJECT, "background": WALL}, path(12, 2))
    scaled = dataclasses.replace(frames, gain=np.full(len(frames), factor))
    found = []
    for gain, shown in ((1.0, frames), (1.0 / factor, scaled)):
        strength = {"prior": "lognormal", "median": 0.03 * gain, "sigma": 1.0}
        scene = {
            "object": {key: OBJECT[key] for key in ("c0", "c1")},
            "background": {**WALL, "strength": strength},
        }
        other = sensor.model_copy(update={"gain": gain})
        (result,) = estimate(other, exact_scene(scene), shown, ["joint_fit"]).results
        assert result.parameters is not None
        item = result.parameters["background.strength"]
        found.append([item["value"] / gain, item["sd"] / gain])
        assert (result.status[:12] == Status.UNIQUE).all()
    # both stop within 1e-3 of the deviance at the top: 0.03 sd
    assert abs(found[1][0] - found[0][0]) < 0.1 * found[0][1]
    assert found[1][1] == pytest.approx(found[0][1], rel=1e-3)
