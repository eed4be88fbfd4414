"""The study of tracks whose object is another than the one that is stated."""

import numpy as np

from benchmarks.other_objects import KINDS, frames_off, random_visit

TRACKS = 20


def test_stated_differences_keep_tracks_right() -> None:
    """Of 300 such tracks none had more than two frames sure and far off; of 20 one may.

    Where one in a hundred had (more than 95 % likely to be seen in 300), two of 20 have by chance
    in 1.7 %. Without the size of the differences a seventh of tracks has: 40 of 300.
    """
    lost = answered = 0
    for number in range(TRACKS):
        rng = np.random.default_rng([1, number])
        off, _, _ = frames_off(random_visit(rng, KINDS[number % 2], 0.3), 0.7)
        answered += int(np.count_nonzero(np.isfinite(off)))
        lost += int(np.count_nonzero(np.abs(off) > 5.0) > 2)
    assert lost <= 1
    assert answered > 0.95 * TRACKS * 300
