"""What was sent before is answered as if it had not been."""

import copy
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inference import plan as planning
from service import known_systems
from service.bodies import parse_document
from service.known_systems import read_system
from service.requests import EstimateRequest
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.validated import parse

GOOD: dict[str, Any] = {
    "sensor": {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-6]}},
    "scene": {"object": {"c0": 1.0, "c1": 0.1, "c2": 0.1}, "discrepancy": None},
    "frames": {"w1": [0.01], "w2": [1.5]},
}
VALUES: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, False, 1, 1.0, 0, 0.0, -0.0, float("nan"), "1", [], {}]
)
PLACES = st.sampled_from(
    [
        ("scene", "discrepancy"),
        ("scene", "object", "c0"),
        ("scene", "crosstalk"),
        ("sensor", "noise", "shot"),
        ("sensor", "kind"),
        ("sensor",),
        ("scene",),
        ("frames", "w1"),
        ("more",),
    ]
)


def said(read: Any, document: dict[str, Any]) -> str:
    try:
        return repr(read(EstimateRequest, document))
    except InvalidInputError as error:
        return repr(error.problems)


@settings(max_examples=300, deadline=None)
@given(PLACES, VALUES, st.booleans())
def test_a_system_that_was_sent_before_hides_no_fault(
    place: tuple[str, ...], value: Any, before: bool
) -> None:
    read_system(EstimateRequest, GOOD)
    document = copy.deepcopy(GOOD)
    here = document
    for name in place[:-1]:
        here = here[name]
    here[place[-1]] = value
    for _ in range(1 + before):
        assert said(read_system, document) == said(parse, document)


def test_equal_systems_are_one_and_no_more_are_kept_than_stated() -> None:
    raw = json.dumps(GOOD).encode()
    first, again = (parse_document(EstimateRequest, raw) for _ in range(2))
    assert first.sensor is again.sensor
    assert first.scene is again.scene
    for number in range(3 * known_systems._MOST):
        document = copy.deepcopy(GOOD) | {"scene": {"object": {"c0": 1.0 + number}}}
        assert read_system(EstimateRequest, document).scene.object.c0 == 1.0 + number
        assert len(known_systems._known) <= known_systems._MOST
    large = [0.0, 1.0] * known_systems._LARGEST
    with pytest.raises(InvalidInputError):
        read_system(EstimateRequest, {**GOOD, "scene": {"crosstalk": large}})


@settings(max_examples=100, deadline=None)
@given(
    st.integers(1, 7),
    st.booleans(),
    st.booleans(),
    st.sampled_from([{}, {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 1.0}, 0.1]}]),
    st.sampled_from(["radial", "static", "tangential"]),
    st.integers(0, 2**32 - 1),
)
def test_a_plan_that_was_made_before_is_that_of_the_frames(
    n: int, timed: bool, derived: bool, terms: dict[str, Any], motion: str, seed: int
) -> None:
    document = GOOD | {"scene": {"object": {"c0": 1.0}, "motion": motion} | terms}
    request = read_system(EstimateRequest, document)
    rng = np.random.default_rng(seed)
    frames = Frames(
        rng.normal(size=(n, 2)),
        np.arange(n, dtype=np.float64) if timed else None,
        rng.normal(size=(n, 2)) if derived else None,
    )
    made = planning.plan(request.sensor, request.scene, frames)
    assert made == planning._planned(request.sensor, request.scene, frames)
