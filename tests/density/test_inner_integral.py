"""The frame integral against its slow reference, on random and extreme frames."""

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.density.reference import FEW_TERMS, Case, random_case, reference

NAT = 1e-3  # what a frame may be wrong by


def integrated(case: Case) -> float:
    density = collapsed_density(case.sensor, case.scene, case.frames)
    return float(density.log_likelihood(np.empty((1, 0)))[0])


@pytest.mark.parametrize(
    ("seed", "count"), [(3, 40), pytest.param(4, 300, marks=pytest.mark.thorough)]
)
def test_random_frames(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    for k in range(count):
        case = random_case(rng, FEW_TERMS)
        expected = reference(case)
        # a log density of 1e11 nats is itself known to some dozen roundings
        allowed = NAT + 50 * np.finfo(float).eps * abs(expected)
        assert integrated(case) == pytest.approx(expected, abs=allowed, rel=0), (seed, k)


def test_a_dip_beside_the_top() -> None:
    """A relative error far above the read noise makes the density rise again beyond a dip, so the
    slope at a neighbouring knot points away from the top."""
    c = (15.72605562452916, 0.15226618994614083, 0.13930093523361167)
    scene = {
        "object": dict(zip(("c0", "c1", "c2"), c, strict=True)),
        "range_m": {"prior": "loguniform", "low": 0.02, "high": 20.0},
    }
    sensor = {
        "kind": "sine_wave",
        "frequency_hz": 31007758.194984086,
        "phase_offset_rad": 2.6881691839503112,
        "noise": {
            "read": [4.5890948717965985e-08, 4.297955695424274e-07],
            "relative": 0.025762202121318856,
        },
    }
    reading = (1.1684136746644385e-05, 6.077953234608646e-05)
    case = Case(parse_sensor(sensor), parse_scene(scene), c, None, None, 0.02, 20.0, reading)
    assert integrated(case) == pytest.approx(reference(case), abs=NAT)
