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
    silence, and intervals held 67 %. Frames of a track err together: seven of eight tracks and 70 %
    of intervals are asked.
    """
    found = [tracked(SENSORS[kind], "stops", seed) for seed in range(TRACKS)]
    assert sum(one.silent >= 5 for one in found) <= 1
    assert np.mean([one.held for one in found]) > 0.7
    assert np.mean([one.answered for one in found]) > 0.9


def test_an_object_that_jumps_keeps_its_crosstalk() -> None:
    """Planted fault: without turns 4 of 8 are lost, the farthest 87 standard deviations off."""
    found = [tracked(SENSORS["pulsed"], "jumps", seed) for seed in range(TRACKS)]
    assert sum(one.silent >= 5 for one in found) <= 1
    assert max(one.farthest for one in found) < 10.0


@pytest.mark.parametrize("kind", KINDS)
def test_motion_as_stated_is_held(kind: str) -> None:
    """By the law of the rate itself; 85 % where its law was as narrow as stated."""
    found = [tracked(SENSORS[kind], "as stated", seed) for seed in range(TRACKS)]
    assert sum(one.silent >= 5 for one in found) == 0
    assert np.mean([one.held for one in found]) > 0.8


def test_an_object_that_is_known_to_rest_does_not_turn() -> None:
    """Its range is one number: the standard deviation falls as the root of the frames, or less."""
    crosstalk = {"prior": "normal", "mean": 0.0, "sd": 1e-4}
    scene = {"object": OBJECT, "motion": "static", "crosstalk": [crosstalk, crosstalk]}
    truth = parse_scene({"object": OBJECT, "crosstalk": [5e-5, -5e-5]})
    way = SampledTrajectory(range_m=[0.6] * 400, time_s=(np.arange(400) / 30.0).tolist())
    for seed in range(4):
        frames = simulate(SENSORS["sine_wave"], truth, way, seed).frames
        found = track(SENSORS["sine_wave"], parse_scene(scene), frames, TrackingSettings())
        spread = found.best_sd_m[np.isfinite(found.best_sd_m)]
        assert (np.diff(spread) < 1e-6).all()
        assert np.all(found.rate_m_s[np.isfinite(found.rate_m_s)] == 0.0)
