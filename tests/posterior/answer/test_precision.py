"""Monte Carlo errors of ranges: what they say is by how much seeds move the numbers."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal, stats

from inference.posterior.answer.draws import _count
from inference.posterior.answer.precision import mean_error, quantile_error
from inference.posterior.infer import infer
from inference.posterior.sample import Sample
from inference.posterior.sampling.verdict import Chains
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

SETS = 300
AT = (0.05, 0.5, 0.95)


def walked(rng: np.random.Generator, memory: float, steps: int = 8) -> NDArray[np.float64]:
    """Standard normal draws of four ensembles of 32 walkers that remember their last step."""
    noise = rng.standard_normal((4, 32, 200 + steps)) * math.sqrt(1 - memory**2)
    return np.asarray(signal.lfilter([1.0], [1.0, -memory], noise, axis=2)[:, :, 200:])


# what a verdict asks for is 50 times of autocorrelation: few draws of them have none, of many it
# is 4 steps at a memory of 0.6
@pytest.mark.parametrize(("memory", "steps"), [(0.0, 8), (0.6, 100)])
def test_seeds_move_means_and_quantiles_by_what_is_stated(memory: float, steps: int) -> None:
    """The mean square of 300 errors, each by its own stated one, is 1 up to 0.08 (one sd). The
    stated ones come from some 30 effective values, so that it may be 1.1, or 1.2 through the bias
    of a time of autocorrelation: 0.65 and 1.5 are four sd away. Of independent draws the errors
    would be half as large at a memory of 0.6, and the mean square 4."""
    rng = np.random.default_rng(1)
    squares = np.empty((SETS, 4))
    for k in range(SETS):
        x = np.exp(0.1 * walked(rng, memory, steps))
        squares[k, 0] = (x.mean() - math.exp(0.005)) / mean_error(x, None)
        for j, at in enumerate(AT):
            truth = math.exp(0.1 * float(stats.norm.ppf(at)))
            squares[k, 1 + j] = (np.quantile(x, at) - truth) / quantile_error(x, at, None)
    mean = (squares**2).mean(axis=0)
    assert (mean > 0.65).all()
    assert (mean < 1.5).all()


def test_resampled_draws_have_the_error_of_their_weights() -> None:
    x = np.random.default_rng(1).standard_normal((1, 1, 1000))
    equal = np.full(x.shape, 1e-3)
    # 1/500 = 1/1000 + 1/1000, and the median of a normal law has pi/2 of the mean's variance
    assert mean_error(x, equal) == pytest.approx(1 / math.sqrt(500), rel=0.1)
    # two order statistics some 50 draws apart, each of which is off by a few
    expected = math.sqrt(math.pi / 2 / 500)
    assert quantile_error(x, 0.5, equal) == pytest.approx(expected, rel=0.4)


def test_a_tail_of_which_few_heavy_draws_tell_has_the_error_of_these() -> None:
    """A normal law by draws of one that is 0.8 times as wide: weights are heaviest in the tails.

    Mean squares of 400 errors, each by its own stated one, are 1 up to 0.07 where both are normal;
    stated ones whose weights have no fourth moment are small more often than large, which makes it
    1.4 for the quantiles of 5 and 95 %. By the importance sample size, one for all, these are 2.6
    and 2.5, and that of the mean is 1.6."""
    rng = np.random.default_rng(4)
    off = np.empty((400, 4))
    for k in range(len(off)):
        z = 0.8 * rng.standard_normal(2000)
        weights = np.exp(0.5 * z**2 * (0.8**-2 - 1.0))
        weights /= weights.sum()
        keep = rng.choice(2000, size=2000, p=weights)
        x, own = z[keep][None, None], weights[keep][None, None]
        off[k, 0] = x.mean() / mean_error(x, own)
        for j, at in enumerate(AT):
            off[k, 1 + j] = np.quantile(x, at) - stats.norm.ppf(at)
            off[k, 1 + j] /= quantile_error(x, at, own)
    mean = (off**2).mean(axis=0)
    assert (mean > 0.65).all()
    assert (mean < 1.8).all()
    assert mean[0] < 1.35  # four sd


def sample(steps: int, memory: float) -> Sample:
    z = walked(np.random.default_rng(2), memory, steps)[..., None]
    flat = z[..., 0]
    mode = np.zeros(flat.shape, dtype=np.intp)
    chains = Chains(z, flat, mode, np.ones(flat.shape[:2]), ("x",))
    return Sample(z, flat, np.arange(steps), mode == 0, mode, chains, None)


def test_ranges_are_drawn_in_proportion_to_the_effective_size() -> None:
    assert _count(sample(20, 0.0), 40) == 1000
    # 102,400 draws: a sixteenth of them, which is what they cost
    assert _count(sample(800, 0.0), 40) == 6400
    # of times of 39 steps, 2,600 effective ones, to within a tenth or so
    assert 2 * 1800 < _count(sample(800, 0.95), 40) < 2 * 3200
    assert _count(sample(800, 0.0), 1000) == 1000
    assert _count(sample(800, 0.0), 100_000) == 100


def test_another_seed_moves_the_ranges_by_what_is_stated() -> None:
    sensor = sensor_of("pulsed", 100.0)
    frames = data(sensor, frames=10).frames
    scene = parse_scene({"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}})
    settings = (SamplerSettings(seed=seed, method="importance") for seed in (1, 2))
    one, other = (infer(sensor, scene, frames, each).range_m for each in settings)
    for name in ("mean", "q05", "q50", "q95"):
        moved = np.abs(getattr(one, name) - getattr(other, name))
        stated = np.hypot(getattr(one, f"mcse_{name}"), getattr(other, f"mcse_{name}"))
        # forty differences of two answers: a false alarm once in 4e4 runs
        assert (moved < 5 * stated).all()
        # of a thousand draws 0.07 sqrt(2) at a quantile of a normal law, more at one with a tail
        assert (stated < 0.25 * one.sd).all()
