"""How hard readings pull an unknown beyond its prior: the slope of the likelihood, in its sd."""

import math

import numpy as np
import pytest

from inference.posterior.criticism.prior_conflict import scores


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("told", "pull"), [(5.0, 30.0), (1.0, -10.0)])
def test_the_pull_is_counted_towards_the_end_of_the_prior(
    side: float, told: float, pull: float
) -> None:
    """Drawn at 2, told 5 or 1 with a standard error of 0.1, on either side of the prior."""
    z = np.array([2.0 * side])
    residual = 10.0 * (z - told * side)
    assert scores(np.array([[10.0]]), residual, z) == pytest.approx([pull])


def test_what_another_unknown_may_take_up_is_no_pull() -> None:
    """Two unknowns that one reading sees alike: the other gives way by as much as its prior lets.

    With z2 free under its prior the reading tells z1 with a variance of 1/J^2 + 1.
    """
    jacobian, z = np.array([[3.0, 3.0]]), np.array([2.0, 0.0])
    residual = np.array([-4.0])
    wanted = 4.0 / math.sqrt(1.0 + 9.0)
    assert scores(jacobian, residual, z)[0] == pytest.approx(wanted)
