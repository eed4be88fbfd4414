"""Empty frames that scatter by more than the stated noise are told of in `assumptions`."""

from typing import Any

import numpy as np
import pytest

from inference.empty_scatter import scatter_of_empty
from inference.estimate import estimate
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

READ = (2e-5, 1e-3)
SHOT = 1e-6
LIGHT = np.array([0.004, 0.4])
KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 2e7},
}


def sensor_of(kind: str, stated: float = 1.0) -> Sensor:
    noise = {"read": [stated * sd for sd in READ], "shot": stated**2 * SHOT}
    return parse_sensor({**KINDS[kind], "noise": noise})


def after(bare: np.ndarray[Any, Any], **more: Any) -> Frames:
    """Empty frames, and one with the object behind them."""
    present = np.array([False] * len(bare) + [True])
    return Frames(np.vstack([bare, [[0.1, 2.0]]]), object_present=present, **more)


def said(kind: str, bare: np.ndarray[Any, Any], stated: float = 1.0, **more: Any) -> list[str]:
    """What is said of the noise after empty frames and one with the object."""
    # nothing else is asked of the empty frames: their light is unknown
    unknown = {"prior": "normal", "mean": 0.0, "sd": 1.0}
    scene = parse_scene({"crosstalk": [unknown, unknown]})
    told = estimate(sensor_of(kind, stated), scene, after(bare, **more)).assumptions
    return [text for text in told if "scatter" in text]


def drawn(kind: str, rng: np.random.Generator, n: int) -> np.ndarray[Any, Any]:
    """Empty frames; of a pulse the late photons are part of the whole."""
    shot = np.sqrt(SHOT * LIGHT)
    if kind == "pulsed":
        late, early = shot[0], np.sqrt(SHOT * (LIGHT[1] - LIGHT[0]))
        a, b = late * rng.standard_normal(n), early * rng.standard_normal(n)
        photons = np.column_stack([a, a + b])
    else:
        photons = shot * rng.standard_normal((n, 2))
    return np.asarray(LIGHT + photons + READ * rng.standard_normal((n, 2)))


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_noise_that_is_stated_too_small(kind: str) -> None:
    """Twice too small: 50 degrees of freedom scatter like 200 +- 40 where 119 are 1e-6."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        bare = drawn(kind, rng, 26)
        assert said(kind, bare) == []
        assert said(kind, bare, stated=3.0) == []
        (told,) = said(kind, bare, stated=1 / 3)
        assert "the 26 empty frames (object_present false) scatter" in told
        # of the three that it is, known to a seventh
        assert 1.8 < float(told.split("w2 " if kind == "pulsed" else "q ")[1].split(" ")[0]) < 4.2


def test_few_healthy_frames_say_nothing() -> None:
    """2,000 sets: false alarm 2e-3."""
    rng, sensor = np.random.default_rng(4), sensor_of("pulsed")
    for n in (1, 2, 3, 5):
        for _ in range(500):
            assert scatter_of_empty(sensor, after(drawn("pulsed", rng, n))) is None


def test_crosstalk_that_changed_between_first_and_last() -> None:
    """By ten standard deviations: the same sum of squares as of 5 frames is 5 * 100 / 2."""
    rng = np.random.default_rng(5)
    bare = drawn("sine_wave", rng, 10)
    bare[5:, 1] += 1e-2
    (told,) = said("sine_wave", bare)
    assert "or crosstalk has changed" in told


def test_light_that_follows_a_gain_is_no_scatter() -> None:
    gains = np.array([1.0, 2.0, 1.0, 2.0, 1.0])
    bare = np.outer(gains[:4], LIGHT)
    assert said("pulsed", bare, gain=gains) == []
    assert said("pulsed", bare) != []
