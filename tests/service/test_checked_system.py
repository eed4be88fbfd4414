"""What a request may ask for, before anything is computed of it."""

import numpy as np
import pytest

from service.checked_system import aliases_of, checked_frames
from simulator.errors import RefusedError
from simulator.frames import FrameColumns
from simulator.scene import Scene, parse_scene
from simulator.sensor import parse_sensor

LIGHT = 299792458.0
# a range of one metre is unambiguous
SENSOR = parse_sensor(
    {"kind": "sine_wave", "frequency_hz": LIGHT / 2, "noise": {"read": [1e-6, 1e-6]}}
)


def before(distance_m: object) -> Scene:
    return parse_scene({"background": {"strength": 1.0, "distance_m": distance_m}})


def test_roots_of_a_frame_are_as_many_as_turns_before_the_background() -> None:
    assert aliases_of(SENSOR, parse_scene({})) == 1.0
    assert aliases_of(SENSOR, before(500.0)) == pytest.approx(501.0, rel=1e-12)
    assert aliases_of(SENSOR, before({"prior": "uniform", "low": 2.0, "high": 900.0})) == 1.0
    pulsed = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1.0, 1.0]}})
    assert aliases_of(pulsed, before(500.0)) == 1.0


def test_more_roots_than_can_be_held_are_refused_with_their_number() -> None:
    """Of 900 half turns each: 5,000 frames are held, 6,000 are not."""
    scene = before(900.0)
    for count in (5_000, 6_000):
        values = np.full(count, 0.5).tolist()
        columns = FrameColumns.model_validate({"i": values, "q": values})
        if count == 5_000:
            assert len(checked_frames(SENSOR, scene, columns)[2]) == count
            continue
        with pytest.raises(RefusedError, match=r"901 unambiguous ranges away.*6000 frames"):
            checked_frames(SENSOR, scene, columns)
