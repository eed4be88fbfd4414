"""Readings that repeat, or scatter less than their noise, are told of in `assumptions`."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import inference.stuck_readings
from inference.estimate import estimate
from inference.stuck_readings import coarsest_step, stuck_readings
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]
READ = np.array([2e-5, 1e-3])
CROSSTALK = np.array([0.004, 0.2])
KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": READ.tolist()}},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": READ.tolist()}},
}
EMPTY = np.arange(45) < 5


def drawn(seed: int) -> Array:
    """Five empty frames, and 40 of an object that comes nearer."""
    rng = np.random.default_rng(seed)
    whole = np.where(EMPTY, 0.0, np.geomspace(0.05, 3.0, 45))
    light = np.column_stack([0.1 * whole**0.75, whole])
    return np.asarray(CROSSTALK + light + READ * rng.standard_normal(light.shape))


def said(readings: Array, kind: str = "pulsed", **more: Any) -> str | None:
    frames = Frames(readings, object_present=~EMPTY[: len(readings)], **more)
    return stuck_readings(parse_sensor(KINDS[kind]), frames)


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_dead_empty_frames(kind: str) -> None:
    """At zero or at one wrong value a fit of them was sure and tens of sd off without a word."""
    for wrong in (0.0, 0.7):
        y = drawn(1)
        assert said(y, kind) is None
        y[:5] = wrong * CROSSTALK
        told = said(y, kind)
        assert told is not None
        assert told.startswith("the 5 frames 0 to 4, 5 of them empty (object_present false), read")
        assert "leave these frames out" in told
        unknown = {"prior": "normal", "mean": 0.0, "sd": 1.0}
        scene = parse_scene({"crosstalk": [unknown, unknown]})
        frames = Frames(y, object_present=~EMPTY)
        answer = estimate(parse_sensor(KINDS[kind]), scene, frames, ["conventional"])
        assert told in answer.assumptions


def test_frames_with_the_object_that_repeat_or_read_zero() -> None:
    y = drawn(2)
    y[20:24] = y[20]
    assert str(said(y)).startswith("the 4 frames 20 to 23 read exactly w1 ")
    y = drawn(2)
    y[[9, 15, 30]] = 0.0
    assert str(said(y)).startswith("3 of frames 9 to 30 read exactly w1 0 and w2 0")
    # where the sensor is at its full scale readings are the same
    y = np.minimum(drawn(2), [1.0, 0.4])
    assert said(y) is None  # of the largest readings nothing tells how coarse they are
    y[20:24] = [-1.0, 0.1]
    clipped = KINDS["pulsed"] | {"full_scale": [1.0, 0.4]}
    assert stuck_readings(parse_sensor(clipped), Frames(y)) is None


def test_a_column_that_is_dead() -> None:
    """The other scatters as it should: four degrees of freedom with nothing in them."""
    for k, column in enumerate(("w1", "w2")):
        y = drawn(3)
        y[:5, k] = 0.5 * CROSSTALK[k]
        told = str(said(y))
        assert f"less than read noise alone: {column} 0 times" in told
    # of 45 empty frames 44 degrees of freedom: a third of the noise is 5, where 13 are 2.5e-7
    rng = np.random.default_rng(4)
    y = CROSSTALK + READ * rng.standard_normal((45, 2)) / 3
    sensor = parse_sensor(KINDS["pulsed"])
    bare = np.zeros(45, dtype=bool)
    assert "0.3" in str(stuck_readings(sensor, Frames(y, object_present=bare)))
    y = CROSSTALK + READ * rng.standard_normal((45, 2)) / 1.5  # stated too large by half: cautious
    assert stuck_readings(sensor, Frames(y, object_present=bare)) is None


@pytest.mark.parametrize("kind", ["steps", "digits"])
def test_coarse_readings_may_be_the_same(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four tests of 1e-3 each, 5,600 requests: 22 may be doubted, and 45 are five sd more.

    That they are as many as foreseen at 1e-3 is why they are 1e-6 at 2.5e-7: the law is the same.
    """
    monkeypatch.setattr(inference.stuck_readings, "_FALSE_ALARM", 1e-3)
    sensor = parse_sensor(KINDS["pulsed"] | {"noise": {"read": [1.0, 1.0]}})
    rng = np.random.default_rng(5)
    doubted = 0
    for step in (1e-6, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0):
        for trial in range(400):
            n = int(rng.integers(2, 60))
            light = rng.uniform(0.0, 300.0, (n, 1)) * (trial % 2) + rng.choice([0.0, 20.0])
            y = light + rng.standard_normal((n, 2))
            own = np.full_like(y, step)
            if kind == "digits":
                own = np.where(np.abs(y) < 10.0, step / 10.0, own)
            y = np.round(y / own) * own
            bare = np.arange(n) >= rng.integers(0, n + 1)
            doubted += stuck_readings(sensor, Frames(y, object_present=bare)) is not None
    assert doubted <= 22


def test_a_stuck_reader_of_coarse_steps() -> None:
    """A third of the noise: 5 in a row are chance, 0.13^8 * 45 = 4e-6, and 7 are not, 1e-9."""
    y = np.round(drawn(6) / (READ / 3)) * (READ / 3)
    for many, doubted in ((5, False), (7, True)):
        y[20 : 20 + many] = y[20]
        assert (said(y) is not None) == doubted


def test_other_gains_are_other_frames() -> None:
    y = np.tile(CROSSTALK, (45, 1))
    y[5:] = drawn(7)[5:]
    gains = np.where(np.arange(45) % 2, 2.0, 1.0)
    assert said(y) is not None
    assert said(y, gain=gains) is None


def of_all_at_once(values: Array, read: float) -> float:
    """The coarsest step of which all differences are multiples, to a fifth, from all of them."""
    by_size = values[np.argsort(np.abs(values))][:24]
    away = np.abs(by_size[1:] - by_size[0])
    reach = float(away.max())
    most = min(reach / (0.01 * read), 3e5)
    counts = np.arange(9, int(10.0 * most) + 1) / 10.0
    turns = away[:, None] / reach * counts
    fits = (np.abs(turns - np.rint(turns)) <= 0.2).all(axis=0)
    return reach / float(counts[np.argmax(fits)] if fits.any() else most)


def test_the_first_step_that_fits_is_the_coarsest_of_all() -> None:
    """Steps are tried some at a time, from the coarsest on."""
    rng = np.random.default_rng(5)
    late = 0
    for k in range(12):
        fine = 0.02 if k % 3 else 0.0  # rounded, or not
        values = rng.normal(0.0, 150.0, 16)
        values = np.rint(values / fine) * fine if fine else values
        found = coarsest_step(values, 0.0, 1.0)
        assert found == of_all_at_once(values, 1.0)
        late += bool(found < 0.9 * np.ptp(values) / 3276.8)
    assert late >= 4
