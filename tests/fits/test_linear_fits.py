"""`object_fit`, `crosstalk_fit`, `shadow_fit`: against the joint fit, scatter and square laws."""

import dataclasses
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from inference.estimate import estimate
from inference.estimates import Status
from inference.fits.techniques.crosstalk_fit import noisier
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import mean_readings
from simulator.trajectories import SampledTrajectory
from tests.fits.scenes import (
    KINDS,
    OBJECT,
    SIGNAL_AT_1M,
    VAGUE,
    WALL,
    data,
    exact_scene,
    path,
    sensor_of,
    served,
    values_of,
)

Array = NDArray[np.float64]
PRIOR = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize(
    ("name", "scene"),
    [
        ("object_fit", {}),
        ("object_fit", {"object": {"c2": OBJECT["c2"]}}),
        ("object_fit", {"object": {"c0": OBJECT["c0"]}}),
        ("object_fit", {"object": {"c1": OBJECT["c1"]}}),
        ("object_fit", {"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}}),
        ("object_fit", {"object": {"c0": OBJECT["c0"], "c2": OBJECT["c2"]}}),
        ("object_fit", {"object": {"c1": OBJECT["c1"], "c2": OBJECT["c2"]}}),
        ("object_fit", {"background": WALL}),
        ("shadow_fit", {"object": OBJECT, "background": {**WALL, "shadow": {}}}),
        ("shadow_fit", {"object": OBJECT, "background": {**WALL, "shadow": {"c0": 0.056}}}),
        ("shadow_fit", {"object": OBJECT, "background": {**WALL, "shadow": {"c1": 0.013}}}),
        ("shadow_fit", {"object": OBJECT, "background": {**WALL, "strength": PRIOR}}),
    ],
)
def test_a_linear_fit_is_the_joint_fit_to_first_order(
    kind: str, name: str, scene: dict[str, Any]
) -> None:
    """Both are efficient: at this noise they differ by far less than a standard deviation."""
    sensor = sensor_of(kind, 1e5)
    truth: dict[str, Any] = {"object": OBJECT}
    if "background" in scene:
        truth["background"] = WALL
    frames = data(sensor, truth, path(16))
    linear, joint = served(sensor, scene, frames, [name, "joint_fit"])
    assert linear.parameters is not None
    assert joint.parameters is not None
    assert linear.parameters.keys() == joint.parameters.keys()
    known = values_of(sensor, truth)
    for key, item in linear.parameters.items():
        other = joint.parameters[key]
        assert item["value"] == pytest.approx(other["value"], abs=0.1 * other["sd"])
        assert item["sd"] == pytest.approx(other["sd"], rel=0.02)
        assert item["status"] == "identified"
        # 40 comparisons at 6 standard deviations: false alarm 1e-7
        assert abs(item["value"] - known[key]) < 6 * item["sd"]
    np.testing.assert_allclose(linear.roots_sd_m, joint.roots_sd_m, rtol=0.05)
    assert linear.fit is not None
    freedom = 16 - len(linear.parameters)
    assert linear.fit["degrees_of_freedom"] == freedom
    low, high = special.chdtri(freedom, 1 - 1e-6), special.chdtri(freedom, 1e-6)
    assert low < linear.fit["chi_square"] < high


@pytest.mark.parametrize("noise", [{}, {"shot": 1e-9, "relative": 1e-3}])
def test_object_fit_attains_its_stated_scatter(noise: dict[str, float]) -> None:
    """(x - truth)^T C^-1 (x - truth) over 100 sets, of each parameter alone; false alarm 1e-5."""
    sensor = sensor_of("pulsed", 3e3, **noise)
    truth = {"object": OBJECT}
    sets = 100
    total = dict.fromkeys(("object.c0", "object.c1", "object.c2"), 0.0)
    chi_square = 0.0
    for seed in range(sets):
        frames = data(sensor, truth, path(10), seed)
        (result,) = served(sensor, {}, frames, ["object_fit"])
        assert result.parameters is not None
        assert result.fit is not None
        for key, value in values_of(sensor, truth).items():
            item = result.parameters[key]
            total[key] += ((item["value"] - value) / item["sd"]) ** 2
        chi_square += result.fit["chi_square"]
    low, high = special.chdtri(sets, 1 - 1e-5), special.chdtri(sets, 1e-5)
    for value in total.values():
        assert 0.98 * low < value < 1.02 * high
    low, high = special.chdtri(7 * sets, 1 - 1e-5), special.chdtri(7 * sets, 1e-5)
    assert 0.98 * low < chi_square < 1.02 * high


def test_a_square_law_has_no_size() -> None:
    """App. B holds plates with c0 = 1e12: c0 and c1 are said to be unidentifiable, c2 is told."""
    sensor = sensor_of("pulsed", 1e4)
    frames = data(sensor, {"object": {"c0": 1e8, "c1": 0.0, "c2": 0.1}}, path(20))
    (result,) = served(sensor, {}, frames, ["object_fit"])
    assert result.parameters is not None
    for key in ("object.c0", "object.c1"):
        assert result.parameters[key]["status"] == "not_identified"
        assert result.parameters[key]["value"] is None
        assert "square law" in result.parameters[key]["reason"]
    item = result.parameters["object.c2"]
    assert abs(item["value"] - 0.1) < 6 * item["sd"]  # false alarm 2e-9
    assert item["sd"] < 1e-4
    assert (result.status == Status.UNIQUE).all()


def with_derivatives(
    sensor: Sensor, truth: dict[str, Any], frames: Frames, ranges: Array, rng: np.random.Generator
) -> Frames:
    """Add derivative columns of an object that moves by 1 m/s."""
    terms = parameters_of(sensor, exact_scene(truth)).terms(np.empty((1, 0)))
    h = 1e-6
    ends = [mean_readings(sensor, terms, ranges * (1 + sign * h)) for sign in (1, -1)]
    slopes = (ends[0] - ends[1]) / (2 * h * ranges[:, None])
    assert sensor.noise.derivative is not None
    noise = np.asarray(sensor.noise.derivative) * rng.standard_normal(slopes.shape)
    return dataclasses.replace(frames, derivatives=slopes + noise)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("known", [("c0", "c1"), ("c0", "c1", "c2")])
def test_crosstalk_fit_attains_its_stated_scatter(kind: str, known: tuple[str, ...]) -> None:
    """100 sets, each parameter alone and the fits' own chi-square; false alarm 1e-5 each."""
    plain = sensor_of(kind, 1e4)
    sensor = parse_sensor(
        {
            **KINDS[kind],
            "noise": {"read": list(plain.noise.read), "derivative": [1e-6, 1e-6]},
        }
    )
    truth = {"object": OBJECT, "crosstalk": [0.002, 0.01]}
    trajectory = path(12, span=(0.2, 1.2))
    ranges = np.array(trajectory.range_m)
    scene = {"object": {key: OBJECT[key] for key in known}, "crosstalk": [VAGUE, VAGUE]}
    rng = np.random.default_rng(11)
    total: dict[str, float] = {}
    chi_square, freedom = 0.0, 0
    sets = 100
    for seed in range(sets):
        frames = with_derivatives(sensor, truth, data(sensor, truth, trajectory, seed), ranges, rng)
        (result,) = served(sensor, scene, frames, ["crosstalk_fit"])
        assert result.parameters is not None
        assert result.fit is not None
        for key, item in result.parameters.items():
            miss = (item["value"] - values_of(sensor, truth)[key]) / item["sd"]
            total[key] = total.get(key, 0.0) + miss**2
        chi_square += result.fit["chi_square"]
        freedom += result.fit["degrees_of_freedom"]
    assert len(total) == 5 - len(known)
    for value in total.values():
        assert 0.95 * special.chdtri(sets, 1 - 1e-5) < value < 1.05 * special.chdtri(sets, 1e-5)
    assert 0.95 * special.chdtri(freedom, 1 - 1e-5) < chi_square
    assert chi_square < 1.05 * special.chdtri(freedom, 1e-5)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("distance", [0.3, 0.7])
def test_noise_of_a_still_object_is_not_its_law(kind: str, distance: float) -> None:
    """Ten sets of 200 frames; more frames would make an answer surer, not better."""
    sensor = sensor_of(kind, SIGNAL_AT_1M / 1e-5)
    for seed in range(10):
        frames = data(sensor, {"object": OBJECT}, path(200, span=(distance, distance)), seed)
        found = estimate(sensor, exact_scene({}), frames, ["object_fit"])
        assert not found.results
        (left,) = (item for item in found.left_out if item.name == "object_fit")
        assert "hardly moves" in left.reason
    # with c2 alone unknown one range tells all: 6 standard deviations, false alarm 2e-9
    scene = {"object": {key: OBJECT[key] for key in ("c0", "c1")}}
    (result,) = served(sensor, scene, frames, ["object_fit"])
    assert result.parameters is not None
    item = result.parameters["object.c2"]
    assert abs(item["value"] - OBJECT["c2"]) < 6 * item["sd"]


def test_the_shadow_of_a_still_object() -> None:
    """One range tells one number of it, and noise the other."""
    sensor = sensor_of("pulsed", SIGNAL_AT_1M / 1e-5)
    scene = exact_scene({"object": OBJECT, "background": {**WALL, "shadow": {}}})
    for seed in range(5):
        truth = {"object": OBJECT, "background": WALL}
        frames = data(sensor, truth, path(40, span=(0.6, 0.6)), seed)
        found = estimate(sensor, scene, frames, ["shadow_fit"])
        assert not found.results
        (left,) = (item for item in found.left_out if item.name == "shadow_fit")
        assert "hardly moves" in left.reason


def test_a_flux_between_square_and_fourth_law_is_called_neither() -> None:
    """About 0.3 m it falls as r^-3.1."""
    sensor = sensor_of("pulsed", SIGNAL_AT_1M / 1e-5)
    said = set()
    for seed in range(8):
        frames = data(sensor, {"object": OBJECT}, path(40, span=(0.28, 0.32)), seed)
        (result,) = served(sensor, {}, frames, ["object_fit"])
        assert result.parameters is not None
        said |= {item.get("reason", "") for item in result.parameters.values()}
    assert any("r^-3.1" in reason for reason in said)
    assert not any("law" in reason for reason in said)


@pytest.mark.parametrize("snr", [77.0, 386.0])
def test_ranges_that_are_themselves_uncertain_are_no_misfit(snr: float) -> None:
    """At 2 m one is uncertain by its own size. Two misfits of 20 healthy sets: once in 5,000.

    Each parameter's sum of squares over the sets, false alarm 1e-5 at either end.
    """
    sensor = sensor_of("pulsed", snr)
    truth = {"object": OBJECT}
    sets, misfits = 20, 0
    total = dict.fromkeys(("object.c0", "object.c1", "object.c2"), 0.0)
    for seed in range(sets):
        (result,) = served(sensor, {}, data(sensor, truth, path(40), seed), ["object_fit"])
        assert result.fit is not None
        assert result.parameters is not None
        misfits += result.fit["misfit"]
        for key, value in values_of(sensor, truth).items():
            item = result.parameters[key]
            total[key] += ((item["value"] - value) / item["sd"]) ** 2
    assert misfits < 2
    assert max(total.values()) < special.chdtri(sets, 1e-5)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_crosstalk_from_differences_in_time_is_as_certain_as_said(kind: str) -> None:
    """Sum of squares of each parameter over 20 sets; false alarm 1e-5 each at the upper end."""
    sensor = sensor_of(kind, SIGNAL_AT_1M / 1e-5)
    truth = {"object": OBJECT, "crosstalk": [0.01, 0.02]}
    scene = {"object": {key: OBJECT[key] for key in ("c0", "c1")}, "crosstalk": [VAGUE, VAGUE]}
    time = np.linspace(0.0, 2.0, 200)
    way = SampledTrajectory(range_m=(0.8 - 0.5 * np.cos(np.pi * time)).tolist())
    sets = 20
    total: dict[str, float] = {}
    for seed in range(sets):
        frames = dataclasses.replace(data(sensor, truth, way, seed), time_s=time)
        (result,) = served(sensor, scene, frames, ["crosstalk_fit"])
        assert result.parameters is not None
        for key, item in result.parameters.items():
            miss = (item["value"] - values_of(sensor, truth)[key]) / item["sd"]
            total[key] = total.get(key, 0.0) + miss**2
    assert len(total) == 3
    assert max(total.values()) < special.chdtri(sets, 1e-5)


def test_crosstalk_from_differences_that_explain_nothing_is_refused() -> None:
    """Ten readings are off by a hundred standard deviations."""
    sensor = sensor_of("pulsed", SIGNAL_AT_1M / 1e-5)
    truth = {"object": OBJECT, "crosstalk": [0.01, 0.02]}
    scene = {"object": {key: OBJECT[key] for key in ("c0", "c1")}, "crosstalk": [VAGUE, VAGUE]}
    time = np.linspace(0.0, 1.0, 100)
    frames = data(sensor, truth, path(100, span=(0.3, 1.0)))
    frames.readings[::10, 0] += 1e-3
    timed = dataclasses.replace(frames, time_s=time)
    found = estimate(sensor, exact_scene(scene), timed, ["crosstalk_fit"])
    assert not found.results
    (left,) = (item for item in found.left_out if item.name == "crosstalk_fit")
    assert "do not explain the readings; take joint_fit" in left.reason


def test_empty_frames_beyond_full_scale_tell_no_strength() -> None:
    """What is clipped at nine tenths of the wall alone would pull the strength down."""
    sensor = sensor_of("pulsed", 1e3)
    truth = {"object": {**OBJECT, "c2": 5e-4}, "background": WALL}
    scene = {**truth, "background": {**WALL, "strength": PRIOR}}
    frames = data(sensor, truth, path(10, 3, span=(0.3, 0.45)))
    full = 0.9 * WALL["strength"]
    assert frames.readings[:10, 1].max() < full < frames.readings[10:, 1].min()
    limited = sensor.model_copy(update={"full_scale": (1.0, full)})
    clipped = dataclasses.replace(frames, readings=np.minimum(frames.readings, (1.0, full)))
    (result,) = served(limited, scene, clipped, ["shadow_fit"])
    (without,) = served(sensor, scene, frames.select(np.arange(10)), ["shadow_fit"])
    assert (result.status[10:] == Status.SATURATED).all()
    assert result.parameters == without.parameters


def test_obstacles_name_what_is_missing() -> None:
    sensor = sensor_of("pulsed", 1e4)
    frames = data(sensor, {"object": OBJECT}, path(6))
    names = ["object_fit", "crosstalk_fit", "shadow_fit"]

    def reasons(scene: dict[str, Any], shown: Frames = frames) -> dict[str, str]:
        found = estimate(sensor, exact_scene(scene), shown, names)
        return {item.name: item.reason for item in found.left_out}

    wanted = reasons({"motion": "static"})
    assert "move the object" in wanted["object_fit"]
    wanted = reasons({"object": OBJECT, "background": {**WALL, "shadow": {}}, "motion": "static"})
    assert "move the object" in wanted["shadow_fit"]
    for name, scene in (
        ("object_fit", {}),
        ("crosstalk_fit", {"object": OBJECT, "crosstalk": [VAGUE, VAGUE]}),
        ("shadow_fit", {"object": OBJECT, "background": {**WALL, "shadow": {}}}),
    ):
        timed = dataclasses.replace(frames, time_s=np.arange(6.0))
        assert "discrepancy" not in reasons({**scene, "discrepancy": 0.02}, timed).get(name, "")
    assert "is known" in reasons({"object": OBJECT})["object_fit"]
    assert "crosstalk" in reasons({"crosstalk": [VAGUE, VAGUE]})["object_fit"]
    wall = {**WALL, "strength": PRIOR}
    assert "background.strength" in reasons({"background": wall})["object_fit"]
    assert (
        "time_s"
        in reasons({"crosstalk": [VAGUE, VAGUE]}, dataclasses.replace(frames, time_s=None))[
            "crosstalk_fit"
        ]
    )
    wall = {"distance_m": 3.0, "strength": PRIOR}
    assert "not linear" in reasons({"object": OBJECT, "background": wall})["shadow_fit"]
    few = frames.select(np.arange(3))
    assert "at least 4" in reasons({}, few)["object_fit"]


@pytest.mark.parametrize("noise", [1e-13, 1e-9, 1e-5])
def test_weights_where_the_range_is_far_less_certain_than_the_readings(noise: float) -> None:
    """Against the covariance inverted with fifty digits; its parts are never added in doubles."""
    rng = np.random.default_rng(1)
    own = noise**2 * np.array([[[1.0, 0.3], [0.3, 2.0]]])
    common = rng.standard_normal((2, 1, 2)) * np.array([noise, 1e-3])[:, None, None]
    found = noisier(noisier(np.linalg.inv(np.linalg.cholesky(own)), common[0]), common[1])[0]
    with mpmath.workdps(50):
        total = mpmath.matrix(own[0].tolist())
        for part in common[:, 0]:
            column = mpmath.matrix(part.tolist())
            total += column * column.T
        inverse = total**-1
        expected = np.array(inverse.tolist(), dtype=float)
        # a unit of the whitened readings in the last place of the largest weight
        allowed = 100 * np.finfo(float).eps * float(max(abs(x) for x in inverse))
    assert np.abs(found.T @ found - expected).max() <= allowed
