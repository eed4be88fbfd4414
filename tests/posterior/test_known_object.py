"""An object whose numbers are known errs by what the fit that gave them has left."""

import pytest

from inference.posterior.infer import infer
from inference.posterior.job import prepare
from inference.posterior.settings import SamplerSettings
from simulator.discrepancy import DISCREPANCY_SD
from simulator.model_error import FITTED_SHARE
from simulator.scene import parse_scene
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of


@pytest.mark.parametrize(
    ("said", "flux"),
    [
        ({"object": OBJECT}, FITTED_SHARE * DISCREPANCY_SD),
        ({"object": OBJECT, "discrepancy": "default"}, FITTED_SHARE * DISCREPANCY_SD),
        ({"object": OBJECT, "discrepancy": 0.05}, 0.05),
        ({"object": {"c0": 0.0769, "c1": -0.123}}, DISCREPANCY_SD),
        ({}, DISCREPANCY_SD),
    ],
)
def test_numbers_of_an_object_leave_what_their_fit_has_left(
    said: dict[str, object], flux: float
) -> None:
    sensor = sensor_of("pulsed")
    scene = parse_scene({"crosstalk": UNKNOWN_CROSSTALK, **said})
    job = prepare(sensor, scene, data(sensor).frames, SamplerSettings(seed=1))
    assert job.model_error.flux == pytest.approx(flux)
    assert job.with_error_integrated().model_error.flux == pytest.approx(flux)


def test_another_object_than_the_one_that_is_known_is_a_misfit() -> None:
    """With an unknown object's errors it was none: ranges were off and `identified`."""
    sensor = sensor_of("pulsed", 300.0)
    frames = data(sensor, {"crosstalk": [0.002, 0.01], "discrepancy": 0}, 16).frames
    settings = SamplerSettings(seed=1, max_seconds=20.0)
    known: dict[str, object] = {"crosstalk": UNKNOWN_CROSSTALK, "object": OBJECT}
    right = infer(sensor, parse_scene(known), frames, settings)
    assert right.fit.misfit is False
    other = {**known, "object": {**OBJECT, "c0": 1.6 * OBJECT["c0"]}}
    assert infer(sensor, parse_scene(other), frames, settings).fit.misfit is True
