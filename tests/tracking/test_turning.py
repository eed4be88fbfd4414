"""Motion that the rate's law does not foresee is not taken for another crosstalk."""

import numpy as np
import pytest

from benchmarks.stop_and_go import OBJECT, SENSORS, tracked
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import track
from simulator.scene import parse_scene
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

KINDS = list(SENSORS)
TRACKS = 8


@pytest.mark.parametrize("kind", KINDS)
def test_an_object_that_stops_and_goes_keeps_its_crosstalk(kind: str) -> None:
    """0.3 s on its way, 1.7 s at rest, nothing stated of the motion.

    With the rate's law as narrow as stated 3 of these 8 tracks of either sensor were lost in
    silence, and intervals held 66 and 70 %. Frames of a track err together: seven of eight tracks
    and 70 % of intervals are asked.
    """
    found = [tracked(SENSORS[kind], "stops", seed) for seed in range(TRACKS)]
    assert sum(one.silent >= 5 for one in found) <= 1
    assert np.mean([one.held for one in found]) > 0.7
    assert np.mean([one.answered for one in found]) > 0.9


def test_an_object_that_jumps_keeps_its_crosstalk() -> None:
    """Planted fault: without turns 3 of 8 are lost, the farthest 87 standard deviations off."""
    found = [tracked(SENSORS["pulsed"], "jumps", seed) for seed in range(TRACKS)]
    assert sum(one.silent >= 5 for one in found) <= 1
    assert max(one.farthest for one in found) < 10.0


@pytest.mark.parametrize("kind", KINDS)
def test_motion_as_stated_is_held(kind: str) -> None:
    """By the law of the rate itself; with it as narrow as stated one of 8 was lost."""
    found = [tracked(SENSORS[kind], "as stated", seed) for seed in range(TRACKS)]
    assert sum(one.silent >= 5 for one in found) == 0
    assert np.mean([one.held for one in found]) > 0.8


def test_a_flat_curve_is_no_likelier_where_motion_is_smoother_than_its_law() -> None:
    """Planted fault: with widths that count in full 6 of 32 are lost in silence, 2 are allowed."""
    pulses = SENSORS["pulsed"]
    found = [tracked(pulses, path, seed) for path in ("slow", "swings") for seed in range(16)]
    assert sum(one.silent >= 5 for one in found) <= 2


def test_an_object_that_is_known_to_rest_does_not_turn() -> None:
    """Also one that is moved all the same, by ten standard deviations: it has no rate."""
    crosstalk = {"prior": "normal", "mean": 0.0, "sd": 1e-5}
    scene = {"object": OBJECT, "motion": "static", "crosstalk": [crosstalk, crosstalk]}
    truth = parse_scene({"object": OBJECT, "crosstalk": [0.0, 0.0]})
    ranges, times = [0.6] * 3 + [0.62] * 4, np.arange(7) / 30.0
    way = SampledTrajectory(range_m=ranges, time_s=times.tolist())
    frames = simulate(SENSORS["sine_wave"], truth, way, 0).frames
    found = track(SENSORS["sine_wave"], parse_scene(scene), frames, TrackingSettings())
    assert np.isfinite(found.rate_m_s).all()
    assert np.all(found.rate_m_s == 0.0)
