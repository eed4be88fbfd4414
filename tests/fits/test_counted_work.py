"""What a fit costs, counted: climbs, their steps, and evaluations of the deviance."""

from collections import Counter
from typing import Any

import pytest

from inference.estimate import estimate
from inference.estimates import Status
from inference.fits.likelihood import maximum
from inference.fits.likelihood.levenberg_marquardt import levenberg_marquardt
from tests.counting import counting
from tests.fits.scenes import OBJECT, VAGUE, data, exact_scene, path, sensor_of

CROSSTALK = {"crosstalk": [0.003, 0.01]}


@pytest.mark.parametrize(
    ("scene", "frames", "climbs", "steps", "tries"),
    [
        # a problem that is nearly linear: two or three steps a climb; today 16, 35, 35
        ({"object": OBJECT, "crosstalk": [VAGUE, VAGUE]}, 8, 20, 44, 1.1),
        # the brightness of the object as well; today 16, 47, 47
        ({"object": {"c0": 0.0769, "c1": -0.123}, "crosstalk": [VAGUE, VAGUE]}, 9, 20, 60, 1.1),
    ],
    ids=["crosstalk", "brightness"],
)
def test_climbs_and_their_steps(
    monkeypatch: pytest.MonkeyPatch,
    scene: dict[str, Any],
    frames: int,
    climbs: int,
    steps: int,
    tries: float,
) -> None:
    total: Counter[str] = Counter()
    climb = counting(levenberg_marquardt, total)
    monkeypatch.setattr(maximum, "levenberg_marquardt", climb)
    sensor = sensor_of()
    sent = data(sensor, {"object": OBJECT, "discrepancy": 0, **CROSSTALK}, path(frames))
    (result,) = estimate(sensor, exact_scene(scene), sent, ["joint_fit"]).results
    assert (result.status == Status.UNIQUE).all()
    made = total["levenberg_marquardt._linearise"]
    assert 0 < total["levenberg_marquardt.levenberg_marquardt"] <= climbs
    assert made <= steps
    # a step that does not help is tried again with more damping, which is seldom needed
    assert total["deviance.deviance"] <= tries * made
