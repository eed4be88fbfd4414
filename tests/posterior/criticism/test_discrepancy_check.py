"""What an answer owes to the stated size of the discrepancy."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
import scipy

from inference.density.collapsed import collapsed_density
from inference.density.discrepant import DiscrepantDensity, with_discrepancy
from inference.identifiability.status import Identifiability
from inference.posterior.answer.fit import Fit
from inference.posterior.criticism.discrepancy_check import (
    LargerDiscrepancy,
    judge_fit,
    larger_discrepancy,
    misses,
    with_model_part,
)
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, data, sensor_of

GOOD = Fit(0.5, False, (), 10.0, 10.0, (), ())
ROWS = (
    Identifiability("object.c2", "weak", 0.5, "a reason"),
    Identifiability("range_m", "identified", 0.99, "a reason"),
)


def amplitude_density(stated: float, true: float, seed: int) -> DiscrepantDensity:
    """Return a density whose only unknown is c2."""
    scene: dict[str, Any] = {
        "object": {
            "c0": OBJECT["c0"],
            "c1": OBJECT["c1"],
            "c2": {"prior": "lognormal", "median": OBJECT["c2"], "sigma": 0.3},
        },
        "crosstalk": [0.002, 0.01],
        "range_m": {"prior": "loguniform", "low": 0.3, "high": 1.5},
    }
    sensor = sensor_of("pulsed", 1000.0)
    truth = {"crosstalk": [0.002, 0.01], "discrepancy": true}
    frames = data(sensor, truth, 10, seed=seed, span=(0.4, 1.2)).frames
    return with_discrepancy(collapsed_density(sensor, parse_scene(scene), frames), stated)


def draws_of(density: DiscrepantDensity, seed: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Draw the one unknown by quadrature."""
    grid = np.linspace(-4, 4, 401)
    value = density(grid[:, None])
    total = np.cumsum(np.exp(value - value.max()))
    uniform = np.random.default_rng(seed).random(400)
    return np.asarray(np.interp(uniform, total / total[-1], grid))[:, None]


def larger_of(
    density: DiscrepantDensity, z: np.ndarray[Any, np.dtype[np.float64]]
) -> LargerDiscrepancy:
    log_r, stated, _ = density.draw_with_likelihoods(z, np.random.default_rng(1))
    return larger_discrepancy(density, z, log_r, density.total(stated))


def test_the_bayes_factor_is_the_ratio_of_both_integrals() -> None:
    density = amplitude_density(stated=0.05, true=0.05, seed=1)
    larger = with_discrepancy(density, 0.1)
    grid = np.linspace(-6, 6, 601)[:, None]
    wanted = np.exp(larger(grid) - density(grid).max()).sum()
    wanted /= np.exp(density(grid) - density(grid).max()).sum()
    z = draws_of(density, 1)
    found = larger_of(density, z)
    gain = np.exp(larger.log_likelihood(z) - density.log_likelihood(z))
    error = gain.std() / math.sqrt(len(z))
    assert found.bayes_factor == pytest.approx(wanted, abs=5 * error + 0.02 * wanted)


def test_an_error_of_the_stated_size_is_no_misfit() -> None:
    """False alarms: at most 1e-3 each (Markov), ten sets."""
    for seed in range(10):
        density = amplitude_density(stated=0.05, true=0.05, seed=seed)
        z = draws_of(density, seed)
        found = larger_of(density, z)
        assert not judge_fit(GOOD, found).misfit


def test_an_error_far_above_the_stated_size_is_a_misfit() -> None:
    density = amplitude_density(stated=0.01, true=0.3, seed=3)
    z = draws_of(density, 3)
    found = larger_of(density, z)
    assert judge_fit(GOOD, found).misfit


def test_means_move_as_by_the_density_of_the_larger_size() -> None:
    """Plain weights of these draws would do; flattened ones lose a part of what they say."""
    density = amplitude_density(stated=0.05, true=0.05, seed=1)
    z = draws_of(density, 1)
    grid = np.linspace(-6, 6, 601)[:, None]
    means = []
    for one in (density, with_discrepancy(density, 0.1)):
        weights = scipy.special.softmax(one(grid))
        means.append(float(weights @ grid[:, 0]))
    found = larger_of(density, z)
    assert found.of_z[0] == pytest.approx(means[1] - means[0], abs=5 * z.std() / math.sqrt(len(z)))


