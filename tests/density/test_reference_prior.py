"""The reference prior of the ranges: how they are spread says nothing."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate, stats

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.density.discrepant import with_discrepancy
from inference.frame.dark_mass import DARK_MASS
from inference.frame.range_prior import LEAST_INFORMATION
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import RadialTrajectory, SampledTrajectory
from tests.density.discrepancy_reference import matern_path_covariance
from tests.posterior.scenes import KINDS, OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

Array = NDArray[np.float64]
NOTHING = np.empty((1, 0))
C = (OBJECT["c0"], OBJECT["c1"], OBJECT["c2"])
CROSSTALK = (0.002, 0.01)
SPAN: dict[str, Any] = {"prior": "reference", "low": 0.1, "high": 3.0}
WALL: dict[str, Any] = {"strength": 0.02, "distance_m": 4.0, "shadow": {"c0": 0.05, "c1": 0.02}}


@pytest.fixture(params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def density_of(sensor: Sensor, scene: dict[str, Any], frames: Frames) -> CollapsedDensity:
    return collapsed_density(sensor, parse_scene(scene), frames)


def readings_at(sensor: Sensor, u: Array, scene: dict[str, Any]) -> tuple[Array, Array]:
    """Mean readings and the object's part at ranges exp(u), shape (2, n), from the formulas."""
    r = np.exp(u)
    flux = C[0] * C[2] / (r**2 * (r**2 + C[1] * r + C[0]))
    hidden, one = np.zeros_like(r), np.ones_like(r)
    if "background" in scene:
        c0, c1 = WALL["shadow"]["c0"], WALL["shadow"]["c1"]
        hidden = WALL["strength"] * (r**2 + c1 * r) / (r**2 + c1 * r + c0)
    if isinstance(sensor, PulsedSensor):
        own = flux * np.stack([r / sensor.r0, one])
        behind = hidden * np.stack([WALL["distance_m"] / sensor.r0 * one, one])
    else:
        turn = sensor.wave_number
        own = flux * np.stack([np.cos(turn * r), np.sin(turn * r)])
        phase = turn * WALL["distance_m"] * one
        behind = hidden * np.stack([np.cos(phase), np.sin(phase)])
    return own + behind + np.array(CROSSTALK)[:, None], own


def covariances(sensor: Sensor, mean: Array, own: Array) -> Array:
    """Covariance matrices of the readings, shape (n, 2, 2), written straight from docs/model.md."""
    noise = sensor.noise
    shot = noise.shot * np.abs(mean)
    matrix = np.zeros((mean.shape[1], 2, 2))
    for j in range(2):
        matrix[:, j, j] = noise.read[j] ** 2 + shot[j]
    if isinstance(sensor, PulsedSensor):
        # the late photons are part of the whole
        matrix[:, 0, 1] = matrix[:, 1, 0] = shot.min(axis=0)
    light = noise.relative * own.T
    return np.asarray(matrix + light[:, :, None] * light[:, None, :])


def told_at(sensor: Sensor, scene: dict[str, Any], u: Array) -> Array:
    """A frame's Fisher information on its log r, in units of the least."""
    mean, own = readings_at(sensor, u, scene)
    ahead, behind = (readings_at(sensor, u + h, scene)[0] for h in (1e-5, -1e-5))
    slope = ((ahead - behind) / 2e-5).T
    solved = np.linalg.solve(covariances(sensor, mean, own), slope[:, :, None])[:, :, 0]
    return np.asarray(np.einsum("nj,nj->n", slope, solved) / LEAST_INFORMATION)


def dark_of(sensor: Sensor, scene: dict[str, Any]) -> float:
    """By what the law is less in the dark: there it has the mass of one state, or less.

    Told apart by read and shot noise alone.
    """
    read = sensor.noise.model_copy(update={"relative": 0.0})
    plain = sensor.model_copy(update={"noise": read})
    u = np.linspace(math.log(SPAN["low"]), math.log(SPAN["high"]), 4001)
    share = 1.0 / np.sqrt(1.0 + told_at(plain, scene, u))
    mass = math.sqrt(LEAST_INFORMATION) * float(integrate.simpson(share, x=u))
    return min(DARK_MASS / mass, 1.0)


