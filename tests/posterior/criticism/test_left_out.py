"""What the functions of the flux's error leave out: replicates of the frames have it too."""

import numpy as np
import pytest

from benchmarks.coverage.path_rows import posterior_of
from benchmarks.random_sets.wide import wide_set
from inference.density.collapsed import collapsed_density
from inference.density.discrepant import with_discrepancy
from inference.posterior.criticism.fit_residuals import left_out
from inference.posterior.settings import SamplerSettings
from simulator.discrepancy import matern
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

SD, DRAWS = 0.05, 20_000


def test_it_is_what_the_process_has_and_the_functions_have_not() -> None:
    sensor = sensor_of("pulsed")
    frames = data(sensor, frames=4).frames
    density = with_discrepancy(
        collapsed_density(sensor, parse_scene({"object": OBJECT}), frames), SD
    )
    u, light = np.log([0.2, 0.21, 0.4, 1.1]), np.array([1e4, -2e4, 1e4, 3e3])
    draws = left_out(density, u, light, DRAWS, np.random.default_rng(3))
    known = density.functions_at(u)[0]
    wanted = light[:, None] * (SD**2 * matern(u[:, None] - u) - known @ known.T) * light
    # a covariance of so many draws errs by this in its standard deviation; 5 of them for ten
    # entries, a false alarm in 200,000, besides the spline's 1e-6 of the variance
    each = np.sqrt(np.diag(wanted))
    error = np.outer(each, each) * np.sqrt(2.0 / DRAWS)
    spline = 2e-6 * SD**2 * np.abs(np.outer(light, light))
    assert (np.abs(draws.T @ draws / DRAWS - wanted) < 5.0 * error + spline).all()
    faint = left_out(density, u, 1e-4 * light, 2, np.random.default_rng(3))
    np.testing.assert_array_equal(faint, np.zeros((2, 4)))


@pytest.mark.parametrize("number", [141, 252])
def test_no_misfit_of_bright_frames_that_err_as_the_scene_says(number: int) -> None:
    """Signal-to-noise ratios of 560,000 and 374,000: residuals wandered 14 times as much as by
    noise, and chi-square was 125 where 58 was expected."""
    one = wide_set(4242, number)
    found = posterior_of(one, SamplerSettings(method="auto", seed=number))
    assert found.verdict.converged
    assert not found.fit.misfit
