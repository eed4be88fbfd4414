"""A warm start passes where its draws are those of the target, unless the prior knows of more."""

import dataclasses
from typing import Any, cast

import numpy as np
import pytest

from inference.posterior.sampling import warm
from inference.posterior.sampling.importance import MAX_K_HAT
from inference.posterior.sampling.proposal import Mixture, Proposal
from inference.posterior.sampling.warm import warm_start

D = 2
SECOND = 60.0  # where the other mode is


@dataclasses.dataclass(frozen=True)
class _Target:
    """A banana, and a second one far away where the mixture knows nothing."""

    share: float  # of the second

    def __call__(self, z: np.ndarray) -> np.ndarray:
        def banana(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            return np.asarray(-0.5 * (x**2 + ((y - 0.3 * (x**2 - 1.0)) / 0.7) ** 2))

        first, second = banana(*z.T), banana(z[:, 0] - SECOND, z[:, 1])
        with np.errstate(divide="ignore"):
            both = np.logaddexp(first + np.log1p(-self.share), second + np.log(self.share))
        return np.asarray(both)


def _others(share: float) -> np.ndarray:
    """Members of a population from the prior: draws of the target."""
    rng = np.random.default_rng(3)
    x = rng.standard_normal(64)
    z = np.column_stack([x, 0.3 * (x**2 - 1.0) + 0.7 * rng.standard_normal(64)])
    z[: round(64 * share), 0] += SECOND
    return z


@pytest.fixture(autouse=True)
def straight(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warm, "coordinates_of", lambda _: None)


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_mass_that_only_the_prior_knows_stops_it(share: float) -> None:
    laplace = Mixture(np.zeros((1, D)), np.diag([1.0, 0.7])[None], np.ones(1))
    density = cast(Any, _Target(share))
    rng = np.random.default_rng(4)
    found = warm_start(density, Proposal(laplace, None, 0.5), _others(share), rng, 1000)
    # its own weights see nothing of the second mode: k-hat passes, and is wrong
    assert found.draws.k_hat < MAX_K_HAT
    assert found.contradicted == (share > 0.1)
    assert found.fits == (share == 0.0)
    if found.fits:
        mean = found.draws.weights @ found.draws.z
        variance = found.draws.weights @ np.square(found.draws.z - mean)
        # five standard errors of at least 250 draws; a variance has at most 1 + 2 of kurtosis
        assert np.abs(mean).max() < 5 / np.sqrt(250)
        assert np.abs(variance / [1.0, 0.49 + 0.18] - 1).max() < 5 * np.sqrt(4 / 250)
