"""ROS 2: ``sensor_msgs/msg/Range``, as its ``Range.msg`` (jazzy) and REP 117 have it.

A float field that is no number is null, since JSON has none, and ``rep117`` beside it says which
one it stands for: "+inf" for an object beyond the limits or none at all, "-inf" for one too close,
"nan" for a frame without one answer. ``variance`` is 0 where it is not known.
"""

import math
from typing import Any

from service.messages.measured import Measured
from service.messages.message import Message

__all__ = ["MESSAGE"]

_INFRARED = 1
_WORDS = {"far": "+inf", "near": "-inf", None: "nan"}


def _stamp(time_s: float | None) -> dict[str, int]:
    """Return ``builtin_interfaces/Time``: whole seconds, negative ones too, and nanoseconds."""
    second = 0.0 if time_s is None else time_s
    whole = math.floor(second)
    nanoseconds = round((second - whole) * 1e9)
    return {"sec": whole + nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}


def _write(measured: Measured) -> dict[str, Any]:
    low, high = measured.limits_m
    value = measured.range_m if measured.certain else None
    return {
        "header": {"stamp": _stamp(measured.time_s), "frame_id": ""},
        "radiation_type": _INFRARED,
        "field_of_view": 0.0,
        "min_range": low,
        "max_range": high if math.isfinite(high) else None,
        "range": value,
        "variance": measured.variance_m2 or 0.0,
        "rep117": None if value is not None else _WORDS[measured.side],
        "status": measured.status,
    }


MESSAGE = Message("sensor_msgs/msg/Range", "application/vnd.hybridtof.ros-range+json", _write)
