"""Draws of an exact model beside the branch in which errors of a flat wall's shadow put the truth.

Of these frames the exact model's posterior holds the true branch, which fits no worse, for one of
some hundredths: it is a tenth as wide (`python -m benchmarks.flat_wall_frames --ways infer --told
crosstalk --first 2 --sets 1`).
"""

import numpy as np

from benchmarks.flat_wall_frames import set_of
from inference.posterior.answer.error_budget import error_budget
from inference.posterior.fold import prepare
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene

# of that posterior, sampled once
DRAWS = np.array(
    [
        [-1.41312, -0.23998, -0.34164, 0.01329, -0.1835, 1.01344, -0.37124, -0.0116],
        [-1.23184, -0.30565, -0.62174, -0.23973, 0.43714, 1.1245, -0.33385, -0.11307],
        [-1.59097, -0.63244, -0.20303, 1.11654, -0.32267, 0.5695, -0.49978, 0.0147],
        [-1.1371, 0.82701, -0.25838, 1.90012, 1.23644, 0.32126, -0.139, -0.51663],
    ]
)
NORMAL_90 = 1.645


def test_a_wide_branch_is_not_taken_for_all_where_errors_of_a_shadow_lead_to_another() -> None:
    given = set_of(2, "crosstalk")
    settings = SamplerSettings(ensembles=2, seed=2, target_ess=200, method="auto")
    job = prepare(given.sensor, parse_scene(given.scene), given.frames, settings)
    density, rng = job.density(), np.random.default_rng(1)
    draws = np.repeat(DRAWS, 4, axis=0)  # of which climbs begin at every fourth
    log_r = density.best_ranges(draws)[:, :, 0]
    budget = error_budget(job, density, draws, log_r, None, None, None, rng)
    off = np.abs(np.median(log_r, axis=0) + budget.by_log_r[0, :, 0] - np.log(given.truth))
    sd = np.sqrt(np.square(budget.by_log_r[0, :, 1:]).sum(axis=1) + log_r.var(axis=0))
    assert np.median(off) > 0.1
    assert np.all(off < NORMAL_90 * sd)
