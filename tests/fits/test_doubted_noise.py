"""Noise that is stated too small, by less than a misfit says, decides nothing between optima."""

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from inference.fits.answer.report import DOUBTFUL
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

NOISE = 1.8e-6  # that of the readings
TRUTH = [0.7513, 0.655, 0.8713, 0.7525, 0.6381, 0.9318]
TRUTH += [0.3261, 0.1939, 0.2127, 0.3624, 0.2641, 0.1974]
W1 = [0.1979199, 0.20389778, 0.19327884, 0.19786294, 0.20524848, 0.19168846]
W1 += [0.27178579, 0.38180057, 0.35738357, 0.25653878, 0.30890915, 0.376975]
W2 = [0.44862002, 0.5682913, 0.36675088, 0.4474728, 0.59732849, 0.34135814]
W2 += [2.7372919, 8.98696473, 7.31310119, 2.13343937, 4.47546408, 8.64305875]
# crosstalk and the strength of a wall unknown: two objects explain the frames
SCENE = parse_scene(
    {
        "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.3}] * 2,
        "background": {
            "strength": {"prior": "lognormal", "median": 0.24, "sigma": 0.5},
            "distance_m": 1.3174315641444172,
            "shadow": {"c0": 0.31344271869964246, "c1": 0.08586071104420089},
        },
        "discrepancy": 0,
    }
)


def fitted(noise: float) -> TechniqueResult:
    sensor = parse_sensor({"kind": "pulsed", "pulse_width_s": 5e-8, "noise": {"read": [noise] * 2}})
    return estimate(sensor, SCENE, Frames(np.column_stack([W1, W2])), ["joint_fit"]).results[0]


def off(result: TechniqueResult) -> np.ndarray:
    """Return of each frame how many sd the truth is from the nearest range that is said."""
    away = np.abs(result.roots_m - np.array(TRUTH)[:, None]) / result.roots_sd_m
    return np.asarray(np.nanmin(away, axis=1))


def test_another_optimum_is_not_decided_against_by_noise_that_chi_square_doubts() -> None:
    """Stated at half: the wrong optimum was said alone, 27 sd off."""
    halved, whole = fitted(NOISE / 2), fitted(NOISE)
    for said in (halved, whole):
        assert said.fit is not None
        assert not said.fit["misfit"]
        assert (said.status == Status.AMBIGUOUS).all()
        assert (off(said) < 4.0).all()
    assert halved.fit is not None
    assert whole.fit is not None
    assert halved.fit["p_value"] < DOUBTFUL < whole.fit["p_value"]
    # what noise is doubted by is in the standard deviations: of both about as large
    np.testing.assert_allclose(halved.roots_sd_m, whole.roots_sd_m, rtol=0.35)


@pytest.mark.parametrize("factor", [1e-9])
def test_the_doubt_does_not_depend_on_the_unit(factor: float) -> None:
    sensor = parse_sensor(
        {
            "kind": "pulsed",
            "pulse_width_s": 5e-8,
            "gain": factor,
            "noise": {"read": [NOISE / 2 * factor] * 2},
        }
    )
    crosstalk = [{"prior": "normal", "mean": 0.0, "sd": 0.3 * factor}] * 2
    scene = SCENE.model_dump(exclude_none=True)
    scene["crosstalk"] = crosstalk
    scene["background"]["strength"]["median"] *= factor
    frames = Frames(np.column_stack([W1, W2]) * factor)
    said = estimate(sensor, parse_scene(scene), frames, ["joint_fit"]).results[0]
    np.testing.assert_allclose(said.roots_sd_m, fitted(NOISE / 2).roots_sd_m, rtol=1e-3)
