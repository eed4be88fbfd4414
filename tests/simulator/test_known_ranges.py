"""What is known of ranges, where two statements of it cannot both be so."""

import numpy as np
import pytest

from simulator.errors import InvalidInputError
from simulator.frames import frames_from_columns
from simulator.sensor import parse_sensor

SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-6]}})
KNOWN = np.array([0.5, 0.7, 1.0, 1.6])


def columns(moved: list[float], sd: float = 1e-3) -> dict[str, list[float]]:
    n = KNOWN.size
    return {
        "w1": [0.01] * n,
        "w2": [0.1] * n,
        "known_range_m": KNOWN.tolist(),
        "known_range_sd_m": [sd] * n,
        "displacement_m": moved,
        "displacement_sd_m": [sd] * n,
    }


@pytest.mark.parametrize("offset", [-0.5, 0.0, 3.0])
def test_one_offset_is_no_contradiction(offset: float) -> None:
    """Off by a standard deviation each: chi-square 4 at three degrees of freedom."""
    moved = KNOWN + offset + 1e-3 * np.array([1.0, -1.0, 1.0, -1.0])
    assert len(frames_from_columns(SENSOR, columns(moved.tolist()))) == 4


def test_a_frame_that_moved_otherwise_is_named() -> None:
    """Ten standard deviations of their difference, where a false alarm is one in a billion."""
    moved = KNOWN - 0.5
    moved[2] += 10 * np.sqrt(2) * 1e-3
    with pytest.raises(InvalidInputError, match=r"/displacement_m: contradicts.* 2[, ]"):
        frames_from_columns(SENSOR, columns(moved.tolist()))


def test_a_displacement_the_other_way_round_is_a_contradiction() -> None:
    with pytest.raises(InvalidInputError, match="one offset does not make them agree"):
        frames_from_columns(SENSOR, columns((-KNOWN).tolist()))
