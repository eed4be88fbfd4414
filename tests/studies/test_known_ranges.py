"""What the study of known ranges tells, and of which frames it then asks."""

import numpy as np
import pytest

from benchmarks.known_ranges import ODOMETRY_M, RULER_M, TOLD, with_knowledge
from simulator.frames import Frames


@pytest.mark.parametrize("what", TOLD)
def test_only_what_was_not_told_is_asked(what: str) -> None:
    truth = np.append(np.linspace(0.1, 0.4, 12), np.nan)
    frames, free = with_knowledge(what, Frames(np.ones((13, 2))), truth, 1)
    for told, sd, size in (
        (frames.known_range_m, frames.known_range_sd_m, RULER_M),
        (frames.displacement_m, frames.displacement_sd_m, ODOMETRY_M),
    ):
        if told is not None and sd is not None:
            known = np.isfinite(told)
            assert not (known & free).any()
            np.testing.assert_array_equal(sd, size)
            off = (told - truth)[known]
            assert np.abs(off - off.mean()).max() < 5 * size
    counts = {"two distances": 10, "odometry": 9}
    assert free.sum() == counts.get(what, 12)
