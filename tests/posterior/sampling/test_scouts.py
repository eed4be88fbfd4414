"""Scouts from the prior stand where importance sampling says that the mass is."""

import dataclasses
import math
from typing import Any, cast

import numpy as np
import pytest

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.posterior.sampling import scouts
from inference.posterior.sampling.importance import MAX_K_HAT, draw_weighted
from inference.posterior.sampling.proposal import mixture_of
from inference.posterior.sampling.scouts import send_scouts, thinned
from inference.posterior.sampling.start import find_optima
from simulator.parameters import Parameters, parameters_of
from simulator.scene import parse_scene
from tests.posterior.scenes import KINDS, example, sensor_of

WALKERS = 256


@pytest.fixture
def many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scouts, "WALKERS", WALKERS)
    monkeypatch.setattr(scouts, "_SCOUTS", 2 * WALKERS)


@pytest.mark.usefixtures("many")
@pytest.mark.parametrize("kind", list(KINDS))
@pytest.mark.parametrize("crosstalk", [False, True])
def test_the_same_mean_as_importance_sampling(kind: str, crosstalk: bool) -> None:
    """Of 512 particles moved six times at the last temperature at least a tenth count as
    independent, and half of them are kept: bands of five standard errors of 26 draws, one standard
    deviation."""
    density = collapsed_density(*example(kind, crosstalk))
    optima = find_optima(density, np.random.default_rng(110))
    weighted = draw_weighted(density, mixture_of(optima), np.random.default_rng(111), 4000)
    assert weighted.k_hat < MAX_K_HAT
    mean = weighted.weights @ weighted.z
    sd = np.sqrt(weighted.weights @ (weighted.z - mean) ** 2)
    found, calls = send_scouts(density, np.random.default_rng(112))
    walkers = found.z
    assert walkers.shape == (WALKERS, len(mean))
    assert calls > WALKERS
    off = np.abs(walkers.mean(axis=0) - mean) / sd
    assert off.max() < 5 / math.sqrt(2 * WALKERS / 20)
    # neither stuck in one place nor still spread over the prior
    spread = walkers.std(axis=0) / sd
    assert spread.min() > 0.3
    assert spread.max() < 1.5


def test_walkers_are_distinct_and_stand_where_the_density_is_positive() -> None:
    density = collapsed_density(*example("pulsed", crosstalk=True))
    found, _ = send_scouts(density, np.random.default_rng(113))
    walkers = found.z
    assert len(np.unique(walkers, axis=0)) == len(walkers)
    assert np.isfinite(density(walkers)).all()


class Bumps:
    """Two bumps of masses 1 : 3 under a standard normal prior, as scouts ask."""

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters

    def log_likelihood(self, z: Any) -> Any:
        first = -0.5 * ((z[:, 0] + 1) / 0.05) ** 2
        second = math.log(3) - 0.5 * ((z[:, 0] - 1) / 0.05) ** 2
        return np.logaddexp(first, second)


@pytest.mark.usefixtures("many")
def test_both_of_two_modes_are_kept() -> None:
    """Each bump of two has mass 1/4 and 3/4 by symmetry. The share is that of about 50 independent
    draws: five standard errors are 0.3, and none may be lost."""
    scene = parse_scene({"object": {"c0": 0.08, "c1": 0.1}})
    bumps = Bumps(parameters_of(sensor_of("pulsed"), scene))
    found, _ = send_scouts(cast("CollapsedDensity", bumps), np.random.default_rng(114))
    walkers = found.z
    assert walkers.shape[1] == 1
    share = float((walkers[:, 0] > 0).mean())
    assert 0.45 < share < 1.0
    assert np.abs(np.abs(walkers[:, 0]) - 1).max() < 0.3


def test_an_impossible_density_has_no_walkers() -> None:
    class Nowhere(Bumps):
        def log_likelihood(self, z: Any) -> Any:
            return np.full(len(z), -np.inf)

    scene = parse_scene({"object": {"c0": 0.08, "c1": 0.1}})
    nowhere = Nowhere(parameters_of(sensor_of("pulsed"), scene))
    found, calls = send_scouts(cast("CollapsedDensity", nowhere), np.random.default_rng(115))
    walkers = found.z
    assert walkers.shape == (0, 1)
    assert calls > 0


def test_many_frames_are_thinned_over_all_of_them() -> None:
    """Those that are kept keep their readings, their gain and whether they hold an object."""
    sensor, scene, frames = example("pulsed", False, frames=500)
    present = np.arange(500) % 7 != 0
    density = collapsed_density(sensor, scene, dataclasses.replace(frames, object_present=present))
    thin = thinned(density)
    assert thin.present is not None
    assert len(thin.frames) == len(thin.present) == 200
    places = [int(np.flatnonzero((density.frames == row).all(axis=1))[0]) for row in thin.frames]
    assert places[0] == 0
    assert places[-1] == 499
    assert max(np.diff(places)) <= 3
    np.testing.assert_array_equal(thin.present, present[places])
    few = collapsed_density(*example("pulsed", False, frames=200))
    assert thinned(few) is few


def test_scouts_end_on_their_way_after_so_many_temperatures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Readings that nothing explains kept them for 800."""
    density = collapsed_density(*example("pulsed", crosstalk=True))
    arrived, whole = send_scouts(density, np.random.default_rng(1))
    monkeypatch.setattr(scouts, "_MOST", 3)
    found, calls = send_scouts(density, np.random.default_rng(1))
    assert calls < whole
    # the screen, and two sweeps at each temperature
    assert calls <= 4 * scouts._SCOUTS + 3 * 2 * scouts._SCOUTS
    assert np.isfinite(density(found.z)).all()
    assert found.z.std(axis=0).max() > 3.0 * arrived.z.std(axis=0).max()


def test_scouts_that_stop_on_their_way_take_fewer_temperatures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On their way to the whole power the same limit has no say."""
    density = collapsed_density(*example("pulsed", crosstalk=True))
    _, before = send_scouts(density, np.random.default_rng(1), 0.9)
    _, whole = send_scouts(density, np.random.default_rng(1))
    monkeypatch.setattr(scouts, "_MOST_HALFWAY", 3)
    _, calls = send_scouts(density, np.random.default_rng(1), 0.9)
    assert calls < before
    assert calls <= 4 * scouts._SCOUTS + 3 * 2 * scouts._SCOUTS
    assert send_scouts(density, np.random.default_rng(1))[1] == whole
