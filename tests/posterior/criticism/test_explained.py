"""What refutes the model and is no larger error of what scenes allow leaves nothing identified."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

FRAMES, SPAN = 30, (0.2, 1.2)
WHY = "that no larger noise or smooth error explains"
Array = NDArray[np.float64]
Spoil = Callable[[Array, Array], None]  # of readings and their read noise, in place


def answer(kind: str, spoil: Spoil) -> Posterior:
    sensor = sensor_of(kind, 100.0)
    seen = data(sensor, {"discrepancy": 0.02}, FRAMES, seed=1, span=SPAN)
    readings = seen.frames.readings.copy()
    spoil(readings, np.asarray(sensor.noise.read))
    settings = SamplerSettings(method="auto", seed=1, max_seconds=30.0)
    return infer(sensor, parse_scene({}), Frames(readings), settings)


def outlier(readings: Array, _: Array) -> None:
    readings[10] *= 1.3


def drift(readings: Array, read: Array) -> None:
    readings += np.linspace(0.0, 20.0, len(readings))[:, None] * read * np.array([0.4, 1.0])


def more_noise(times: float, seed: int) -> Spoil:
    def spoil(readings: Array, read: Array) -> None:
        rng = np.random.default_rng(seed)
        readings += math.sqrt(times**2 - 1.0) * read * rng.standard_normal(readings.shape)

    return spoil


@pytest.mark.parametrize(
    ("kind", "spoil"), [("sine_wave", outlier), ("pulsed", outlier), ("pulsed", drift)]
)
def test_readings_that_no_larger_error_explains_leave_nothing_identified(
    kind: str, spoil: Spoil
) -> None:
    """Ranges were up to 25 sd off, and `identified` beside the misfit."""
    found = answer(kind, spoil)
    assert found.fit.misfit
    rows = {row.parameter: row for row in found.identifiability}
    assert "identified" not in {row.status for row in rows.values()}
    assert WHY in rows["range_m"].reason


@pytest.mark.parametrize(("times", "seed"), [(1.8, 14), (4.1, 11), (4.1, 15), (6.1, 12)])
def test_noise_that_is_larger_than_stated_explains_itself(times: float, seed: int) -> None:
    """A fit takes it for an error of the flux, which alone left ranges up to 12 sd off.

    Of thirty normal ranges one is beyond 4 sd in 2 of 1,000 sets.
    """
    found = answer("sine_wave", more_noise(times, seed))
    truth = data(sensor_of("sine_wave", 100.0), {}, FRAMES, seed=1, span=SPAN).range_m
    assert found.fit.misfit
    rows = {row.parameter: row for row in found.identifiability}
    assert rows["range_m"].status == "identified"
    assert not any(WHY in row.reason for row in rows.values())
    assert any("is as wide as noise" in reason for reason in found.fit.reasons)
    assert np.abs((found.range_m.mean - truth) / found.range_m.sd).max() < 4.0


def test_an_error_far_above_the_one_that_is_integrated_leaves_nothing_identified() -> None:
    """What is stated in numbers gets no room: intervals are as narrow as it makes them."""
    sensor, truth = sensor_of("pulsed"), {"crosstalk": [0.002, 0.01], "discrepancy": 0.3}
    frames = data(sensor, truth, 10, seed=3, span=(0.4, 1.2)).frames
    amplitude = {"prior": "lognormal", "median": OBJECT["c2"], "sigma": 0.3}
    scene = {"object": {**OBJECT, "c2": amplitude}, "crosstalk": [0.002, 0.01]}
    settings = SamplerSettings(method="auto", seed=1, max_seconds=30.0)
    found = infer(sensor, parse_scene({**scene, "discrepancy": 0.01}), frames, settings)
    assert found.fit.misfit
    rows = {row.parameter: row for row in found.identifiability}
    assert "identified" not in {row.status for row in rows.values()}
    assert "larger than stated" in rows["range_m"].reason
