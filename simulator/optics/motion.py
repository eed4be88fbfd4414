"""Motion: poses as functions of time, and series of readings with the truth."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.optics.assembly import OpticalScene, Reading, modulation_of, read
from simulator.optics.vectors import Pose, Vector, normalised
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["PoseOfTime", "Series", "linear", "radial", "rotation", "series"]

Array = NDArray[np.float64]
PoseOfTime = Callable[[float], Pose]


def linear(start: Pose, velocity_m_per_s: Vector) -> PoseOfTime:
    """Return straight motion without turning, off-axis unless the velocity points at the sensor."""

    def pose(time_s: float) -> Pose:
        x, y, z = (time_s * v for v in velocity_m_per_s)
        return start.moved((x, y, z))

    return pose


def radial(start: Pose, speed_m_per_s: float) -> PoseOfTime:
    """Return motion along the ray from the origin through the start; positive speed recedes."""
    x, y, z = normalised(start.position_m)
    v = speed_m_per_s
    return linear(start, (v * x, v * y, v * z))


def rotation(
    start: Pose, axis: Vector, rate_rad_per_s: float, about_m: Vector | None = None
) -> PoseOfTime:
    """Return turning about an axis through the pose's centre or through another point."""

    def pose(time_s: float) -> Pose:
        return start.turned(axis, rate_rad_per_s * time_s, about_m)

    return pose


@dataclass(frozen=True, eq=False)
class Series:
    """Frames of a moving surface with the truth behind them.

    Attributes
    ----------
    frames : Frames
        What the sensor delivers, with times.
    range_m : ndarray, shape (n,)
        True effective distance of the surfaces, as the sensor's modulation defines it; nan where
        they return no light.
    flux : ndarray, shape (n,)
        True flux of the surfaces per Phi0 A_D [1/m^2].
    visible_share : ndarray, shape (n,)
        S of the background; nan without one.
    readings : tuple of Reading
        Everything about every frame.
    """

    frames: Frames
    range_m: Array
    flux: Array
    visible_share: Array
    readings: tuple[Reading, ...]


def series(
    scene: OpticalScene,
    motion: PoseOfTime,
    time_s: Array,
    sensor: Sensor,
    rng: np.random.Generator | None = None,
    *,
    moving: int = 0,
    temperature_k: Callable[[float], float] | None = None,
) -> Series:
    """Return what a sensor reads while one surface of a scene moves.

    Parameters
    ----------
    scene : OpticalScene
        The scene; light is fast, so that every frame is still.
    motion : callable
        Pose at a time [s]; of a sphere only the position counts.
    time_s : ndarray, shape (n,)
        Times of the frames [s].
    rng : numpy.random.Generator, optional
        Source of noise.
    moving : int
        Which surface moves.
    temperature_k : callable, optional
        Temperature at a time [K].

    Raises
    ------
    InvalidInputError
        If there is no such surface or no time, and as `read` with the frame in the pointer.
    """
    times = np.asarray(time_s, dtype=np.float64)
    if times.ndim != 1 or times.size == 0 or not np.all(np.isfinite(times)):
        raise InvalidInputError.at("/time_s", "must be a list of finite times")
    if not 0 <= moving < len(scene.surfaces):
        raise InvalidInputError.at("/moving", f"the scene has {len(scene.surfaces)} surfaces")
    readings = []
    for i, time in enumerate(times.tolist()):
        surfaces = list(scene.surfaces)
        surfaces[moving] = surfaces[moving].at(motion(time))
        still = scene.model_copy(update={"surfaces": tuple(surfaces)})
        kelvin = None if temperature_k is None else temperature_k(time)
        try:
            readings.append(read(still, sensor, rng, temperature_k=kelvin))
        except InvalidInputError as error:
            raise error.below(f"/frames/{i}") from None
    modulation = modulation_of(sensor)
    objects = [reading.light.objects for reading in readings]
    if isinstance(sensor, PulsedSensor):
        ranges = [light.pulse_distance_m(modulation) for light in objects]
    else:
        ranges = [light.phase_distance_m(modulation) for light in objects]
    return Series(
        frames=Frames(np.array([reading.values for reading in readings]), time_s=times),
        range_m=np.array(ranges),
        flux=np.array([light.flux for light in objects]),
        visible_share=np.array([reading.light.visible_share for reading in readings]),
        readings=tuple(readings),
    )
