"""Stated errors of the model, from 1e-12 to beyond all sense: none, or all that counts."""

from typing import Any

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.estimate import estimate
from inference.tracking.track import track
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory
from tests.extreme.tracks import holes_of
from tests.fits.scenes import OBJECT, VAGUE, WALL, sensor_of

PATH = SampledTrajectory(
    range_m=np.linspace(0.3, 2.0, 8).tolist(), time_s=(0.05 * np.arange(8)).tolist()
)
LAW = {"prior": "loguniform", "low": 0.1, "high": 2.9}
SIZES = (1e-12, 1e-9, 1e-6, 1e-3, 1.0)
ALONE = ("flux", "range_m")
SCENES: dict[str, dict[str, Any]] = {"object": {}, "wall": {"background": WALL}}
TECHNIQUES = {
    "object": ["conventional", "intensity"],
    "wall": ["background_cancelling", "background_intensity"],
}


def frames_of(sensor: Sensor, **terms: Any) -> Frames:
    truth = parse_scene({"object": OBJECT, "discrepancy": 0, **terms})
    return simulate(sensor, truth, PATH, 1).frames


def sizes(name: str, size: float) -> dict[str, float]:
    return {"flux": 0.0, "range_m": 0.0, name: size}


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("where", SCENES)
@pytest.mark.parametrize("name", ALONE)
def test_of_single_frames_they_are_nothing_or_everything(kind: str, where: str, name: str) -> None:
    """The budget's part of the model goes with the size of the error; the ranges do not move."""
    sensor = sensor_of(kind, 1e4)
    frames = frames_of(sensor, **SCENES[where])
    scene = {"object": OBJECT, **SCENES[where], "range_m": LAW}

    def answers(errors: object) -> Any:
        document = parse_scene({**scene, "discrepancy": errors})
        return estimate(sensor, document, frames, TECHNIQUES[where]).results

    for k, exact in enumerate(answers(0)):
        for size in SIZES:
            found = answers(sizes(name, size))[k]
            np.testing.assert_array_equal(found.roots_m, exact.roots_m)
            said = np.isfinite(found.roots_sd_m) | ~np.isfinite(found.roots_m)
            assert said.all() or found.near_fold[~said.all(axis=1)].all()
            assert found.sd_parts_m is not None
            own, model = found.roots_sd_m, found.sd_parts_m.model
            known = np.isfinite(own)
            assert ((model[known] >= 0) & (model[known] <= own[known])).all()
            if size == SIZES[0]:
                np.testing.assert_allclose(own, exact.roots_sd_m, rtol=1e-3)
        big = sizes(name, SIZES[-1])
        twice = {key: 2 * value for key, value in big.items()}
        one, two = answers(big)[k], answers(twice)[k]
        told = np.isfinite(one.roots_sd_m) & np.isfinite(two.roots_sd_m)
        told &= one.sd_parts_m.model > 100 * exact.roots_sd_m
        np.testing.assert_allclose(two.roots_sd_m[told], 2 * one.roots_sd_m[told], rtol=1e-3)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("name", ALONE)
def test_of_the_density_they_are_nothing_or_everything(kind: str, name: str) -> None:
    """Vanishing they leave it; as they grow what the readings tell of crosstalk only falls."""
    sensor = sensor_of(kind, 1e3)
    frames = frames_of(sensor)
    scene = {"object": OBJECT, "crosstalk": [VAGUE, VAGUE], "range_m": LAW}
    z = np.array([[0.0, 0.0], [0.02, -0.02]])

    def density(errors: object) -> Any:
        document = parse_scene({**scene, "discrepancy": errors})
        return collapsed_density(sensor, document, frames).log_likelihood(z)

    exact = density(0)
    assert np.isfinite(exact).all()
    drops = []
    for size in SIZES:
        found = density(sizes(name, size))
        assert np.isfinite(found).all(), size
        drops.append(float(found[0] - found[1]))
        if size == SIZES[0]:
            np.testing.assert_allclose(found, exact, atol=1e-3)
    assert drops[-1] <= drops[0] + 1e-3


@pytest.mark.parametrize(("kind", "name"), [("pulsed", "range_m"), ("sine_wave", "flux")])
def test_of_a_fit_they_are_nothing_or_everything(kind: str, name: str) -> None:
    sensor = sensor_of(kind, 1e5)
    frames = frames_of(sensor)
    scene = {"object": OBJECT, "crosstalk": [VAGUE, VAGUE], "range_m": LAW}

    def fitted(errors: object) -> Any:
        document = parse_scene({**scene, "discrepancy": errors})
        found = estimate(sensor, document, frames, ["joint_fit"])
        return found.results[0] if found.results else found.left_out[0].reason

    exact = fitted(0)
    widths = []
    for size in (SIZES[0], SIZES[-1]):
        found = fitted(sizes(name, size))
        if isinstance(found, str):
            assert found
            continue
        told = np.isfinite(found.sd_m)
        assert (found.sd_m[told] > 0).all()
        assert np.isfinite(found.range_m[told]).all()
        # a range that all else leaves open has a reason and no standard deviation
        assert (told | (found.reason > 0) | found.near_fold).all()
        widths.append(float(np.nanmedian(found.sd_m / found.range_m)))
        if size == SIZES[0]:
            np.testing.assert_allclose(found.sd_m, exact.sd_m, rtol=0.02)
    assert widths == sorted(widths)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("name", ALONE)
def test_of_a_track_they_are_nothing_or_everything(kind: str, name: str) -> None:
    sensor = sensor_of(kind, 1e4)
    frames = frames_of(sensor)
    scene = {"object": OBJECT, "range_m": LAW}
    exact = track(sensor, parse_scene({**scene, "discrepancy": 0}), frames)
    widths = []
    for size in SIZES:
        # at 5 MHz a metre turns a sine wave by a fifth of a radian: none is refused
        found = track(sensor, parse_scene({**scene, "discrepancy": sizes(name, size)}), frames)
        assert not holes_of(found)
        widths.append(float(np.nanmedian(found.best_sd_m / found.best_m)))
        if size == SIZES[0]:
            assert (np.abs(found.best_m - exact.best_m) < 0.02 * exact.best_sd_m).all()
            np.testing.assert_allclose(found.best_sd_m, exact.best_sd_m, rtol=0.01)
    assert widths[0] <= widths[-1]
