"""Crosstalk of which the scene states priors: to a single frame its uncertainty is noise.

A reading is light plus crosstalk plus noise. Where the crosstalk has a prior, one frame has its
median taken off, and what is left of it is an additive error of the reading, as read noise is: of a
normal prior exactly so. What all frames share does not average down, of one frame it is the whole
truth (docs/model.md, prior-crosstalk).
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.estimates import SdParts, TechniqueResult
from inference.fits.answer.withheld import without_ranges
from inference.realtime.nearest_roots import nearest
from simulator.frames import Frames
from simulator.remembered import remembered
from simulator.scene import Quantity, Scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = [
    "FAINT",
    "StatedLight",
    "answers",
    "faint",
    "stated_light",
    "tells_more",
    "with_scene_part",
]

Array = NDArray[np.float64]

FAINT = (
    "the light of this frame is not far above what the prior of the crosstalk and the noise leave "
    "open: it may be none of the object's"
)
# standard deviations, of crosstalk and noise together, above which light is the object's: without
# an object two readings are as far off in one frame of 7e7, exp(-6^2 / 2)
_ABOVE = 6.0
# quantiles of a prior, in standard deviations of a normal law, within which its own width holds
_QUANTILES = np.array([1.0, 2.0, 3.0, 4.0])


class StatedLight(NamedTuple):
    """A scene with its crosstalk in numbers, and what these leave open.

    Attributes
    ----------
    sensor : Sensor
        The sensor with what is left open as a part of its read noise.
    scene : Scene
        With the medians of the priors as crosstalk.
    sd : (float, float)
        What is left open, as standard deviations [reading units].
    """

    sensor: Sensor
    scene: Scene
    sd: tuple[float, float]


@remembered
def stated_light(sensor: Sensor, scene: Scene) -> StatedLight | None:
    """Return a scene whose crosstalk has priors in numbers.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        The request; of a joint law what it does not name.

    Returns
    -------
    StatedLight or None
        None where there is no such crosstalk, where it is optional, where its law is beyond what
        can be computed with, and where the sensor's delay follows its temperature: light is turned
        then, and crosstalk is not.
    """
    if scene.crosstalk_values is None or "crosstalk" in scene.optional_terms:
        return None
    if sensor.temperature is not None and sensor.temperature.delay_drift_s_per_k is not None:
        return None
    named = () if scene.joint is None else scene.joint.unknowns
    values = list(scene.crosstalk_values)
    sds = [0.0, 0.0]
    for k, column in enumerate(sensor.columns):
        if f"crosstalk.{column}" not in named:
            values[k], sds[k] = _median_and_sd(values[k])
    read = np.hypot(sensor.noise.read, sds)
    if not any(sds) or not np.isfinite(read).all():
        return None
    noise = sensor.noise.model_copy(update={"read": (float(read[0]), float(read[1]))})
    numbers = scene.model_copy(update={"crosstalk": (values[0], values[1])})
    wider = sensor.model_copy(update={"noise": noise})
    return StatedLight(wider, numbers, (sds[0], sds[1]))


def _median_and_sd(value: Quantity) -> tuple[float, float]:
    """Return a quantity's median, and the normal law's width that holds its quantiles."""
    if isinstance(value, float | int):
        return float(value), 0.0
    law = value.distribution()
    median = float(law.from_normal(0.0))
    with np.errstate(all="ignore"):
        reach = np.maximum(
            law.from_normal(_QUANTILES) - median, median - law.from_normal(-_QUANTILES)
        )
        return median, float((reach / _QUANTILES).max())


def with_scene_part(
    light: StatedLight, frames: Frames, result: TechniqueResult, alone: TechniqueResult
) -> TechniqueResult:
    """Return an answer with what the crosstalk leaves open as the part ``scene``.

    Parameters
    ----------
    light : StatedLight
        The scene in numbers.
    frames : Frames
        The frames, n of them.
    result : TechniqueResult
        By the wider noise.
    alone : TechniqueResult
        By the sensor's own noise.

    Returns
    -------
    TechniqueResult
        Frames whose light may be crosstalk have no range, and `FAINT` as their reason.
    """
    parts = result.sd_parts_m
    assert parts is not None  # noqa: S101  # techniques of single frames have them
    assert alone.sd_parts_m is not None  # noqa: S101
    near = nearest(result.roots_m, alone.roots_m)
    own = np.full(result.roots_m.shape, np.nan)
    for k in range(alone.roots_m.shape[1]):
        here = near == alone.roots_m[:, k : k + 1]
        own = np.where(here, alone.sd_parts_m.noise[:, k : k + 1], own)
    noise = np.minimum(np.nan_to_num(own, nan=0.0), parts.noise)
    # in this order nothing underflows
    open_ = np.sqrt((parts.noise - noise) * (parts.noise + noise))
    split = SdParts(noise, np.hypot(parts.scene, open_), parts.model)
    told = dataclasses.replace(result, sd_parts_m=split)
    return without_ranges(told, FAINT, faint(light, frames, result.technique))


def faint(light: StatedLight, frames: Frames, technique: str) -> NDArray[np.bool_]:
    """Tell of which frames the light may be crosstalk to a technique, shape (n,)."""
    values = light.scene.crosstalk_values
    assert values is not None  # noqa: S101  # they are its numbers
    with np.errstate(all="ignore"):
        net = frames.readings - np.array(values, dtype=np.float64)
        if not isinstance(light.sensor, PulsedSensor):
            size = np.hypot(net[:, 0], net[:, 1])
        else:
            size = net[:, 0 if technique == "intensity_w1" else 1]
        return np.asarray(~(size > _ABOVE * max(light.sensor.noise.read)))


def answers(result: TechniqueResult) -> NDArray[np.bool_]:
    """Tell which frames have one range with a standard deviation, shape (n,)."""
    return np.isfinite(result.sd_m) & ~result.near_fold


def tells_more(result: TechniqueResult, other: TechniqueResult) -> bool:
    """Tell whether an answer by a prior of the crosstalk goes before one that needs none.

    Parameters
    ----------
    result, other : TechniqueResult
        With the prior, and of a technique that is immune to crosstalk, or finds it.

    Returns
    -------
    bool
        Whether more frames have a range, half as many at least as have roots or bounds by the
        other one; of as many whether they are sharper.
    """
    mine, theirs = answers(result), answers(other)
    if mine.sum() != theirs.sum():
        some = np.isfinite(other.roots_m).any(axis=1)
        if other.range_bounds_m is not None:
            some |= np.isfinite(other.range_bounds_m).any(axis=1)
        return bool(mine.sum() > theirs.sum() and 2 * mine.sum() >= some.sum())
    both = mine & theirs
    if not both.any():
        return bool(mine.any())
    return bool(np.median(result.sd_m[both]) < np.median(other.sd_m[both]))
