"""A root that errors move out of where ranges are looked for leaves its place behind, not another.

Before a sine wave's wall more than half a turn of phase away a frame of the bare wall is also that
of an object at the wall, and of one much nearer. Noise puts the first beyond the wall in half of
the frames: the second alone was then said to be the range.
"""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom, norm

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from simulator.background import shadow
from simulator.frames import Frames
from simulator.model_error import RANGE_ERROR_SD
from simulator.object_arrays import object_fluxes
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import SineWaveSensor, parse_sensor
from simulator.shadow_error import SHADOW_SD
from simulator.simulate import mean_readings

Array = NDArray[np.float64]

PLATE = {"c0": 0.0817, "c1": 0.0574, "c2": 0.103}
SHADOW = {"c0": 0.0596, "c1": 0.0132}
B, READ = 0.0075, 5e-6
UNKNOWN = {"prior": "lognormal", "median": B, "sigma": 0.3}
FAR_END, FOLD = 4.5, 3.0  # standard deviations
# technique, frequency, distance of the wall: each with one root of the bare wall beside that at it
WALLS = [
    ("background_cancelling", 2e7, 5.0),
    ("background_cancelling", 6e7, 2.0),
    ("background_intensity", 6e7, 3.0),
    ("background_intensity", 6e7, 4.5),
]


def sensor_of(frequency: float, read: float = READ) -> SineWaveSensor:
    document = {"kind": "sine_wave", "frequency_hz": frequency, "noise": {"read": [read, read]}}
    sensor = parse_sensor(document)
    assert isinstance(sensor, SineWaveSensor)
    return sensor


def asked(
    technique: str, sensor: SineWaveSensor, distance: float, readings: Array, **more: Any
) -> TechniqueResult:
    wall: dict[str, Any] = {"strength": B, "distance_m": distance, "shadow": SHADOW}
    if technique == "background_cancelling":
        wall["strength"] = UNKNOWN
    scene = parse_scene({"object": PLATE, "background": wall, **more})
    return estimate(sensor, scene, Frames(readings), [technique]).results[0]


def noisy(z: Array, n: int, seed: int, read: float = READ) -> Array:
    means = np.broadcast_to(np.column_stack([z.real, z.imag]), (n, 2))
    return np.asarray(means + read * np.random.default_rng(seed).normal(size=(n, 2)))


def with_object(sensor: SineWaveSensor, distance: float, r: float) -> Array:
    wall = {"strength": B, "distance_m": distance, "shadow": SHADOW}
    terms = parameters_of(sensor, parse_scene({"object": PLATE, "background": wall}))
    means = mean_readings(sensor, terms.terms(np.zeros((1, 0))), np.array([r]))
    return np.asarray(means[:, 0] + 1j * means[:, 1])


@pytest.mark.parametrize(("technique", "frequency", "distance"), WALLS)
@pytest.mark.parametrize("at", [0.96, 0.99, None])
def test_what_is_at_the_wall_is_no_near_object(
    technique: str, frequency: float, distance: float, at: float | None
) -> None:
    """Sure and wrong only where noise is beyond 4.5 sd: once in 1e6 runs more often than that."""
    sensor, n = sensor_of(frequency), 4000
    wall = np.array([B * np.exp(1j * sensor.wave_number * distance)])
    z = wall if at is None else with_object(sensor, distance, at * distance)
    found = asked(technique, sensor, distance, noisy(z, n, seed=9), discrepancy=0)
    sure = (found.status == Status.UNIQUE) & ~found.near_fold
    truth = distance if at is None else at * distance
    wrong = sure & (np.abs(found.range_m - truth) > 5 * found.sd_m)
    assert wrong.sum() <= binom.isf(1e-6, n, norm.sf(FAR_END))
    assert (found.status != Status.NONE).all()


@pytest.mark.parametrize(("technique", "frequency", "distance"), WALLS)
@pytest.mark.parametrize("exact", [True, False])
def test_the_wall_is_listed_as_far_as_errors_reach(
    technique: str, frequency: float, distance: float, exact: bool
) -> None:
    """Against what is across the wall's own direction, as it is, and the errors of that alone."""
    sensor = sensor_of(frequency)
    k, flux = sensor.wave_number, B * (1 - shadow(distance, **SHADOW))
    if technique == "background_cancelling":
        flux = object_fluxes(np.array([distance]), PLATE["c0"] * PLATE["c2"], 0.0817, 0.0574)[0]
    reach = READ
    if not exact:
        seen = shadow(distance, **SHADOW)
        # of unknown strength: what the readings leave for the wall
        light = B - flux if technique == "background_cancelling" else B * seen
        by_shadow = SHADOW_SD * light * k * distance * (1 - seen)
        reach = float(np.hypot(np.hypot(READ, k * RANGE_ERROR_SD * flux), by_shadow))
    across = np.linspace(-6.0, 6.0, 240) * reach  # no step is on an end
    z = (B + 1j * across) * np.exp(1j * k * distance)
    more: dict[str, Any] = {"discrepancy": 0} if exact else {}
    found = asked(technique, sensor, distance, np.column_stack([z.real, z.imag]), **more)
    listed = (np.abs(found.roots_m - distance) < 1e-12 * distance).any(axis=1)
    expected = (across > 0) & (across < FAR_END * reach)
    np.testing.assert_array_equal(listed, expected)
    assert found.near_fold[expected].all()
    assert (found.status[expected] == Status.AMBIGUOUS).all()
    assert (found.status[across > FAR_END * reach] == Status.UNIQUE).all()
    last = np.take_along_axis(found.roots_sd_m, found.root_count[:, None] - 1, axis=1)[:, 0]
    assert np.isnan(last[expected]).all()


