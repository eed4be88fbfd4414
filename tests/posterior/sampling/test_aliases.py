"""Aliases of a sine wave's wall: the same readings, the right weights, nothing elsewhere."""

from typing import Any

import numpy as np
import pytest
import scipy

from inference.density.collapsed import CollapsedDensity, collapsed_density
from inference.posterior.infer import infer
from inference.posterior.sampling.aliases import aliases_of, with_aliases
from inference.posterior.sampling.effort import scouts
from inference.posterior.sampling.population import first_population, temper
from inference.posterior.sampling.start import refine
from inference.posterior.settings import SamplerSettings
from simulator.errors import RefusedError
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

SINE = {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [1e-5, 1e-5]}}
PULSE = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-5, 1e-5]}}
TURN = 299792458 / (2 * 2e7)
OBJECT = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}
WALL: dict[str, Any] = {"strength": 0.0177, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}
RANGES = {"prior": "loguniform", "low": 0.05, "high": 2.5}
WIDE = {"prior": "lognormal", "median": 6.0, "sigma": 1.0}


def _density(sensor: dict[str, Any], **wall: Any) -> CollapsedDensity:
    of = parse_sensor(sensor)
    truth = {"object": OBJECT, "background": WALL, "discrepancy": 0}
    path = SampledTrajectory(range_m=[0.3, 0.7, 1.5])
    frames = simulate(of, parse_scene(truth), path, 1).frames
    joint = wall.pop("joint", None)
    document = {**truth, "background": {**WALL, **wall}, "range_m": RANGES}
    if joint is not None:
        document["joint"] = joint
    return collapsed_density(of, parse_scene(document), frames)


JOINT = {
    "unknowns": ["background.strength", "background.distance_m"],
    "modes": [{"mean": [0.3, 0.2], "covariance": [[0.64, 0.43], [0.43, 0.81]]}],
}
STRENGTH = {"prior": "lognormal", "median": 0.02, "sigma": 0.3}


@pytest.mark.parametrize(
    "density",
    [
        _density(PULSE, distance_m=WIDE),
        _density(SINE),
        _density(SINE, strength=STRENGTH),
        _density(SINE, distance_m={"prior": "normal", "mean": 3.0, "sd": 0.5}),
    ],
    ids=["pulse", "known wall", "known distance", "prior within a turn"],
)
def test_other_scenes_have_none(density: CollapsedDensity) -> None:
    assert aliases_of(density) is None


@pytest.mark.parametrize("joint", [None, JOINT], ids=["independent", "joint"])
def test_walls_a_turn_apart_give_the_same_readings(joint: dict[str, Any] | None) -> None:
    density = _density(SINE, distance_m=WIDE, strength=STRENGTH, joint=joint)
    aliases = aliases_of(density)
    assert aliases is not None
    assert aliases.turn_m == pytest.approx(TURN, rel=1e-12)
    z = density.parameters.sample(np.random.default_rng(1), 50)
    z = z[aliases.distances(z) > 2.5]  # behind all ranges of the prior
    for turns in (1, 3):
        moved, _ = aliases.moved(z, aliases.distances(z) + turns * aliases.turn_m)
        natural, before = density.parameters.natural(moved), density.parameters.natural(z)
        assert natural[:, 0] == pytest.approx(before[:, 0], rel=1e-12)
        assert natural[:, 1] == pytest.approx(before[:, 1] + turns * TURN, rel=1e-12)
        # phases of some 10 turns lose their last digits, residuals of 1e3 noises squared
        assert density.log_likelihood(moved) == pytest.approx(density.log_likelihood(z), rel=1e-9)


@pytest.mark.parametrize("joint", [None, JOINT], ids=["independent", "joint"])
def test_the_ratio_is_that_of_flows_there_and_back(joint: dict[str, Any] | None) -> None:
    density = _density(SINE, distance_m=WIDE, strength=STRENGTH, joint=joint)
    aliases = aliases_of(density)
    assert aliases is not None
    start = density.parameters.sample(np.random.default_rng(1), 400)
    new, ratio = aliases.propose(start, np.random.default_rng(2))
    moved = np.isfinite(ratio)
    assert 50 < moved.sum() < 400
    assert np.array_equal(new[~moved], start[~moved])
    z, x = start[moved], new[moved]
    law = scipy.stats.lognorm(1.0, scale=6.0)

    def share(at: Any) -> Any:
        return law.cdf(at + TURN / 2) - law.cdf(at - TURN / 2)

    # determinants by differences, of all unknowns
    step, columns = 1e-5, []
    steps = aliases.distances(x) - aliases.distances(z)
    for j in range(2):
        ends = []
        for sign in (1, -1):
            shifted = z + sign * step * np.eye(2)[j]
            ends.append(aliases.moved(shifted, aliases.distances(shifted) + steps)[0])
        columns.append((ends[0] - ends[1]) / (2 * step))
    determinant = np.abs(np.linalg.det(np.stack(columns, axis=2)))
    there, back = share(aliases.distances(x)), share(aliases.distances(z))
    assert ratio[moved] == pytest.approx(np.log(back / there * determinant), abs=1e-5)


