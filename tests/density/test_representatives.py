"""Frames that stand for many: a weight is as many frames."""

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from inference.density.profile import linearise
from inference.density.representatives import Representatives, standing_for
from tests.posterior.scenes import example


def test_a_weight_is_as_many_frames() -> None:
    sensor, scene, frames = example("pulsed", crosstalk=False, frames=3)
    repeated = collapsed_density(sensor, scene, frames.select([0, 0, 2, 1, 1, 1]))
    by = Representatives(np.array([0, 2, 3]), np.array([2.0, 1.0, 3.0]))
    few = standing_for(repeated, by)
    z = 0.3 * np.random.default_rng(1).standard_normal((4, len(few.parameters)))
    assert few(z) == pytest.approx(repeated(z), rel=1e-12)
    # and so the curvature that steps are made by
    log_r = repeated.best_ranges(z[:1])[0, :, 0]
    whole, part = linearise(repeated, z[0], log_r), linearise(few, z[0], log_r[by.chosen])
    d = len(few.parameters)
    wanted = whole.jacobian.reshape(-1, d)
    found = part.jacobian.reshape(-1, d)
    assert found.T @ found == pytest.approx(wanted.T @ wanted, rel=1e-9)
