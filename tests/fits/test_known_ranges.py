"""`joint_fit` with ranges, displacements and a joint law that are known, against least squares."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from simulator.frames import Frames
from simulator.parameters import Parameters, parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor
from simulator.simulate import mean_readings
from simulator.trajectories import SampledTrajectory
from tests.fits.scenes import OBJECT, VAGUE, data, exact_scene, path, sensor_of

Array = NDArray[np.float64]

STATED: dict[str, Any] = {"crosstalk": [VAGUE, VAGUE]}
TRUTH: dict[str, Any] = {"object": OBJECT, "crosstalk": [0.002, 0.01]}
FRAMES = 10


def fitted(sensor: Sensor, scene: Scene, frames: Frames) -> TechniqueResult:
    found = estimate(sensor, scene, frames, ["joint_fit"])
    reasons = {item.name: item.reason for item in found.left_out}
    assert found.results, reasons["joint_fit"]
    return found.results[0]


def least_squares(
    sensor: Sensor, scene: Scene, frames: Frames, r: Array
) -> tuple[Parameters, Array, Array]:
    """Unknowns (in z), ranges and the offset at once; the solution and its standard deviations."""
    parameters = parameters_of(sensor, scene)
    d, n, read = len(parameters), len(frames), np.asarray(sensor.noise.read)

    def residuals(x: Array) -> Array:
        z, ranges, offset = x[:d], np.exp(x[d : d + n]), x[d + n]
        means = mean_readings(sensor, parameters.terms(z[None]), ranges)
        parts = [((frames.readings - means) / read).ravel(), z]
        if frames.known_range_m is not None and frames.known_range_sd_m is not None:
            off = (frames.known_range_m - ranges) / frames.known_range_sd_m
            parts.append(off[np.isfinite(off)])
        if frames.displacement_m is not None and frames.displacement_sd_m is not None:
            off = (frames.displacement_m + offset - ranges) / frames.displacement_sd_m
            parts.append(off[np.isfinite(off)])
        return np.concatenate([*parts, [1e-3 * (offset - 1.0)]])

    natural = np.array([[OBJECT["c0"], OBJECT["c1"], OBJECT["c2"], *TRUTH["crosstalk"]]])
    start = np.concatenate([parameters.standard(natural)[0], np.log(r), [0.0]])
    found = optimize.least_squares(
        residuals, start, jac="3-point", x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    sd = np.linalg.norm(np.linalg.pinv(np.asarray(found.jac)), axis=1)
    return parameters, found.x, sd[d : d + n]


def knowing(frames: Frames, r: Array, kind: str) -> Frames:
    rng = np.random.default_rng(7)
    nothing = np.full(FRAMES, np.nan)
    if "range" in kind:
        known, sd = nothing.copy(), nothing.copy()
        known[[1, 6]] = r[[1, 6]] + 2e-3 * rng.standard_normal(2)
        sd[[1, 6]] = 2e-3
        frames = dataclasses.replace(frames, known_range_m=known, known_range_sd_m=sd)
    if "displacement" in kind:
        moved = r - r[3] + 1e-3 * rng.standard_normal(FRAMES)
        moved[4] = np.nan
        sd = np.where(np.isnan(moved), np.nan, 1e-3)
        frames = dataclasses.replace(frames, displacement_m=moved, displacement_sd_m=sd)
    return frames


@pytest.mark.parametrize("kind", ["range", "displacement", "range and displacement"])
def test_known_ranges_are_residuals_of_the_fit(kind: str) -> None:
    """Of an exact model: the same least squares, every range an unknown of its own."""
    sensor, scene = sensor_of(snr=300.0), exact_scene(STATED)
    trajectory = path(FRAMES, span=(0.3, 1.0))
    r = np.linspace(0.3, 1.0, FRAMES)
    frames = data(sensor, TRUTH, trajectory)
    plain = fitted(sensor, scene, frames)
    frames = knowing(frames, r, kind)
    found = fitted(sensor, scene, frames)
    parameters, x, sd = least_squares(sensor, scene, frames, r)
    assert (found.status == Status.UNIQUE).all()
    assert found.fit is not None
    assert not found.fit["misfit"]
    ranges = np.exp(x[len(parameters) : -1])
    # where a climb ends, and second order in the noise
    assert np.abs(found.range_m - ranges).max() < 0.05 * (sd * ranges).min() + 0.05 * 2e-3
    np.testing.assert_allclose(found.sd_m, sd * ranges, rtol=0.05)
    natural = parameters.natural(x[None, : len(parameters)])[0]
    assert found.parameters is not None
    for name, value in zip(parameters.names, natural.tolist(), strict=True):
        said = found.parameters[name]
        assert said["value"] == pytest.approx(value, abs=0.1 * said["sd"])
    told = np.isfinite(plain.sd_m)  # else as open as all ranges are
    assert told.any()
    assert np.isfinite(found.sd_m).all()
    assert np.median(found.sd_m[told]) < 0.5 * np.median(plain.sd_m[told])


def test_a_contradiction_names_its_frame() -> None:
    sensor, scene = sensor_of(), exact_scene(STATED)
    r = np.linspace(0.3, 1.0, FRAMES)
    frames = data(sensor, TRUTH, path(FRAMES, span=(0.3, 1.0)))
    known = r.copy()
    known[4] *= 1.1
    frames = dataclasses.replace(
        frames, known_range_m=known, known_range_sd_m=np.full(FRAMES, 2e-3)
    )
    found = fitted(sensor, scene, frames)
    assert found.fit is not None
    assert found.fit["misfit"]
    named = [k for k in range(FRAMES) if "contradict" in found.reasons[found.reason[k]]]
    assert named == [4]
    assert np.isnan(found.range_m).all()


def test_known_ranges_that_the_scene_excludes_leave_the_fit_out() -> None:
    sensor = sensor_of()
    scene = exact_scene({**STATED, "range_m": {"prior": "loguniform", "low": 0.2, "high": 1.1}})
    frames = data(sensor, TRUTH, path(FRAMES, span=(0.3, 1.0)))
    frames = dataclasses.replace(
        frames, known_range_m=np.full(FRAMES, 1.5), known_range_sd_m=np.full(FRAMES, 1e-3)
    )
    found = estimate(sensor, scene, frames, ["joint_fit"])
    (reason,) = [item.reason for item in found.left_out if item.name == "joint_fit"]
    assert "known ranges lie outside" in reason


def test_the_unit_of_the_readings_changes_nothing() -> None:
    r = np.linspace(0.3, 1.0, FRAMES)
    results = []
    for scale in (1.0, 1e9):
        sensor = sensor_of()
        read = [scale * sd for sd in sensor.noise.read]
        scaled = sensor.model_copy(
            update={"gain": scale, "noise": sensor.noise.model_copy(update={"read": tuple(read)})}
        )
        prior = {**VAGUE, "sd": scale * VAGUE["sd"]}
        frames = knowing(data(sensor, TRUTH, path(FRAMES, span=(0.3, 1.0))), r, "displacement")
        frames = dataclasses.replace(frames, readings=frames.readings * scale)
        results.append(fitted(scaled, exact_scene({"crosstalk": [prior, prior]}), frames))
    np.testing.assert_allclose(results[0].range_m, results[1].range_m, rtol=1e-6)
    np.testing.assert_allclose(results[0].sd_m, results[1].sd_m, rtol=1e-3)


def _law(scene: dict[str, Any], modes: list[tuple[float, list[float], float]]) -> Scene:
    """A law over all unknowns: modes of given weight and mean, as wide in every direction."""
    names = parameters_of(sensor_of(), exact_scene(scene)).names
    eye = np.eye(len(names))
    return exact_scene(
        {
            **scene,
            "joint": {
                "unknowns": list(names),
                "modes": [
                    {"weight": weight, "mean": mean, "covariance": (sd**2 * eye).tolist()}
                    for weight, mean, sd in modes
                ],
            },
        }
    )


@pytest.mark.parametrize("discrepancy", [0, "default"])
def test_a_joint_law_counts(discrepancy: float | str) -> None:
    """Intervals hold the truth, and are narrower than without; sets drawn from the law.

    Were each of 14 sets one draw, 90 % intervals that are right would hold less than 0.55 with a
    probability of 2e-4. An error of the model that is allowed for and not made can only widen them.
    """
    sensor = sensor_of()
    centre, sd = [0.2, -0.3, 0.1, 0.05, 0.2], 0.03
    law = _law({**STATED, "discrepancy": discrepancy}, [(1.0, centre, sd)])
    free = exact_scene({**STATED, "discrepancy": discrepancy})
    parameters = parameters_of(sensor, free)
    r = np.linspace(0.3, 1.0, FRAMES)
    held, width, before = [], [], []
    for seed in range(14 if discrepancy == 0 else 1):
        rng = np.random.default_rng(seed)
        z = np.asarray(centre) + sd * rng.standard_normal(5)
        means = mean_readings(sensor, parameters.terms(z[None]), r)
        readings = means + np.asarray(sensor.noise.read) * rng.standard_normal(means.shape)
        found = fitted(sensor, law, Frames(readings))
        assert found.fit is not None
        assert not found.fit["misfit"]
        held.append(np.abs(found.range_m - r) < 1.6448536 * found.sd_m)
        width.append(np.median(found.sd_m))
        if seed < 2:
            before.append(np.median(fitted(sensor, free, Frames(readings)).sd_m))
    assert np.mean(held) > 0.55
    assert np.median(width) < 0.5 * np.median(before)


@pytest.mark.parametrize(("weight", "count"), [(0.5, 2), (1e-4, 1)])
def test_modes_of_a_law_are_answers_of_their_own(weight: float, count: int) -> None:
    """One window alone does not tell a dark object near by from a bright one farther away."""
    sensor = sensor_of()
    deaf = sensor.model_copy(
        update={"noise": sensor.noise.model_copy(update={"read": (1.0, sensor.noise.read[1])})}
    )
    means = [[0.0, 0.0, 0.0, 0.0, 0.2], [0.0, 0.0, 1.0, 0.0, 0.2]]
    law = _law(STATED, [(1.0 - weight, means[0], 1e-3), (weight, means[1], 1e-3)])
    free = parameters_of(deaf, exact_scene(STATED))
    r = np.linspace(0.3, 0.8, FRAMES)
    terms = free.terms(np.array(means[:1]))
    found = fitted(deaf, law, Frames(mean_readings(deaf, terms, r)))
    assert found.root_count.tolist() == [count] * FRAMES
    np.testing.assert_allclose(found.roots_m[:, 0], r, rtol=0.01)
    if count == 2:
        others = mean_readings(deaf, free.terms(np.array(means[1:])), found.roots_m[:, 1])
        here = mean_readings(deaf, terms, r)
        np.testing.assert_allclose(others[:, 1], here[:, 1], rtol=0.01)


def test_ranges_at_rest_with_odometry_are_told() -> None:
    """None of the frames has a second range, and a column without one is no warning."""
    sensor = sensor_of()
    r = np.full(FRAMES, 0.35)
    trajectory = SampledTrajectory(range_m=r.tolist())
    frames = knowing(data(sensor, {"object": OBJECT}, trajectory), r, "displacement")
    known = {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}
    result = fitted(sensor, parse_scene({"object": known}), frames)
    # ten frames a truth: beyond 5 sd once in 2e5 runs
    assert (np.abs(result.range_m - r) < 5 * result.sd_m).all()
