"""States as bytes and of other trackers: refused before any kernel sees them."""

import contextlib
import dataclasses

import numpy as np
import pytest

from inference.posterior.archive import pack
from inference.tracking.hypotheses import COUNT
from inference.tracking.settings import TrackingSettings
from inference.tracking.state import state_from_bytes, state_to_bytes
from inference.tracking.track import step
from inference.tracking.tracker import tracker
from simulator.errors import InvalidInputError
from tests.tracking.scenes import PLATE, frames_of, scene_of, sensor_of

SNR_100 = 7.72e-5


def test_states_of_another_shape_are_refused_before_any_kernel_sees_them() -> None:
    sensor, scene = sensor_of(SNR_100), scene_of(PLATE)
    many, one = (tracker(sensor, scene, TrackingSettings(hypotheses=n)) for n in (64, 1))
    frames = frames_of(np.zeros((1, 2)))
    with pytest.raises(InvalidInputError, match="/state"):
        step(one, many.first, frames)
    first = one.first.hypotheses
    cut = dataclasses.replace(one.first, hypotheses=first._replace(numbers=first.numbers[:2]))
    with pytest.raises(InvalidInputError, match="numbers"):
        step(one, cut, frames)
    numbers = first.numbers.copy()
    numbers[COUNT] = 3.0
    wrong = dataclasses.replace(one.first, hypotheses=first._replace(numbers=numbers))
    with pytest.raises(InvalidInputError, match="counts hypotheses"):
        step(one, wrong, frames)


def test_bytes_with_something_missing_or_changed_are_refused() -> None:
    data = state_to_bytes(tracker(sensor_of(SNR_100), scene_of(PLATE)).first)
    for cut in range(0, len(data), 7):
        with pytest.raises(InvalidInputError, match="/state"):
            state_from_bytes(data[:cut])
    for place in range(0, len(data), 11):
        changed = bytearray(data)
        changed[place] ^= 0x55
        # either it is noticed, or it did not matter
        with contextlib.suppress(InvalidInputError):
            state_from_bytes(bytes(changed))


def test_states_that_were_written_as_archives_are_read_to_the_last_bit() -> None:
    sensor, scene = sensor_of(SNR_100), scene_of(PLATE)
    model = tracker(sensor, scene)
    frames = frames_of(np.full((2, 2), 3e-3))
    state, _ = step(model, model.first, frames)
    of, name = state.hypotheses, state.signature
    archived = pack({"kind": "track state 3", "signature": name}, of._asdict())
    for data in (archived, state_to_bytes(state)):
        found = state_from_bytes(data)
        assert found.signature == name
        for one, other in zip(found.hypotheses, of, strict=True):
            assert (one.shape, one.dtype, one.tobytes()) == (
                other.shape,
                other.dtype,
                other.tobytes(),
            )
    other_kind = pack({"kind": "track state 2", "signature": name}, of._asdict())
    with pytest.raises(InvalidInputError, match="/state"):
        state_from_bytes(other_kind)
