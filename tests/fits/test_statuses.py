"""`identified`, `weak` and `not_identified` mean the same of a fit and of a posterior."""

from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.fits.answer.report import entries
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.parameters import parameters_of
from simulator.sensor import parse_sensor
from simulator.trajectories import SampledTrajectory
from tests.fits.scenes import KINDS, data, exact_scene

BOX = {"c0": 0.1, "c1": 0.0, "c2": 0.1}
SENSOR = parse_sensor({**KINDS["pulsed"], "noise": {"read": [3e-3, 3e-3]}})


@pytest.mark.parametrize(
    ("span", "known", "path", "status"),
    [
        ((0.05, 0.5), {"c1": 0.0, "c2": 0.1}, "object.c0", "identified"),
        ((0.05, 1.0), {}, "object.c0", "weak"),
    ],
)
def test_a_fit_and_a_posterior_of_the_same_frames_say_the_same(
    span: tuple[float, float], known: dict[str, Any], path: str, status: str
) -> None:
    """Of 24 frames with a read noise of 3e-3, for which limits of their own said otherwise.

    The logarithm of c0 is known to 0.2 and to about 1, where its prior has 2: the spreads of 0.1
    and 0.5 are far from the limits of 0.2 and 0.7, whatever noise and sampling do.
    """
    ranges = np.geomspace(*span, 24).tolist()
    frames = data(SENSOR, {"object": BOX}, SampledTrajectory(range_m=ranges), 2)
    scene = exact_scene({"object": known} if known else {})
    (fit,) = estimate(SENSOR, scene, frames, ["joint_fit"]).results
    assert fit.parameters is not None
    posterior = infer(SENSOR, scene, frames, SamplerSettings(seed=1))
    (row,) = [row for row in posterior.identifiability if row.parameter == path]
    assert (fit.parameters[path]["status"], row.status) == (status, status)


@pytest.mark.parametrize(
    ("sd", "status"), [(0.19, "identified"), (0.21, "weak"), (0.9, "weak"), (1.0, "not_identified")]
)
def test_the_prior_of_the_scene_is_the_measure(sd: float, status: str) -> None:
    """Between normal laws the spread is s / sqrt(1 + s^2), s the sd over the prior's.

    0.2 and 0.7 are reached at s = 0.204 and 0.980.
    """
    normal = {"prior": "normal", "mean": 0.0, "sd": 0.01}
    scene = exact_scene({"crosstalk": [normal, 0.0], "object": BOX})
    found = entries(parameters_of(SENSOR, scene), {"crosstalk.w1": (0.0, 0.01 * sd, np.inf)})
    assert found["crosstalk.w1"]["status"] == status


def test_the_logarithm_of_what_is_positive_is_judged() -> None:
    wide = {"prior": "lognormal", "median": 0.1, "sigma": 4.0}
    parameters = parameters_of(SENSOR, exact_scene({"object": {**BOX, "c0": wide}}))
    far = entries(parameters, {"object.c0": (0.1, 1e3, 0.5)})["object.c0"]
    assert (far["sd"], far["status"]) == (1e3, "identified")
    none = entries(parameters, {"object.c0": (np.inf, np.nan, np.nan)})["object.c0"]
    assert none == {"value": None, "sd": None, "status": "not_identified"}
