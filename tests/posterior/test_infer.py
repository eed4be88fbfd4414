"""The whole posterior: held to quadrature, to the truth, to docs/http.md, posteriors."""

import functools
import json
import math
from typing import Any

import numpy as np
import pytest
from scipy import special

from inference.density.collapsed import collapsed_density
from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, example, sensor_of


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("snr", [5.0, 1000.0])
def test_one_unknown_agrees_with_quadrature(kind: str, snr: float) -> None:
    sensor = sensor_of(kind, snr)
    frames = data(sensor, frames=8).frames
    scene = parse_scene({"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}, "discrepancy": 0})
    posterior = infer(sensor, scene, frames, SamplerSettings(seed=2))
    assert posterior.verdict.converged
    density = collapsed_density(sensor, scene, frames)
    wide = np.linspace(-8, 8, 4001)[:, None]
    centre = wide[np.argmax(density(wide)), 0]
    grid = centre + np.sinh(np.linspace(-7, 7, 4001)) * 2e-3
    log_mass = density(grid[:, None]) + np.log(np.gradient(grid))
    weights = np.exp(log_mass - special.logsumexp(log_mass))
    c2 = density.parameters.natural(grid[:, None])[:, 0]
    mean = weights @ c2
    sd = math.sqrt(weights @ (c2 - mean) ** 2)
    summary = posterior.parameters["object.c2"]
    # four cases: a false alarm once in 2e5 runs
    assert abs(summary.mean - mean) < 5 * summary.mcse_mean
    # the error of a standard deviation is sd / sqrt(2 ESS) for a normal law, more with tails
    assert summary.sd == pytest.approx(sd, rel=5 * 1.5 / math.sqrt(2 * summary.ess_bulk))


@functools.cache
def walked(kind: str, crosstalk: bool) -> Posterior:
    settings = SamplerSettings(method="emcee", seed=1)
    return infer(*example(kind, crosstalk, frames=40), settings)


@pytest.mark.parametrize("crosstalk", [False, True])
@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_converges_at_n_40(kind: str, crosstalk: bool) -> None:
    posterior = walked(kind, crosstalk)
    assert posterior.verdict.converged, posterior.verdict.reasons
    for summary in posterior.parameters.values():
        assert summary.ess_bulk >= 400
        assert summary.rhat is not None
        assert summary.rhat <= 1.01
    assert not posterior.fit.misfit


@pytest.mark.parametrize("kind", [pytest.param("pulsed", marks=pytest.mark.thorough), "sine_wave"])
def test_importance_agrees_with_ensembles(kind: str) -> None:
    request = example(kind, crosstalk=True, frames=40)
    weighted = infer(*request, SamplerSettings(method="importance", seed=3))
    drawn = walked(kind, crosstalk=True)
    assert weighted.runtime.k_hat is not None
    assert weighted.runtime.k_hat < 0.5
    assert drawn.verdict.converged
    for name, summary in drawn.parameters.items():
        other = weighted.parameters[name]
        error = np.hypot(summary.mcse_mean, other.mcse_mean)
        # five parameters, two kinds: a false alarm once in 5e4 runs
        assert abs(summary.mean - other.mean) < 4.9 * error
        assert other.rhat is None


def test_the_shape_is_the_contract_s() -> None:
    document = walked("pulsed", crosstalk=True).to_json()
    text = json.dumps(document, allow_nan=False)
    assert json.loads(text) == document
    assert set(document) == {
        "method",
        "seed",
        "drawn",
        "verdict",
        "parameters",
        "modes",
        "range_m",
        "identifiability",
        "fit",
        "left_out",
        "selection",
        "runtime",
        "assumptions",
    }
    assert set(document["parameters"]) == {
        "object.c0",
        "object.c1",
        "object.c2",
        "crosstalk.w1",
        "crosstalk.w2",
    }
    assert set(document["parameters"]["object.c0"]) == {
        "mean",
        "sd",
        "sd_parts",
        "q05",
        "q50",
        "q95",
        "ess_bulk",
        "ess_tail",
        "rhat",
        "mcse_mean",
        "modes",
    }
    assert set(document["range_m"]) == {
        "q05",
        "q50",
        "q95",
        "mean",
        "sd",
        "sd_parts",
        "mcse_mean",
        "mcse_q05",
        "mcse_q50",
        "mcse_q95",
        "near_fold",
        "modes",
    }
    mode = {"weight", "weight_error", "sd", "q05", "q95"}
    assert set(document["range_m"]["modes"][0][0]) == mode | {"range_m"}
    assert set(document["parameters"]["object.c0"]["modes"][0]) == mode | {"value"}
    (joint,) = document["modes"]
    assert set(joint) == {"parameters", "log_density", "weight", "weight_error"}
    assert joint["parameters"].keys() == document["parameters"].keys()
    assert joint["weight"] == 1.0
    assert set(document["runtime"]) == {"wall_s", "cpu_s", "likelihood_calls", "k_hat"}
    assert [row["term"] for row in document["left_out"]] == ["background"]


def _scaled(factor: float) -> Posterior:
    plain = sensor_of("pulsed")
    frames = data(plain, {"crosstalk": [0.002, 0.01]}).frames
    read = factor * plain.noise.read[0]
    sensor = parse_sensor(
        {"kind": "pulsed", "pulse_width_s": 1e-7, "gain": factor, "noise": {"read": [read, read]}}
    )
    prior: dict[str, Any] = {**UNKNOWN_CROSSTALK[0], "sd": 0.02 * factor}
    scene = parse_scene({"crosstalk": [prior, prior]})
    scaled = Frames(frames.readings * factor, frames.time_s)
    return infer(sensor, scene, scaled, SamplerSettings(seed=5, target_ess=100))


def test_units_of_the_readings_change_nothing() -> None:
    """Powers of two scale without rounding, but log densities carry other constants, which rounds
    an acceptance the other way once in a while: equal to within Monte Carlo errors."""
    one = _scaled(1.0)
    for factor in (2.0**-40, 2.0**40):  # about 1e-12 and 1e12
        other = _scaled(factor)
        assert (np.abs(other.range_m.q50 - one.range_m.q50) < 0.3 * one.range_m.sd).all()
        for name, summary in one.parameters.items():
            unit = factor if name.startswith("crosstalk") else 1.0
            again = other.parameters[name]
            error = math.hypot(summary.mcse_mean, again.mcse_mean / unit)
            assert abs(again.mean / unit - summary.mean) < 5 * error


def test_two_modes_of_a_range_are_reported_apart() -> None:
    """A sine wave that meets a background beyond half a turn: two ranges explain one frame.

    Of an exact model: by default the error of the shadow leaves either range open by more than the
    two are apart, and the interval holds both.
    """
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 20e6, "noise": {"read": [1e-6, 1e-6]}}
    )
    strength = 1 / (50 * math.pi)
    scene = parse_scene(
        {
            "object": {
                "c0": 0.0817,
                "c1": 0.0574,
                "c2": {"prior": "lognormal", "median": 0.002, "sigma": 1.0},
            },
            "background": {
                "strength": strength,
                "distance_m": 5.0,
                "shadow": {"c0": 0.0596, "c1": 0.0132},
            },
            "range_m": {"prior": "loguniform", "low": 0.05, "high": 5.0},
            "discrepancy": 0,
        }
    )
    # both ranges are physical solutions with different reflectances (c2 is unknown)
    frames = Frames(np.array([[0.00522929922254, -0.00147082061217]]))
    settings = SamplerSettings(seed=3)
    posterior = infer(sensor, scene, frames, settings)
    modes = posterior.range_m.modes[0]
    assert len(modes) == 2
    assert modes[0].range_m == pytest.approx(0.2627, rel=0.01)
    assert modes[1].range_m == pytest.approx(0.3825, rel=0.01)
    assert sum(mode.weight for mode in modes) == pytest.approx(1.0)
    # an average over both would be a range that explains nothing
    assert np.isnan(posterior.range_m.mean[0])
    assert np.isnan(posterior.range_m.sd[0])
    ranges = posterior.to_json()["range_m"]
    assert ranges["mean"] == ranges["sd"] == [None]
    for mode in modes:
        assert mode.q05 < mode.range_m < mode.q95
        assert mode.sd < 0.01
        assert mode.weight_error is not None
    quantiles = np.array([posterior.range_m.q05, posterior.range_m.q50, posterior.range_m.q95])
    assert np.abs(quantiles[:, 0, None] - [0.2627, 0.3825]).min(axis=1).max() < 0.01
    # each range goes with a reflectance of its own: so do the modes of c2
    c2 = posterior.parameters["object.c2"]
    assert len(c2.modes) == 2
    assert math.isnan(c2.mean)
    assert math.isnan(c2.sd)
    # shares of the same posterior, of all draws and of a few: a false alarm once in 1e6 runs
    error = math.hypot(*(m.weight_error or 0.0 for m in (modes[0], c2.modes[0])))
    assert min(abs(modes[0].weight - mode.weight) for mode in c2.modes) < 5 * error
    assert len(posterior.modes) >= 2
    total = math.fsum(mode.weight or 0.0 for mode in posterior.modes)
    assert total == pytest.approx(1.0, abs=1e-12)
    default = infer(sensor, scene.model_copy(update={"discrepancy": None}), frames, settings)
    assert default.range_m.q05[0] < 0.2627
    assert default.range_m.q95[0] > 0.3825
