"""Streams whose calibrations are computed where the frames are read: the command line."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import orjson

from inference.self_calibration.calibration import Outcome, answer
from inference.self_calibration.following import Conclude, conclude
from inference.self_calibration.plan import Plan
from inference.self_calibration.state import CalibrationState
from service.errors import MalformedError

__all__ = ["concluding_as_before", "concluding_at_once", "events_in"]


def concluding_at_once(plan: Plan, lag: int) -> Conclude:
    """Return what computes a calibration as soon as it is asked for.

    Parameters
    ----------
    lag : int
        How many numbers after the frame that it was asked at it applies, 1 or more.
    """

    def concluding(state: CalibrationState) -> CalibrationState:
        if state.asked is None:
            return state
        return conclude(state, answer(plan.sensor, state.asked), state.asked.decided_at + lag)

    return concluding


def concluding_as_before(plan: Plan, events: Mapping[int, Mapping[str, Any]]) -> Conclude:
    """Return what applies calibrations where they applied before.

    Parameters
    ----------
    events : mapping
        By the number of the calibration, as answers told them. One that is not among them was not
        concluded; one that was not taken is not computed again.
    """

    def concluding(state: CalibrationState) -> CalibrationState:
        asked = state.asked
        if asked is None or (event := events.get(asked.number)) is None:
            return state
        if event["kind"] == "taken":
            outcome = answer(plan.sensor, asked)
        else:
            outcome = Outcome(None, event["reason"], event["misfit"])
        return conclude(state, outcome, event["applies_at"])

    return concluding


def events_in(path: Path) -> dict[int, dict[str, Any]]:
    """Return the calibrations that answers of a stream, or what GET said of it, tell of.

    Raises
    ------
    MalformedError
        Where the file is neither.
    """
    data = path.read_bytes()
    try:
        try:
            events = orjson.loads(data)["calibration"]["events"]
        except (orjson.JSONDecodeError, KeyError):
            told = [orjson.loads(line) for line in data.splitlines() if line.strip()]
            if not all("sequence" in line for line in told):
                raise KeyError("sequence") from None
            events = [line["calibration"] for line in told if "calibration" in line]
        found = {event["number"]: event for event in events if event["kind"] != "doubted"}
        if not all(
            isinstance(event["applies_at"], int)
            and isinstance(event["reason"], str)
            and (event["kind"] == "taken" or isinstance(event["misfit"], bool))
            for event in found.values()
        ):
            raise TypeError
    except (orjson.JSONDecodeError, KeyError, TypeError):
        raise MalformedError(
            f"{path}: neither answers of a stream, nor what GET said of it"
        ) from None
    return found