def log_densities(
    sensor: Sensor, scene: dict[str, Any], reading: Array, u: Array, dark: float
) -> Array:
    """One frame's log density and that of the law."""
    mean, own = readings_at(sensor, u, scene)
    e, matrix = reading - mean.T, covariances(sensor, mean, own)
    solved = np.linalg.solve(matrix, e[:, :, None])[:, :, 0]
    square = np.einsum("nj,nj->n", e, solved)
    log_density = -0.5 * (square + np.log(np.linalg.det(matrix))) - math.log(2 * math.pi)
    told = told_at(sensor, scene, u)
    return np.asarray(log_density + np.log((told + dark) / np.sqrt(1.0 + told)))


def by_quadrature(sensor: Sensor, scene: dict[str, Any], reading: Array) -> float:
    """Integrate a frame over a grid that is graded around its best range."""
    low, high = math.log(SPAN["low"]), math.log(SPAN["high"])
    grid, dark = np.linspace(low, high, 800), dark_of(sensor, scene)
    for _ in range(3):
        values = log_densities(sensor, scene, reading, grid, dark)
        best = grid[int(np.argmax(values))]
        near = grid[values > values.max() - 20.0]
        width = float(np.ptp(near)) + 2 * (grid[1] - grid[0])  # seen, and what a step may hide
        grid = np.linspace(max(best - width, low), min(best + width, high), 1601)
    values = log_densities(sensor, scene, reading, grid, dark)
    return float(values.max() + math.log(integrate.simpson(np.exp(values - values.max()), x=grid)))


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("noise", [{}, {"shot": 1e-6, "relative": 0.01}])
@pytest.mark.parametrize("snr", [3.0, 300.0])
def test_a_frame_agrees_with_quadrature(
    kind: str, snr: float, noise: dict[str, float], behind: bool
) -> None:
    sensor = sensor_of(kind, snr, **noise)
    scene = {"object": OBJECT, "crosstalk": list(CROSSTALK), "range_m": SPAN}
    if behind:
        scene["background"] = WALL
    frames = data(sensor, {k: v for k, v in scene.items() if k != "range_m"}, 3, seed=3).frames
    found = density_of(sensor, scene, frames).frame_log_likelihoods(NOTHING)[0]
    wanted = [by_quadrature(sensor, scene, reading) for reading in frames.readings]
    # differences are good to 1e-9, the rule of a narrow peak to 1e-6
    np.testing.assert_allclose(found, wanted, atol=1e-5)


def test_only_the_distance_from_the_curve_counts(kind: str) -> None:
    """A weak signal, with less information on its range, is not preferred for it.

    Frames whose signals differ twenty thousandfold have one density, that of a point near
    a straight line.
    """
    sensor = sensor_of(kind, 1e5)
    frames = data(sensor, {}, 6, seed=2).frames
    clean = density_of(sensor, {"object": OBJECT, "range_m": SPAN}, frames)
    found = clean.frame_log_likelihoods(NOTHING)[0]
    read = sensor.noise.read
    # on the line: 1 / (2 pi s1 s2), times sqrt(2 pi) of the integral along it, less its chi-square
    top = -0.5 * math.log(2 * math.pi * LEAST_INFORMATION) - math.log(read[0] * read[1])
    assert (found < top + 1e-4).all()
    # six chi-squares of one degree: beyond 40 once in 1e6 runs
    assert -2 * (found - top).sum() < 40.0