def test_the_move_leaves_the_prior_and_finds_every_weight() -> None:
    """From one alias: numbers of turns as the prior has them, p > 1e-6 (a false alarm in 1e6)."""
    density = _density(SINE, distance_m=WIDE)
    aliases = aliases_of(density)
    assert aliases is not None
    rng, log_prior = np.random.default_rng(3), density.parameters.log_prior
    first = 4.0 + TURN
    z = density.parameters.standard(np.full((20_000, 1), first))
    for _ in range(12):  # 0.65 of the proposals are the likeliest alias: few stay behind
        new, ratio = aliases.propose(z, rng)
        taken = np.log(rng.random(len(z))) < log_prior(new) - log_prior(z) + ratio
        z = np.where(taken[:, None], new, z)
    turns = np.round((aliases.distances(z) - 4.0) / TURN).astype(int)
    assert aliases.distances(z) == pytest.approx(4.0 + turns * TURN, rel=1e-9)
    weights = scipy.stats.lognorm(1.0, scale=6.0).pdf(4.0 + TURN * np.arange(400))
    weights /= weights.sum()
    counts = np.bincount(turns)
    cut = int(np.argmax(weights * len(z) < 20))
    seen = np.append(counts[:cut], counts[cut:].sum())
    foreseen = len(z) * np.append(weights[:cut], weights[cut:].sum())
    assert scipy.stats.chisquare(seen, foreseen * seen.sum() / foreseen.sum()).pvalue > 1e-6


def test_scouts_are_given_an_alias_anew_at_every_fourth_temperature() -> None:
    """That is one evaluation of each more than the one or two of their sweeps."""
    density, effort = _density(SINE, distance_m=WIDE), scouts(64)
    rng = np.random.default_rng(5)
    population = first_population(density, rng, effort)
    sweeps = []
    while not population.ended:
        before = population.calls
        population = temper(density, population, rng, effort)
        sweeps.append((population.calls - before) // effort.size)
    assert len(sweeps) > 4
    assert [count > 2 for count in sweeps] == [step % 4 == 0 for step in range(1, len(sweeps) + 1)]


@pytest.mark.parametrize("joint", [None, JOINT], ids=["independent", "joint"])
def test_aliases_of_an_optimum_are_optima(joint: dict[str, Any] | None) -> None:
    density = _density(SINE, distance_m=WIDE, strength=STRENGTH, joint=joint)
    aliases = aliases_of(density)
    assert aliases is not None
    best = refine(density, density.parameters.standard(np.array([[0.0177, 3.0]]))[0])
    assert best is not None
    found = with_aliases(aliases, density, [best])
    heights = [one.log_density for one in found]
    assert heights == sorted(heights, reverse=True)
    found = sorted(found, key=lambda one: one.z[1])
    assert found[0] is best
    assert len(found) > 5
    places = np.array([aliases.distances(one.z[None])[0] for one in found])
    assert places[1:] == pytest.approx(places[1] + TURN * np.arange(len(found) - 1), rel=1e-9)
    assert best.is_near(aliases.moved(found[1].z[None], places[1:2] - TURN)[0][0])
    # the next ones, climbed to by themselves, have the same place, height and width
    for one in found[1:4]:
        again = refine(density, one.z)
        assert again is not None
        assert one.is_near(again.z)
        assert again.log_density == pytest.approx(one.log_density, abs=0.01)
        assert again.factor @ again.factor.T == pytest.approx(one.factor @ one.factor.T, rel=0.05)


def test_importance_sampling_refuses_what_it_cannot_hold() -> None:
    wall = {**WALL, "distance_m": {"prior": "uniform", "low": 2.0, "high": 1200.0}}
    scene = parse_scene({"object": OBJECT, "background": wall, "range_m": RANGES, "discrepancy": 0})
    truth = parse_scene({"object": OBJECT, "background": WALL, "discrepancy": 0})
    frames = simulate(parse_sensor(SINE), truth, SampledTrajectory(range_m=[0.3, 0.7]), 1).frames
    settings = SamplerSettings(method="importance", seed=1)
    with pytest.raises(RefusedError, match=r"each 7.495 m behind the last"):
        infer(parse_sensor(SINE), scene, frames, settings)
