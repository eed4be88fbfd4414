"""Whether the numbers and priors of a scene agree with physics and with its sensor."""

import math

from simulator.errors import InvalidInputError, Problem
from simulator.joint_checks import check_calibration, check_joint
from simulator.model_error import ErrorSizes
from simulator.priors import LEAST_LOG_MASS
from simulator.remembered import remembered
from simulator.scene import Quantity, Reference, Scene, Shadow, Stroke
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["check_scene", "largest"]


def _check_support(value: Quantity | None, low: float, high: float, where: str) -> list[Problem]:
    """Check a number against an open interval, a prior for any mass inside it."""
    if value is None:
        return []
    if isinstance(value, float | int):
        if not low < value < high:
            wanted = f"above {low:g}" if high == math.inf else f"between {low:g} and {high:g}"
            return [Problem(where, f"must be {wanted}, is {value:g}")]
        return []
    if not float(value.distribution().log_mass(low, high)) > LEAST_LOG_MASS:
        return [Problem(where, f"the prior has no mass between {low:g} and {high:g}")]
    return []


def largest(value: Quantity | None) -> float:
    """Return the largest value that a quantity can take (None: a default, without a bound)."""
    if value is None:
        return math.inf
    return float(value) if isinstance(value, float | int) else value.distribution().high


def _check_shape(c0: Quantity | None, c1: Quantity | None, where: str) -> list[Problem]:
    """Check c0 > 0 and c1 > -2 sqrt(c0): else the flux has poles (docs/model.md, conventions)."""
    problems = _check_support(c0, 0.0, math.inf, f"{where}/c0")
    if problems or c1 is None:
        return problems
    # with c0 free the widest support decides: a joint prior is refused only where nothing is left
    least = -2 * math.sqrt(largest(c0)) if largest(c0) < math.inf else -math.inf
    if isinstance(c1, float | int) and isinstance(c0, float | int):
        if not c1 > least:
            return [Problem(f"{where}/c1", f"must be above -2 sqrt(c0) = {least:g}, is {c1:g}")]
        return []
    if isinstance(c1, float | int):
        if not c1 > least:
            return [Problem(f"{where}/c1", "no c0 of its prior satisfies c1 > -2 sqrt(c0)")]
        return []
    return _check_support(c1, least, math.inf, f"{where}/c1")


def _check_range_error(sensor: Sensor, scene: Scene, limit: float) -> list[Problem]:
    """Check that a stated error of the range is below the span of the ranges.

    An error as large as the span leaves nothing to measure, and is a length in another unit.
    """
    if not isinstance(scene.discrepancy, ErrorSizes) or not scene.discrepancy.range_m:
        return []
    low, high = 0.0, min(limit, sensor.max_range_m)
    if isinstance(scene.range_m, Stroke | Reference):
        low, high = scene.range_m.low, min(scene.range_m.high, limit)
    elif scene.range_m is not None:
        law = scene.range_m.distribution()
        low, high = max(law.low, low), min(law.high, limit)
    if scene.discrepancy.range_m < high - low:
        return []
    return [
        Problem(
            "/discrepancy/range_m",
            f"an error of {scene.discrepancy.range_m:g} m is not below the span of the ranges, "
            f"{high - low:g} m: state its standard deviation in metres, or leave it out",
        )
    ]


@remembered
def check_scene(sensor: Sensor, scene: Scene) -> None:
    """Check known numbers and priors against physics and against the sensor.

    Parameters
    ----------
    sensor : Sensor
        A pulsed sensor cannot tell ranges or backgrounds beyond r0.

    Raises
    ------
    InvalidInputError
        With a pointer into the scene for each offending field.
    """
    problems = _check_shape(scene.object.c0, scene.object.c1, "/object")
    problems += _check_support(scene.object.c2, 0.0, math.inf, "/object/c2")
    limit, of_limit = (sensor.r0 if isinstance(sensor, PulsedSensor) else math.inf), "r0 ="
    if scene.background is not None:
        where = "/background"
        problems += _check_support(scene.background.strength, 0.0, math.inf, f"{where}/strength")
        distance = scene.background.distance_m
        problems += _check_support(distance, 0.0, math.inf, f"{where}/distance_m")
        if isinstance(distance, float | int):
            if distance > limit:
                message = (
                    f"lies beyond r0 = {limit:g} m, where the late window of a pulse saturates"
                )
                problems.append(Problem(f"{where}/distance_m", message))
        else:
            problems += _check_support(distance, 0.0, limit, f"{where}/distance_m")
        if isinstance(scene.background.shadow, Shadow):
            shadow = scene.background.shadow
            problems += _check_shape(shadow.c0, shadow.c1, f"{where}/shadow")
        if isinstance(distance, float | int) and 0 < distance < limit:
            limit, of_limit = float(distance), "the background at"
    if isinstance(scene.range_m, Stroke | Reference):
        # in logarithms, which are what a common law of the ranges is made from
        if math.log(scene.range_m.low) >= math.log(limit):
            problems.append(Problem("/range_m/low", f"lies beyond {of_limit} {limit:g} m"))
    elif scene.range_m is not None:
        problems += _check_support(scene.range_m, 0.0, limit, "/range_m")
        if scene.range_m.distribution().range_form is None:
            problems.append(
                Problem("/range_m/prior", f"{scene.range_m.prior!r} cannot be the prior of ranges")
            )
    if not problems:
        problems += _check_range_error(sensor, scene, limit)
    problems += check_joint(sensor, scene) + check_calibration(sensor, scene)
    if problems:
        raise InvalidInputError(*dict.fromkeys(problems))
