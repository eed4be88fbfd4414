"""What a fit by default says of light that its scene leaves out."""

import numpy as np
import pytest
from scipy import special

import hybridtof
from inference.estimates import TechniqueResult
from tests.posterior.scenes import KINDS, OBJECT, data, sensor_of

NOISE = 1e-4


@pytest.mark.parametrize(
    ("kind", "crosstalk"),
    [("pulsed", (0.004, 0.02)), ("pulsed", (0.0004, 0.002)), ("sine_wave", (0.001, 0.02))],
)
def test_crosstalk_that_is_not_stated_is_a_misfit(
    kind: str, crosstalk: tuple[float, float]
) -> None:
    """It was none, by chi-square: ranges 11 to 240 standard deviations off, and unique."""
    sensor = hybridtof.parse_sensor({**KINDS[kind], "noise": {"read": [NOISE, NOISE]}})
    truth = {"crosstalk": list(crosstalk), "discrepancy": 0}
    frames = data(sensor, truth, 24, 1, (0.25, 1.2)).frames
    (result,) = hybridtof.estimate(sensor, hybridtof.parse_scene({}), frames, ["joint_fit"]).results
    assert result.fit is not None
    assert result.parameters is not None
    assert result.fit["misfit"]
    assert any("crosstalk" in reason for reason in result.fit["reasons"])
    assert np.isnan(result.range_m).all()
    assert {each["status"] for each in result.parameters.values()} == {"not_identified"}


def test_the_check_for_crosstalk_is_what_its_fit_would_gain() -> None:
    """A score test against the deviance of a fit whose crosstalk is unknown, all else as it is.

    Of crosstalk that is small beside the light all is linear to 2 %.
    """
    sensor = sensor_of("sine_wave")
    noise = sensor.noise.read[0]
    told = {"prior": "normal", "mean": 0.0, "sd": 1e3 * noise}
    truth = {"crosstalk": [8.0 * noise, -5.0 * noise], "discrepancy": 0}
    frames = data(sensor, truth, 20, 1).frames
    without, with_it = (
        hybridtof.estimate(sensor, hybridtof.parse_scene(scene), frames, ["joint_fit"])
        .results[0]
        .fit
        for scene in ({}, {"crosstalk": [told, told]})
    )
    assert without is not None
    assert with_it is not None
    gain = special.chdtri(2, without["checks"]["crosstalk"])
    assert gain == pytest.approx(without["deviance"] - with_it["deviance"], rel=0.02)
    assert with_it["checks"]["crosstalk"] == 1.0
    assert without["misfit"]
    assert not with_it["misfit"]
    assert with_it["reasons"] == []


def test_an_object_unlike_its_priors_is_a_misfit_that_says_so() -> None:
    """The scene has c1 = 0.5 m +- 5 cm, which is -0.12 m, and knows the rest of the object."""
    sensor = sensor_of("pulsed")
    law = {"prior": "normal", "mean": 0.5, "sd": 0.05}
    scene = hybridtof.parse_scene({"object": {**OBJECT, "c1": law}})
    frames = data(sensor, {"discrepancy": 0}, 20, 1).frames
    (result,) = hybridtof.estimate(sensor, scene, frames, ["joint_fit"]).results
    assert result.fit is not None
    assert result.fit["checks"]["priors"] < 1e-3
    assert any("priors" in reason for reason in result.fit["reasons"])


@pytest.mark.parametrize("noise", [1e-5, 1e-7])
def test_a_glass_that_leaks_no_light_is_no_misfit(noise: float) -> None:
    """Half normal priors of the crosstalk, which is none: each was 3 to 4 deviations off.

    Four unknowns in five are within their laws, the two of the crosstalk at their end.
    """
    sensor = hybridtof.parse_sensor({**KINDS["pulsed"], "noise": {"read": [noise, noise]}})
    told = [{"prior": "halfnormal", "sd": 0.002}, {"prior": "halfnormal", "sd": 0.02}]
    path = hybridtof.SampledTrajectory(
        range_m=[1.0] * 5 + list(np.geomspace(0.25, 1.2, 15)),
        object_present=[False] * 5 + [True] * 15,
    )
    truth = hybridtof.parse_scene({"object": OBJECT, "discrepancy": 0})
    seen = hybridtof.simulate(sensor, truth, path, 3)
    scene = hybridtof.parse_scene({"crosstalk": told})
    (result,) = hybridtof.estimate(sensor, scene, seen.frames, ["joint_fit"]).results
    assert result.fit is not None
    assert not result.fit["misfit"]
    assert result.fit["checks"]["priors"] > 0.01
    off = np.abs(result.range_m[5:] - seen.range_m[5:]) / result.sd_m[5:]
    assert off.max() < 4.0  # one of fifteen frames beyond it in a thousand runs


def test_a_prior_that_ends_before_the_truth_is_a_misfit() -> None:
    """No density of a uniform law is against its end, but what pulls c2 beyond it is."""
    sensor = sensor_of("pulsed")
    law = {"prior": "uniform", "low": 0.15, "high": 0.5}  # it is 0.0957
    scene = hybridtof.parse_scene({"object": {**OBJECT, "c2": law}})
    frames = data(sensor, {"discrepancy": 0}, 24, 1, (0.25, 1.2)).frames
    (result,) = hybridtof.estimate(sensor, scene, frames, ["joint_fit"]).results
    assert result.fit is not None
    assert result.fit["checks"]["priors"] < 1e-6


def test_the_check_of_priors_is_what_the_readings_alone_say_against_them() -> None:
    """One unknown, told as well by its prior as by readings whose light errs.

    What the readings alone say is the answer under a prior that is a hundred times as wide. In the
    log of c2 all is linear to a few percent.
    """
    sensor = sensor_of("pulsed")
    frames = data(sensor, {"discrepancy": 0}, 20, 1).frames

    def fitted(median: float, sigma: float) -> TechniqueResult:
        law = {"prior": "lognormal", "median": median, "sigma": sigma}
        scene = hybridtof.parse_scene({"object": {**OBJECT, "c2": law}, "discrepancy": 0.05})
        return hybridtof.estimate(sensor, scene, frames, ["joint_fit"]).results[0]

    alone = fitted(OBJECT["c2"], 5.0).parameters
    assert alone is not None
    value, width = (alone["object.c2"][key] for key in ("value", "sd"))
    width /= value
    off = 3.0
    fit = fitted(value * np.exp(off * np.sqrt(2.0) * width), width).fit
    assert fit is not None
    assert special.chdtri(1, fit["checks"]["priors"]) == pytest.approx(off**2, rel=0.1)