@pytest.mark.parametrize("far", [8.0, 14.0])
def test_a_frame_in_the_dark_is_no_more_probable_than_another(kind: str, far: float) -> None:
    """Else crosstalk that alone explains some frames gains a factor with each of them.

    However far the law reaches: under sqrt(I0 + I) each gained 0.8 and 1.1 nat here.
    """
    count, sensor = 4000, sensor_of(kind, 10.0)
    scene = {"object": OBJECT, "range_m": {"prior": "reference", "low": 0.02, "high": far}}
    found = []
    for at in (0.15, far):
        path = SampledTrajectory(range_m=[at] * count)
        seen = simulate(sensor, parse_scene({"object": OBJECT, "discrepancy": 0}), path, 4).frames
        found.append(density_of(sensor, scene, seen).frame_log_likelihoods(NOTHING)[0])
    lit, dark = found
    # half of a chi-square of one degree and of one of two scatter by 0.7 and 1 nat a frame; the
    # curve itself, up to its end, adds a quarter to what is in the dark at most
    error = math.sqrt((0.5 + 1.0) / count)
    assert -4 * error < dark.mean() - lit.mean() < math.log(1.25) + 4 * error


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_units_do_not_matter(scale: float) -> None:
    sensor = sensor_of("pulsed", 300.0, shot=1e-6, relative=0.01)
    noise = {
        "read": [scale * x for x in sensor.noise.read],
        "shot": scale * 1e-6,
        "relative": 0.01,
    }
    other = sensor.model_copy(update={"gain": scale, "noise": sensor.noise.model_validate(noise)})
    frames = data(sensor, {"crosstalk": list(CROSSTALK)}, 6).frames
    scene = {"object": OBJECT, "crosstalk": list(CROSSTALK), "range_m": SPAN}
    scaled = {**scene, "crosstalk": [scale * x for x in CROSSTALK]}
    found = density_of(other, scaled, Frames(scale * frames.readings))(NOTHING)[0]
    wanted = density_of(sensor, scene, frames)(NOTHING)[0]
    assert found == pytest.approx(wanted - 12 * math.log(scale), abs=1e-5)


