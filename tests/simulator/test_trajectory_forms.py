"""A trajectory says by its members which form it has."""

import pydantic
import pytest

from simulator.trajectories import RadialTrajectory, SampledTrajectory, Trajectory

READ: pydantic.TypeAdapter[RadialTrajectory | SampledTrajectory] = pydantic.TypeAdapter(Trajectory)


def test_ends_without_a_kind_are_radial() -> None:
    ends = {"from_m": 0.3, "to_m": 1.0, "frames": 3}
    assert READ.validate_python(ends) == READ.validate_python({**ends, "kind": "radial"})
    assert isinstance(READ.validate_python({"range_m": [0.3]}), SampledTrajectory)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"from_m": 0.3, "frames": 3}, {"to_m"}),
        ({"to_m": 0.3, "frames": 3}, {"from_m"}),
        ({"range_m": [0.3], "frames": 3}, {"frames"}),
        ({"range_m": [0.3], "from_m": 0.3}, {"from_m"}),
        ({}, {"range_m"}),
    ],
)
def test_what_is_wrong_is_named_in_the_form_that_is_meant(
    given: dict[str, object], named: set[str]
) -> None:
    with pytest.raises(pydantic.ValidationError) as raised:
        READ.validate_python(given)
    assert {str(error["loc"][-1]) for error in raised.value.errors()} == named
