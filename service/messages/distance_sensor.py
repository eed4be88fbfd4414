"""MAVLink: ``DISTANCE_SENSOR`` (132) of the common dialect, fields of ``distance_sensor_send``.

Distances are whole centimetres, the variance whole square centimetres, rounded up so that it never
claims more than there is, the rounding of the distance included; 255 is unknown, and stands for all
that a byte cannot hold. ``signal_quality`` is 100 for a range that is the only one and whose error
is known, else 1, which means invalid; never 0, which means unknown. An invalid frame has a distance
outside the limits, on the side where the object is, so that a reader that does not know the quality
takes it for none of its ranges.
"""

import math
from typing import Any

from service.messages.measured import Measured
from service.messages.message import Message

__all__ = ["MESSAGE"]

_INFRARED = 2
_UNKNOWN = 255
_GREATEST = 65535
_ROUNDING_CM2 = 1 / 12
_VALID, _INVALID = 100, 1


def _covariance(variance_m2: float | None) -> int:
    if variance_m2 is None:
        return _UNKNOWN
    return min(math.ceil(min(1e4 * variance_m2, _UNKNOWN) + _ROUNDING_CM2), _UNKNOWN)


def _write(measured: Measured) -> dict[str, Any]:
    low, high = (min(100 * limit, _GREATEST - 1.0) for limit in measured.limits_m)
    # nearer than half a centimetre is 0, and 0 is no distance
    least, greatest = max(math.floor(low), 1), max(math.ceil(high), 1)
    distance = greatest + 1 if measured.side == "far" else 0
    if measured.certain and measured.range_m is not None:
        distance = round(min(100 * measured.range_m, greatest + 1.0))
    valid = measured.certain and least <= distance <= greatest
    milliseconds = 0 if measured.time_s is None else round(1000 * measured.time_s)
    return {
        "time_boot_ms": milliseconds % 2**32,
        "min_distance": least,
        "max_distance": greatest,
        "current_distance": distance,
        "type": _INFRARED,
        "id": 0,
        "orientation": 0,
        "covariance": _covariance(measured.variance_m2),
        "horizontal_fov": 0.0,
        "vertical_fov": 0.0,
        "quaternion": [0.0, 0.0, 0.0, 0.0],
        "signal_quality": _VALID if valid else _INVALID,
    }


MESSAGE = Message(
    "DISTANCE_SENSOR", "application/vnd.hybridtof.mavlink-distance-sensor+json", _write
)
