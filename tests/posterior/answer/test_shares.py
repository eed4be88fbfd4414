"""Errors of shares against repeated simulations of walkers that go from mode to mode."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.posterior.answer.shares import (
    resampled_share_error,
    share_error,
    weighted_share_error,
)

Mask = NDArray[np.bool_]


def chain(rng: np.random.Generator, share: float, rate: float, shape: tuple[int, int, int]) -> Mask:
    """Walkers in a stationary two-state chain that forgets a part ``rate`` of its state a step."""
    inside = np.empty(shape, dtype=np.bool_)
    inside[..., 0] = rng.random(shape[:2]) < share
    for k in range(1, shape[2]):
        stays = rng.random(shape[:2]) > rate
        inside[..., k] = np.where(stays, inside[..., k - 1], rng.random(shape[:2]) < share)
    return inside


@pytest.mark.parametrize("share", [0.5, 0.05])
@pytest.mark.parametrize("rate", [1.0, 0.05])
def test_the_error_is_that_of_repeated_runs(share: float, rate: float) -> None:
    """The largest of three estimates, one of them of three degrees of freedom, is too large by up
    to a half, and never too small by more than the noise of 200 runs: five times 1 / sqrt(400)."""
    rng = np.random.default_rng(200)
    off = []
    for _ in range(200):
        inside = chain(rng, share, rate, (4, 16, 200))
        error = share_error(inside)
        assert error is not None
        off.append((float(inside.mean()) - share) / error)
    size = math.sqrt(np.mean(np.square(off)))
    assert 0.6 < size < 1.0 + 5 / math.sqrt(400)


def test_walkers_that_move_together_are_one() -> None:
    """What only the ensembles' own shares can tell: 64 walkers that copy one another."""
    rng = np.random.default_rng(201)
    off = []
    for _ in range(300):
        inside = np.repeat(chain(rng, 0.5, 0.2, (4, 1, 100)), 16, axis=1)
        error = share_error(inside)
        assert error is not None
        off.append(abs(float(inside.mean()) - 0.5) / error)
    # of Student's t with three degrees of freedom 90 % lie within 2.35 and 2 % beyond 4.5; a
    # binomial band of 1e-3 over 300 runs
    assert np.mean(np.array(off) > 4.5) < 0.055


def test_no_walker_that_changed_is_no_error() -> None:
    inside = np.zeros((4, 8, 50), dtype=bool)
    inside[:, :2] = True
    assert share_error(inside) is None
    assert share_error(np.zeros((4, 8, 50), dtype=bool)) is None
    assert share_error(np.ones((4, 8, 50), dtype=bool)) == 0.0


@pytest.mark.parametrize("resampled", [False, True])
def test_weighted_shares(resampled: bool) -> None:
    """Draws of a wide law weighted to a narrow one, share beyond its median; noise of 300 runs."""
    rng = np.random.default_rng(202)
    off = []
    for _ in range(300):
        x = 2.0 * rng.standard_normal(500)
        weights = np.exp(-0.5 * x**2 * (1 - 0.25))
        weights /= weights.sum()
        inside = x > 0
        if resampled:
            keep = rng.choice(500, size=200, p=weights)
            inside = inside[keep]
            found, error = float(inside.mean()), resampled_share_error(inside, weights[keep])
        else:
            found, error = float(weights[inside].sum()), weighted_share_error(inside, weights)
        off.append((found - 0.5) / error)
    assert math.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=5 / math.sqrt(600))