class _Weighted(DiscrepantDensity):
    """Gains of draws as they are told: by plain weights a few in the tail are all."""

    def log_likelihood(self, z: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
        return 2.0 * z[:, 0] ** 2 if self.discrepancy > 0.05 else np.zeros(len(z))


@pytest.mark.parametrize("unit", [1.0, 1e8])
def test_a_few_draws_in_the_tail_do_not_decide(unit: float) -> None:
    """Of 200 seeds the shift of a mean, which is nought: by plain weights 3.0 in the root mean
    square. Draws within 3.2 of it, an effective size of 300 and twice as far leave 0.37 at most."""
    density = amplitude_density(stated=0.05, true=0.05, seed=1)
    members = {f.name: getattr(density, f.name) for f in dataclasses.fields(density)}
    planted = _Weighted(**members)
    moved = []
    for seed in range(200):
        z = np.random.default_rng(seed).standard_normal((1000, 1))
        found = larger_discrepancy(planted, math.sqrt(unit) * z, z, np.zeros(1000))
        assert found.of_z[0] == pytest.approx(math.sqrt(unit) * found.of_log_r[0])
        moved.append(found.of_log_r[0])
    assert np.sqrt(np.mean(np.square(moved))) < 0.37


def test_the_model_error_is_a_number_and_small_ones_take_no_status_away() -> None:
    """Issue 12.7: a scale known to 0.03 % that the model's error moves by as much."""
    small = with_model_part(ROWS, 3e-4, 4e-4, 0.0, {"object.c2": 0.9}, {}, by_flux=True)
    assert small[0] == ROWS[0]
    assert small[1].status == "identified"
    assert small[1].reason.endswith("model error: +-0.03 %")
    assert with_model_part(ROWS, 0.0, 0.04, 0.0, {}, {}, by_flux=True) == ROWS


def test_what_is_mostly_told_by_a_bent_response_is_weak() -> None:
    """The scale, and such unknowns as owe most of their uncertainty to it."""
    rows = tuple(dataclasses.replace(row, status="identified") for row in ROWS)
    bent = with_model_part(rows, 0.03, 0.04, 0.4, {"object.c2": 0.6}, {}, by_flux=True)
    assert [row.status for row in bent] == ["weak", "weak"]
    assert all("changes by 40 % of itself: state `discrepancy`" in row.reason for row in bent)
    shadow = with_model_part(rows, 0.03, 0.04, 0.4, {"object.c2": 0.6}, {}, by_flux=False)
    assert [row.status for row in shadow] == ["weak", "weak"]
    for row in shadow:
        assert "40 % of itself: most of it is the error of the object's shadow" in row.reason
        assert "`discrepancy`" not in row.reason
    own = with_model_part(rows, 0.03, 0.04, 0.4, {"object.c2": 0.4}, {}, by_flux=True)
    assert own[0] == rows[0]
    # it matters only where the model's part does, and nothing becomes better by it
    assert (
        with_model_part(rows, 0.01, 0.04, 0.7, {"object.c2": 0.6}, {}, by_flux=True)[0] == rows[0]
    )
    lost = tuple(dataclasses.replace(row, status="not_identified") for row in ROWS)
    still = with_model_part(lost, 0.03, 0.04, 0.4, {"object.c2": 0.6}, {}, by_flux=True)
    assert [row.status for row in still] == ["not_identified"] * 2


def test_what_the_response_misses_is_weak_however_straight_the_scale_is() -> None:
    """Crosstalk that empty frames tell to 2e-8 was 25 sd off, the scale's response straight."""
    rows = tuple(dataclasses.replace(row, status="identified") for row in ROWS)
    missed = {"object.c2": 1.1}
    found = with_model_part(rows, 1e-3, 0.04, 0.1, {"object.c2": 0.1}, missed, by_flux=True)
    assert [row.status for row in found] == ["weak", "identified"]
    assert "moves it by more than that, by a linear response that the next" in found[0].reason
    small = with_model_part(rows, 1e-3, 0.04, 0.1, {}, {"object.c2": 0.9}, by_flux=True)
    assert [row.status for row in small] == ["identified", "identified"]
    assert misses(np.array([0.2, 1.1]))
    assert not misses(np.array([0.2, 0.9]))


def test_a_misfit_that_was_seen_stays() -> None:
    bad, nothing = dataclasses.replace(GOOD, misfit=True, reasons=("a reason",)), np.zeros(1)
    assert judge_fit(bad, LargerDiscrepancy(0.1, nothing, nothing)) == bad
    both = judge_fit(bad, LargerDiscrepancy(1e4, nothing, nothing))
    assert both.misfit
    assert len(both.reasons) == 2
