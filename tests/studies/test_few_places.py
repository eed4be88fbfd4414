"""Few places before unknown crosstalk: one that is dim may be crosstalk alone, and need not be."""

import numpy as np

from benchmarks.coverage.path_rows import posterior_of
from benchmarks.coverage.paths import draw_path
from inference.posterior.settings import SamplerSettings


def test_frames_that_crosstalk_alone_could_explain_are_not_taken_for_it() -> None:
    """Five frames at each of four places.

    Where each frame in the dark gained a factor of five to ten, five of them drew all the draws to
    crosstalk that is the light of the farthest place: the answer had not converged after 100 s, and
    held none of 20 ranges, by 6 standard deviations.
    """
    data = draw_path("at rest, a few moves", "crosstalk", "nothing", 1)
    found = posterior_of(data, SamplerSettings(method="auto", seed=1))
    assert found.verdict.converged
    assert found.fit.misfit is False
    ranges = found.range_m
    # errors that ranges share: none of them beyond what one normal variate is once in 1,000
    sd = (ranges.q95 - ranges.q05) / 3.29
    assert np.max(np.abs(ranges.q50 - data.range_m) / sd) < 3.3
    status = {row.parameter: row.status for row in found.identifiability}
    assert status["range_m"] != "identified"
