"""What is foreseen holds at most values that the priors allow, not only at their medians."""

from typing import Any

import numpy as np
import pytest

from inference.identifiability.before_data import Foresight, identifiability
from inference.identifiability.status import STATUSES
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

STROKE = np.geomspace(0.5, 1.2, 12).tolist()
SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [1e-4, 1e-4]}})
CROSSTALK = {"crosstalk": [{"prior": "halfnormal", "sd": 0.02}, {"prior": "halfnormal", "sd": 0.1}]}


def foresee(scene: dict[str, Any], at: dict[str, float] | None = None) -> Foresight:
    return identifiability(SENSOR, parse_scene(scene), STROKE, at=at)


def statuses(found: Foresight) -> dict[str, str]:
    return {row.parameter: row.status for row in found.identifiability}


@pytest.mark.parametrize("scene", [{}, CROSSTALK])
def test_three_draws_of_four_are_as_good_as_what_is_foreseen(scene: dict[str, Any]) -> None:
    """Held to independent draws: where fewer than a fifth are as good, it is not foreseen.

    Six of eight draws are as good once in 800 where a fifth of all are (binomial): a false alarm
    once in 80 of eleven rows, for the seed that stands.
    """
    found = foresee(scene)
    parameters = parameters_of(SENSOR, parse_scene(scene))
    z = np.random.default_rng(5).normal(size=(60, len(parameters)))
    truths = [
        statuses(foresee(scene, dict(zip(parameters.names, values, strict=True))))
        for values in parameters.natural(z).tolist()
    ]
    for name, status in statuses(found).items():
        as_good = [STATUSES.index(of[name]) <= STATUSES.index(status) for of in truths]
        assert np.mean(as_good) >= 0.2, name


def test_where_all_values_are_given_they_alone_decide() -> None:
    median = foresee(CROSSTALK).reference
    given = foresee(CROSSTALK, median)
    assert given.over_priors == {}
    left_open = foresee(CROSSTALK)
    worse = 0
    for row, here in zip(left_open.identifiability, given.identifiability, strict=True):
        assert STATUSES.index(row.status) >= STATUSES.index(here.status)
        if row.status != here.status:
            worse += 1
            assert "medians of their priors" in row.reason
            assert row.contraction < here.contraction
    assert worse >= 2  # c0 and the scale of the ranges, which dark objects leave open


def test_counts_are_of_the_draws_and_only_of_what_is_left_open() -> None:
    found = foresee(CROSSTALK)
    assert set(found.over_priors) == set(statuses(found))
    for name, counts in found.over_priors.items():
        assert list(counts) == list(STATUSES)
        assert sum(counts.values()) == 8
        better = sum(n for status, n in counts.items() if status == "identified")
        assert (statuses(found)[name] == "identified") <= (better >= 6)
    # all but the object given: its draws are left
    some = {name: value for name, value in found.reference.items() if "object" not in name}
    assert sum(foresee(CROSSTALK, some).over_priors["object.c0"].values()) == 8


def test_the_same_question_has_the_same_answer() -> None:
    assert foresee(CROSSTALK).identifiability == foresee(CROSSTALK).identifiability
