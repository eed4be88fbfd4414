"""What noise does to single frames, against laws that are exact or follow from one derivative."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimate import all_roots, estimate
from inference.estimates import Status, TechniqueResult
from inference.realtime.net import Form, Net
from inference.realtime.windows import Windows, differences
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, parse_sensor

Array = NDArray[np.float64]
C0, C1, C2 = 0.0769, -0.123, 0.0957
OBJECT = {"c0": C0, "c1": C1, "c2": C2}
RANGES = np.array([0.2, 0.5, 1.1, 2.5])


def pulsed(read: float = 1e-12, **noise: Any) -> PulsedSensor:
    whole = {"read": [read, read], **noise}
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": whole})
    assert isinstance(sensor, PulsedSensor)
    return sensor


def readings(sensor: PulsedSensor, r: Array) -> Array:
    flux = C0 * C2 / (r**2 * (r**2 + C1 * r + C0))
    return np.column_stack([flux * r / sensor.r0, flux])


def log_slope(r: Array) -> Array:
    """Of the flux, d log Phi / d log r."""
    return -(2 + r * (2 * r + C1) / (r**2 + C1 * r + C0))


def answer(
    sensor: PulsedSensor, scene: dict[str, Any], frames: Frames, name: str
) -> TechniqueResult:
    (result,) = estimate(sensor, parse_scene(scene), frames, [name]).results
    assert (result.status == Status.UNIQUE).all()
    return result


def test_the_late_share_of_counted_photons_is_binomial() -> None:
    """Late photons are part of the whole: of n photons a share q has variance q (1 - q) / n."""
    shot = 1e-8  # many photons: noise follows the tangent
    sensor = pulsed(1e-15, shot=shot)
    frames = Frames(readings(sensor, RANGES))
    found = answer(sensor, {"discrepancy": 0}, frames, "conventional")
    share = RANGES / sensor.r0
    expected = sensor.r0 * np.sqrt(share * (1 - share) * shot / frames.readings[:, 1])
    np.testing.assert_allclose(found.sd_m[:], expected, rtol=1e-6)


def test_the_variance_of_a_form_is_that_of_linear_algebra() -> None:
    one, g = np.ones(2), np.array([[3.0, -2.0], [0.5, 4.0]])
    net = Net(one, one, 4 * one, 9 * one, 3 * one, 0.0, np.zeros(2, dtype=np.uint8))
    matrix = np.array([[4.0, 3.0], [3.0, 9.0]])
    expected = np.einsum("in,ij,jn->n", g, matrix, g)
    np.testing.assert_allclose(net.variance(g[0], g[1]), expected, rtol=1e-15)
    of_forms = net.covariance(Form(3.0, 0.5), Form(-2.0, 4.0))
    np.testing.assert_allclose(of_forms, np.full(2, g[:, 0] @ matrix @ g[:, 1]), rtol=1e-15)


@pytest.mark.parametrize("name", ["conventional", "intensity"])
@pytest.mark.parametrize("factor", [0.25, 8.0])
def test_a_frame_of_another_gain_has_noise_less_by_that_gain(factor: float, name: str) -> None:
    # so little noise that the standard deviation is that of the tangent
    sensor = pulsed(1e-8)
    scene = {"object": OBJECT, "discrepancy": 0}
    plain = Frames(readings(sensor, RANGES))
    moved = Frames(factor * plain.readings, gain=np.full(len(plain), factor))
    before = answer(sensor, scene, plain, name)
    after = answer(sensor, scene, moved, name)
    np.testing.assert_allclose(after.range_m, before.range_m, rtol=1e-14)
    np.testing.assert_allclose(after.sd_m, before.sd_m / factor, rtol=1e-12)


def test_parts_of_an_error_add_in_squares() -> None:
    sensor = pulsed(2e-7)
    frames = Frames(readings(sensor, RANGES))
    found = answer(sensor, {"object": OBJECT}, frames, "intensity")
    assert found.sd_parts_m is not None
    noise, model = found.sd_parts_m.noise[:, 0], found.sd_parts_m.model[:, 0]
    assert (noise > 0).all()
    assert (model > 0).all()
    np.testing.assert_allclose(found.sd_m, np.hypot(noise, model), rtol=1e-14)


def test_relative_noise_moves_the_range_of_the_light_by_the_slope() -> None:
    relative = 1e-4
    sensor = pulsed(1e-15, relative=relative)
    frames = Frames(readings(sensor, RANGES))
    found = answer(sensor, {"object": OBJECT, "discrepancy": 0}, frames, "intensity")
    np.testing.assert_allclose(found.sd_m, relative * RANGES / np.abs(log_slope(RANGES)), rtol=1e-6)


@pytest.mark.parametrize("name", ["conventional", "intensity"])
def test_a_reading_at_full_scale_is_saturated_and_one_below_is_not(name: str) -> None:
    sensor = pulsed(1e-6)
    pair = readings(sensor, np.array([0.5]))
    for k, reading in enumerate(pair[0]):
        scale = [1.0, 1.0]
        for limit, status in (
            (reading, Status.SATURATED),
            (math.nextafter(reading, math.inf), Status.UNIQUE),
        ):
            scale[k] = float(limit)
            limited = sensor.model_copy(update={"full_scale": tuple(scale)})
            scene = parse_scene({"object": OBJECT})
            (result,) = estimate(limited, scene, Frames(pair), [name]).results
            assert result.status[0] == status


def test_the_noise_of_readings_is_part_of_the_distortion() -> None:
    """zeta is (w1' / w1) / (w2' / w2): with exact rates its error is that of log(w2 / w1)."""
    read = 1e-7
    sensor = pulsed(read, derivative=[1e-16, 1e-16])
    flux, late = readings(sensor, RANGES)[:, 1], readings(sensor, RANGES)[:, 0]
    rates = np.column_stack([late * (1 + log_slope(RANGES)), flux * log_slope(RANGES)])
    frames = Frames(np.column_stack([late, flux]), derivatives=0.1 / RANGES[:, None] * rates)
    scene = {"object": OBJECT, "discrepancy": 0}
    found = answer(sensor, scene, frames, "differential")
    assert found.zeta is not None
    assert found.zeta_sd is not None
    zeta = 1 + 1 / log_slope(RANGES)
    np.testing.assert_allclose(found.zeta, zeta, rtol=1e-9)
    expected = np.abs(zeta) * read * np.hypot(1 / late, 1 / flux)
    np.testing.assert_allclose(found.zeta_sd, expected, rtol=1e-6)


def test_bounds_of_an_unknown_object_are_those_of_its_distortion() -> None:
    """zeta lies in 0.485 to 0.754 for s >= -0.648; the range is r0 w1' / w2' over it (4.66).

    Two standard deviations of noise besides, of first order: of the second the square of 5e-11.
    """
    sensor = pulsed(1e-9, derivative=[1e-12, 1e-12])
    frames = Frames(np.array([[1.0, 2.0]]), derivatives=np.array([[0.02, 0.5]]))
    (found,) = estimate(sensor, parse_scene({"discrepancy": 0}), frames, ["differential"]).results
    assert found.range_bounds_m is not None
    ratio = sensor.r0 * 0.02 / 0.5
    noise = 2 * sensor.r0 * 1e-12 / 0.5 * np.hypot(1.0, 0.02 / 0.5)
    expected = [[(ratio - noise) / 0.754, (ratio + noise) / 0.485]]
    np.testing.assert_allclose(found.range_bounds_m, expected, rtol=1e-14)


@pytest.mark.parametrize("at", range(5))
def test_noise_of_a_derivative_counts_the_frames_own_reading(at: int) -> None:
    """Lagrange's weights of five readings; a straight line has no bias to be added."""
    weights = {
        0: (-25 / 12, 4, -3, 4 / 3, -1 / 4),
        1: (-1 / 4, -5 / 6, 3 / 2, -1 / 2, 1 / 12),
        2: (1 / 12, -2 / 3, 0, 2 / 3, -1 / 12),
        3: (-1 / 12, 1 / 2, -3 / 2, 5 / 6, 1 / 4),
        4: (1 / 4, -4 / 3, 3, -4, 25 / 12),
    }[at]
    t = 0.1 * np.arange(5.0)
    one = np.ones(5)
    line = np.arange(5.0)  # whole numbers: nothing is rounded
    net = Net(line, 2 * line, 4 * one, 9 * one, 3 * one, 0.0, np.zeros(5, dtype=np.uint8))
    out = Windows(*(np.full(5, np.nan) for _ in range(6)))
    differences(np.asarray(t, dtype=np.float64), net, None, False, out)
    square = sum(w * w for w in weights) / 0.01
    np.testing.assert_allclose(
        [out.first[at], out.second[at], out.var1[at], out.var2[at], out.cov[at]],
        [10.0, 20.0, 4 * square, 9 * square, 3 * square],
        rtol=1e-9,
    )


@pytest.mark.parametrize(("share", "count"), [(0.1, 1), (-0.1, 0)])
def test_an_object_that_takes_light_away_is_no_answer(share: float, count: int) -> None:
    """The object's light is a share of the wall's: negative, only the equation is solved."""
    sensor = pulsed(1e-9)
    strength, far, r = 0.02, 3.0, 1.0
    wall = {"strength": strength, "distance_m": far, "shadow": {"c0": 0.056, "c1": 0.013}}
    seen = r * (r + 0.013) / (r * (r + 0.013) + 0.056) * strength
    light = share * strength
    frames = Frames(np.array([[(light * r + seen * far) / sensor.r0, light + seen]]))
    scene = parse_scene({"background": wall, "discrepancy": 0})
    every = all_roots("background_intensity", sensor, scene, frames)
    assert np.nanmin(np.abs(every.roots_m[0] - r)) < 1e-9
    (found,) = estimate(sensor, scene, frames, ["background_intensity"]).results
    near = np.abs(found.roots_m[0] - r) < 1e-9
    assert np.count_nonzero(near) == count
