"""Fits and posteriors before flat walls are right by default, and not without the shadow's error.

Errors are the disks' own, so that nothing is left to chance but the noise.
"""

from unittest import mock

import pytest

from benchmarks.flat_wall_frames import Set, answered, set_of
from simulator.discrepancy import DISCREPANCY_SD
from simulator.model_error import RANGE_ERROR_SD

OTHERS = {"flux": DISCREPANCY_SD, "range_m": RANGE_ERROR_SD}


def stating(given: Set, discrepancy: object) -> Set:
    return given._replace(scene={**given.scene, "discrepancy": discrepancy})


@pytest.mark.parametrize("number", [2, 6])
def test_fits_before_a_flat_wall_hold_only_with_the_error_of_its_shadow(number: int) -> None:
    given = set_of(number, "numbers")
    default = answered(given, "joint_fit", number)
    assert default is not None
    assert not default.flagged
    assert default.held.mean() > 0.9
    assert default.off.max() < 3.0
    without = answered(stating(given, OTHERS), "joint_fit", number)
    assert without is not None
    assert without.flagged
    stated = answered(stating(given, {**OTHERS, "shadow": 0.2}), "joint_fit", number)
    assert stated is not None
    assert not stated.flagged


@pytest.mark.thorough
def test_a_posterior_before_a_flat_wall_holds_only_with_the_error_of_its_shadow() -> None:
    given = set_of(2, "numbers")
    default = answered(given, "infer", 2)
    assert default is not None
    assert not default.flagged
    assert default.held.mean() > 0.9
    assert default.off.max() < 3.0
    exact = answered(stating(given, 0), "infer", 2)
    assert exact is not None
    assert exact.flagged
    # a misfit has room for noise, which is all that an exact model may err by
    assert exact.off.max() < 5.0
    with mock.patch("inference.posterior.criticism.room.asked_for", return_value=(1.0, 1.0)):
        without = answered(stating(given, 0), "infer", 2)
    assert without is not None
    assert without.flagged
    assert without.off.max() > 10.0


@pytest.mark.parametrize("number", [pytest.param(3, marks=pytest.mark.thorough), 5])
def test_bright_frames_before_a_flat_wall_are_no_misfit_where_the_answer_holds(
    number: int,
) -> None:
    """Draws of the exact model are thousands of noises off: no place to follow errors from."""
    said = answered(set_of(number, "numbers"), "infer", number)
    assert said is not None
    assert not said.flagged
    assert said.held.all()
