"""Frames of known temperature: what estimates of a sensor that follows it are made of."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.estimates import SdParts, Status, TechniqueResult
from inference.known import Known
from inference.technique import Task
from simulator.at_temperature import at_reference
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["UNKNOWN_TEMPERATURE", "solved_where_told", "task_of"]

Array = NDArray[np.float64]

UNKNOWN_TEMPERATURE = "the sensor's temperature is not known"


def solved_where_told(
    sensor: Sensor, frames: Frames, solve: Callable[[Frames], TechniqueResult]
) -> TechniqueResult:
    """Return answers to all frames, of which those of unknown temperature are none.

    Parameters
    ----------
    solve : callable
        What answers the others.

    Raises
    ------
    RefusedError
        Where there are no others, and what ``solve`` raises.
    """
    told = _told(sensor, frames)
    return solve(frames) if told is None else _with_untold(solve(frames.select(told)), told)


def _told(sensor: Sensor, frames: Frames) -> NDArray[np.bool_] | None:
    """Tell which frames can be used, shape (n,); None where all can."""
    if sensor.temperature is None or frames.temperature_k is None:
        return None
    told = np.isfinite(frames.temperature_k)
    if told.all():
        return None
    if not told.any():
        raise RefusedError("no frame tells the sensor's temperature: temperature_k is null in all")
    return told


def task_of(sensor: Sensor, scene: Scene, frames: Frames, known: Known, **more: Any) -> Task:
    """Return what a technique is given: a sensor at its reference temperature, and its frames.

    Parameters
    ----------
    sensor, scene, frames, known
        As of `Task`; frames of known temperature.
    **more
        Further members.
    """
    crosstalk = (0.0, 0.0) if known.crosstalk is None else known.crosstalk
    cold, frames = at_reference(sensor, frames, crosstalk)
    if cold is not sensor and scene.calibration is not None:
        # it was checked with the sensor that it is of, and a cold one would be another
        scene = scene.model_copy(update={"calibration": None})
    return Task(cold, scene, frames, known, **more)


def _with_untold(result: TechniqueResult, told: NDArray[np.bool_]) -> TechniqueResult:
    """Put the answers of frames of unknown temperature where they belong: none, and why."""
    reasons = (*result.reasons, UNKNOWN_TEMPERATURE)

    def spread(values: NDArray[Any], fill: float) -> NDArray[Any]:
        whole = np.full((told.size, *values.shape[1:]), fill, dtype=values.dtype)
        whole[told] = values
        return whole

    def parts(values: Array | None) -> Array | None:
        return None if values is None else spread(values, np.nan)

    sds = result.sd_parts_m
    return dataclasses.replace(
        result,
        status=spread(result.status, int(Status.NONE)),
        roots_m=spread(result.roots_m, np.nan),
        roots_sd_m=spread(result.roots_sd_m, np.nan),
        root_count=spread(result.root_count, 0),
        near_fold=spread(result.near_fold, False),
        reason=spread(result.reason, len(reasons) - 1),
        reasons=reasons,
        sd_parts_m=None if sds is None else SdParts(*(spread(part, np.nan) for part in sds)),
        range_bounds_m=parts(result.range_bounds_m),
        power_law=parts(result.power_law),
        power_law_sd=parts(result.power_law_sd),
        zeta=parts(result.zeta),
        zeta_sd=parts(result.zeta_sd),
    )