@pytest.mark.parametrize(
    ("technique", "frequency", "distance", "r"),
    [
        ("background_cancelling", 2e7, 5.0, 0.7),
        ("background_cancelling", 2e7, 5.0, 1.0),
        ("background_intensity", 6e7, 3.0, 1.5),
        ("background_intensity", 2e7, 5.0, 4.0),
    ],
)
def test_objects_well_before_the_wall_are_told_as_ever(
    technique: str, frequency: float, distance: float, r: float
) -> None:
    """5 sd on 1000 frames: a false alarm in 1700 runs; none of them is anything but unique."""
    sensor = sensor_of(frequency)
    z = with_object(sensor, distance, r)
    found = asked(technique, sensor, distance, noisy(z, 1000, seed=2), discrepancy=0)
    assert (found.status == Status.UNIQUE).all()
    assert (np.abs(found.range_m - r) < 5 * found.sd_m).all()


def test_a_root_that_noise_moves_out_of_the_scenes_ranges_is_put_at_their_end() -> None:
    """Against the roots of the same frames without an end."""
    sensor, high, n = sensor_of(2e7, 5e-7), 4.0, 2000
    readings = noisy(with_object(sensor, 5.0, 3.99), n, seed=4, read=5e-7)
    free = asked("background_cancelling", sensor, 5.0, readings, discrepancy=0)
    ends = {"prior": "reference", "low": 0.2, "high": high}
    found = asked("background_cancelling", sensor, 5.0, readings, discrepancy=0, range_m=ends)
    beyond = (free.roots_m > high) & (free.roots_m - high < FOLD * free.roots_sd_m)
    lost = beyond.any(axis=1)
    assert lost.sum() > n / 10
    assert (found.status[lost] == Status.AMBIGUOUS).all()
    assert (found.near_fold == lost).all()
    assert (found.roots_m[lost, 1] == high).all()
    assert np.isnan(found.roots_sd_m[lost, 1]).all()
    np.testing.assert_array_equal(found.roots_m[~lost], free.roots_m[~lost])


def test_derivatives_lose_no_range_beyond_the_wall() -> None:
    """Of a pulse: 3 sd, as of a fold; without the end every sixth frame was sure and wrong."""
    n, distance, strength, width = 3000, 3.0, 0.02, 1e-7
    r0 = 299792458.0 * width / 2
    r = np.full(n, 0.99 * distance)
    flux = object_fluxes(r, PLATE["c0"] * PLATE["c2"], PLATE["c0"], PLATE["c1"])
    q, far = r * (r + PLATE["c1"]) + PLATE["c0"], r * (r + SHADOW["c1"]) + SHADOW["c0"]
    slope = flux / r * (-2.0 - r * (2.0 * r + PLATE["c1"]) / q)
    seen = strength * SHADOW["c0"] * (2.0 * r + SHADOW["c1"]) / far / far
    rates = np.column_stack([(flux + r * slope + distance * seen) / r0, slope + seen])
    sd = float(1e-3 * np.abs(rates).max())
    rates += sd * np.random.default_rng(1).normal(size=rates.shape)
    noise = {"read": [1e-9, 1e-9], "derivative": [sd, sd]}
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": width, "noise": noise})
    wall = {"strength": strength, "distance_m": distance, "shadow": SHADOW}
    constant = [{"prior": "normal", "mean": 0.0, "sd": 1.0}] * 2
    scene = parse_scene(
        {"object": PLATE, "background": wall, "crosstalk": constant, "discrepancy": 0}
    )
    frames = Frames(np.column_stack([flux * r / r0, flux]), derivatives=rates)
    (found,) = estimate(sensor, scene, frames, ["background_cancelling_differential"]).results
    sure = (found.status == Status.UNIQUE) & ~found.near_fold
    wrong = sure & (np.abs(found.range_m - r) > 5 * found.sd_m)
    assert wrong.sum() <= binom.isf(1e-6, n, norm.sf(FOLD))
    assert (found.status == Status.AMBIGUOUS).mean() > 0.9