def test_a_gain_of_every_frame_is_a_gain_of_the_sensor(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of what ranges in the dark have together, which the table of the curve tells."""
    monkeypatch.setenv("KERNELS_COMPILE", "always")
    sensor, gain = sensor_of(kind, 10.0), 30.0
    scene: dict[str, Any] = {"object": OBJECT, "crosstalk": list(CROSSTALK)}
    path = SampledTrajectory(range_m=[0.3, 1.0, 3.0, 13.0, 13.5, 14.0])
    other = sensor.model_copy(update={"gain": gain})
    readings = simulate(other, parse_scene({**scene, "discrepancy": 0}), path, 6).frames.readings
    scene["range_m"] = {"prior": "reference", "low": 0.02, "high": 14.0}
    frames = Frames(readings, gain=np.full(len(readings), gain))
    found = density_of(sensor, scene, frames).frame_log_likelihoods(NOTHING)[0]
    wanted = density_of(other, scene, Frames(readings)).frame_log_likelihoods(NOTHING)[0]
    # two tables of one curve that differ by rounding
    np.testing.assert_allclose(found, wanted, atol=1e-6, rtol=1e-9)


def test_with_a_flux_error_and_little_noise() -> None:
    """Readings are then range and flux; the law of the ranges cancels their Jacobian."""
    sensor = sensor_of("pulsed", 1e4)
    assert isinstance(sensor, PulsedSensor)
    scene = {"object": OBJECT, "crosstalk": [0.0, 0.0], "range_m": SPAN}
    frames = data(sensor, {"discrepancy": 0.05}, 7, seed=7, span=(0.4, 1.2)).frames
    w1, w2 = frames.readings.T
    r = sensor.r0 * w1 / w2
    c0, c1, c2 = C
    quadratic = r**2 + c1 * r + c0
    delta = np.log(w2 * r**2 * quadratic / (c0 * c2))
    slope = 2 + r * (2 * r + c1) / quadratic
    read = sensor.noise.read
    blur = (slope / w1 * read[0]) ** 2 + ((1 - slope) / w2 * read[1]) ** 2
    covariance_of_path = matern_path_covariance(np.log(r), 0.05) + np.diag(blur)
    path = stats.multivariate_normal(np.zeros(7), covariance_of_path).logpdf(delta)
    resolution = np.hypot((1 - slope) * w1 / read[0], slope * w2 / read[1])
    wanted = path + np.log(resolution / math.sqrt(LEAST_INFORMATION)).sum() - np.log(w1 * w2).sum()
    found = with_discrepancy(density_of(sensor, scene, frames), 0.05)(NOTHING)[0]
    # the slope of the error, of the order of 0.05 times sqrt(5/3), changes the resolution by its
    # share of the whole slope in each frame, and frames share it; without the prior's resolution
    # the two would be 7 log(1000), 48 nats, apart
    allowed = 7 * 2 * 0.05 * math.sqrt(5 / 3) / 2.5
    assert found == pytest.approx(wanted, abs=allowed)


def test_a_vanishing_error_leaves_the_plain_density(kind: str) -> None:
    sensor = sensor_of(kind)
    scene = {"crosstalk": UNKNOWN_CROSSTALK, "range_m": SPAN}
    frames = data(sensor, {"crosstalk": list(CROSSTALK)}, 12).frames
    plain = collapsed_density(sensor, parse_scene(scene), frames)
    natural = np.array([[*C, *CROSSTALK]])
    z = plain.parameters.standard(natural) + 1e-5 * np.random.default_rng(1).normal(size=(5, 5))
    found = with_discrepancy(plain, 1e-9)(z)
    np.testing.assert_allclose(found, plain(z), atol=2e-3, rtol=1e-9)


def test_a_range_is_drawn_from_what_is_integrated(kind: str) -> None:
    sensor = sensor_of(kind, 20.0)
    scene = {"object": OBJECT, "crosstalk": list(CROSSTALK), "range_m": SPAN}
    frames = data(sensor, {"crosstalk": list(CROSSTALK)}, 1, seed=4, span=(0.8, 0.9)).frames
    density = density_of(sensor, scene, frames)
    drawn = density.draw_log_ranges(np.empty((4000, 0)), np.random.default_rng(5))[:, 0]
    u = np.linspace(math.log(SPAN["low"]), math.log(SPAN["high"]), 3001)
    mass = np.exp(log_densities(sensor, scene, frames.readings[0], u, dark_of(sensor, scene)))
    law = np.concatenate([[0.0], np.cumsum(mass[1:] + mass[:-1])])
    # one test in a thousand fails by chance, and the seed is fixed
    assert stats.kstest(drawn, lambda x: np.interp(x, u, law / law[-1])).pvalue > 1e-3


def test_an_impossible_support_is_named() -> None:
    with pytest.raises(InvalidInputError, match="/range_m"):
        parse_scene({"range_m": {"prior": "reference", "low": 2.0, "high": 1.0}})


WALL_BEHIND = {"strength": 0.0177, "distance_m": 3.0, "shadow": "object"}
OPEN_WALL = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.5},
    "shadow": "object",
}
DISTANCE = "background.distance_m"


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [pytest.param("loguniform", marks=pytest.mark.thorough), "reference"]
)
def test_an_object_at_constant_speed_before_a_wall(law: str) -> None:
    """Independent draws of a wide law are not what moves: what only that law tells is said.

    Of an exact model, since an error of the model may be larger than what the law tells.
    """
    sensor = parse_sensor({**KINDS["pulsed"], "noise": {"read": [9.3e-6, 9.3e-6]}})
    count = 40 if law == "loguniform" else 16  # the law tells the more, the more frames there are
    path = RadialTrajectory(from_m=0.2, to_m=2.0, frames=count, spacing="linear")
    made = simulate(sensor, parse_scene({"object": OBJECT, "background": WALL_BEHIND}), path, 1)
    stated = {"background": OPEN_WALL, "range_m": {**SPAN, "prior": law}, "discrepancy": 0}
    scene = parse_scene(stated)
    settings = SamplerSettings(method="auto", seed=1, ensembles=2)
    found = infer(sensor, scene, made.frames, settings)
    rows = {row.parameter: row for row in found.identifiability}
    if law == "loguniform":
        assert rows[DISTANCE].status == rows["range_m"].status == "weak"
        assert "The readings by themselves would tell it only to" in rows[DISTANCE].reason
        return
    assert found.verdict.converged
    wall = found.parameters[DISTANCE]
    # a normal variate beyond four standard deviations once in 16,000 data sets
    assert abs(wall.mean - 3.0) < 4 * wall.sd
    assert "by themselves" not in rows[DISTANCE].reason
    # what the wall leaves open all ranges share: one variate for all, as above
    low, middle, high = found.range_m.q05, found.range_m.q50, found.range_m.q95
    assert np.max(np.abs(middle - made.range_m) / (high - low)) < 4 / (2 * 1.6449)
