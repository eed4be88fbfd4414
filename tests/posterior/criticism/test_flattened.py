"""Weights that are flattened until enough draws count, and continued from there."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inference.posterior.criticism.flattened import flattened


@pytest.mark.parametrize(("slope", "moved"), [(0.5, 0.5), (2.0, 2.0), (6.0, 2 * 1.097)])
def test_what_flattened_weights_move_is_continued_in_proportion(slope: float, moved: float) -> None:
    """Of a standard normal law weights exp(s z) move the mean by s, and leave exp(-s^2) of the
    draws: three tenths at 1.097, twice as far at most. Five standard errors of an effective size of
    30,000, twice."""
    z = np.random.default_rng(1).standard_normal((100_000, 1))
    assert flattened(slope * z[:, 0]).moved(z)[0] == pytest.approx(moved, abs=0.06)


@given(st.lists(st.floats(-1e8, 1e8), min_size=2, max_size=60))
def test_flattened_weights_leave_a_third_of_the_draws(gains: list[float]) -> None:
    found = flattened(np.array(gains))
    assert found.weights.sum() == pytest.approx(1.0)
    assert 1 / np.sum(found.weights**2) > 0.3 * len(gains) * (1 - 1e-6)
    assert 1.0 <= found.further <= 2.0
    # a constant more is no other weight
    assert flattened(np.array(gains) + 1e3).weights == pytest.approx(found.weights, abs=1e-5)
