"""Posteriors of one unknown at the ends, held to quadrature; the long version is `make stress`."""

import numpy as np
import pytest

from inference.density.collapsed import collapsed_density
from tests.extreme.posteriors import exact_moments, held, random_case


@pytest.mark.parametrize("number", [0, 3])
def test_a_posterior_is_what_quadrature_has(number: int) -> None:
    """One whose data say 1e8 times what its prior does, one at the end of its prior."""
    verdict = held(random_case(number))
    # four numbers, each within six of its Monte Carlo errors: a false alarm once in 1e8 runs
    assert verdict.outcome == "held", verdict


def test_the_grid_is_carried_to_a_narrow_peak() -> None:
    """The moments of the grid are those of a fine line about the peak."""
    case = random_case(0)
    exact = exact_moments(case)
    assert exact is not None
    mean, sd, precision = exact
    density = collapsed_density(case.sensor, case.scene, case.frames)
    assert len(density.parameters.names) == 1
    assert precision > 1e7
    near = density.parameters.standard(mean[None] * (1 + 1e-9))
    line = near[0, 0] + np.linspace(-12, 12, 3001) / np.sqrt(precision)
    height = density(line[:, None])
    weights = np.exp(height - height.max())
    values = density.parameters.natural(line[:, None])[:, 0]
    found = np.average(values, weights=weights)
    assert abs(found - mean[0]) < 1e-4 * sd[0]
