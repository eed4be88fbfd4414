"""What a fit costs, counted: climbs, their steps, and evaluations of the deviance."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Status
from inference.fits.answer import likelihood_answer
from inference.fits.likelihood import maximum
from inference.fits.likelihood.levenberg_marquardt import levenberg_marquardt
from simulator.errors import RefusedError
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


def test_one_fit_by_two_names_is_fitted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    sensor = sensor_of()
    sent = data(sensor, {"object": OBJECT, "discrepancy": 0, **CROSSTALK}, path(8))
    scene = exact_scene({"object": OBJECT, "crosstalk": [VAGUE, VAGUE]})
    names = ["joint_fit", "iterative_differential"]
    alone = [estimate(sensor, scene, sent, [name]).results[0] for name in names]
    fits = []
    found = likelihood_answer._found

    def counted(problem: Any) -> Any:
        fits.append(problem)
        return found(problem)

    monkeypatch.setattr(likelihood_answer, "_found", counted)
    both = estimate(sensor, scene, sent, names).results
    assert len(fits) == 1
    assert [result.technique for result in both] == names
    for one, other in zip(both, alone, strict=True):
        assert (one.technique, one.parameters, one.fit) == (
            other.technique,
            other.parameters,
            other.fit,
        )
        np.testing.assert_array_equal(one.roots_m, other.roots_m)
        np.testing.assert_array_equal(one.roots_sd_m, other.roots_sd_m)

    def refuse(problem: Any) -> Any:
        fits.append(problem)
        raise RefusedError("there is no telling")

    monkeypatch.setattr(likelihood_answer, "_found", refuse)
    left_out = {each.name: each.reason for each in estimate(sensor, scene, sent, names).left_out}
    assert [left_out[name] for name in names] == ["there is no telling"] * 2
    assert len(fits) == 2
