"""A prior of the range that is all but a point: the tracker answers there, or refuses."""

import pytest

from inference.tracking.track import step
from inference.tracking.tracker import tracker
from simulator.errors import RefusedError
from simulator.frames import frames_from_columns
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, parse_sensor

_NOISE = {"read": [1e-4, 1e-4]}
_OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.1}


@pytest.mark.parametrize("sigma", [1e-12, 1e-3])
def test_range_that_is_known(sigma: float) -> None:
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": _NOISE})
    prior = {"prior": "lognormal", "median": 1.0, "sigma": sigma}
    model = tracker(sensor, parse_scene({"object": _OBJECT, "range_m": prior}))
    assert isinstance(sensor, PulsedSensor)
    w2 = 0.0769 * 0.1 / (1.0 - 0.123 + 0.0769)
    frames = frames_from_columns(sensor, {"time_s": [0.0], "w1": [w2 / sensor.r0], "w2": [w2]})
    _, track = step(model, model.first, frames)
    assert track.range_m[0] == pytest.approx(1.0, abs=5 * max(sigma, 1e-9))


@pytest.mark.parametrize("median", [0.3, 1.0])
def test_a_point_is_refused(median: float) -> None:
    """At 1 m its ends differ, by 1e-49 of a logarithm: such bodies were answered by a 500."""
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": _NOISE})
    prior = {"prior": "lognormal", "median": median, "sigma": 1e-50}
    with pytest.raises(RefusedError, match="widen range_m"):
        tracker(sensor, parse_scene({"object": _OBJECT, "range_m": prior}))
