"""What the study of little knowledge reads behind its cover glass, and what its table counts."""

import numpy as np
import pytest

from benchmarks.coverage.classes import SNR
from benchmarks.known_ranges import TOLD
from benchmarks.little_knowledge import EMPTY, SHARES, case_of, line


@pytest.mark.parametrize("number", [0, 1, 2])
def test_crosstalk_is_the_stated_share_and_is_all_that_empty_frames_read(number: int) -> None:
    case = case_of("five empty frames", number)
    assert case.frames.object_present is not None
    dark = case.frames.readings[~case.frames.object_present]
    assert dark.shape == (EMPTY, 2)
    noise = float(case.sensor.noise.read[0])
    share = SHARES[(number // 2) % 2]
    # the mean of five frames: five of its standard deviations, once in a million
    assert abs(np.hypot(*dark.mean(axis=0)) / noise - share * SNR) < 5 / np.sqrt(EMPTY)
    np.testing.assert_array_equal(case.asked, case.frames.object_present)


def test_data_are_the_same_whatever_is_told() -> None:
    first, second = (case_of(what, 1) for what in TOLD[:2])
    np.testing.assert_array_equal(first.frames.readings, second.frames.readings)
    assert first.asked.sum() == 22
    assert second.asked.sum() == 18


def test_a_set_in_doubt_is_not_counted_as_a_confident_error() -> None:
    row = {"held": "24", "frames": "24", "width": "0.02", "error": "0.01", "worst": "1", "says": ""}
    far = {**row, "held": "0", "worst": "9"}
    assert line("x", [row, {**far, "says": "misfit"}]).endswith("| 1 | 100% | 0 |")
    assert line("x", [row, far]).endswith("| 0 | 50% | 1 |")
