"""Readings of a scene of the report with the truth behind them."""

import dataclasses
import functools
import zlib

import numpy as np
from numpy.typing import NDArray

from service.report.scenes import ReportScene
from simulator.catalogue import plate_scene
from simulator.frames import Frames
from simulator.optics.assembly import OpticalScene, modulation_of, read
from simulator.optics.electronics import Electronics
from simulator.optics.motion import series
from simulator.optics.parametrisation import fit_object
from simulator.optics.surfaces import Shell
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import PulsedSensor, Sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = [
    "Readings",
    "err_together",
    "learns_crosstalk",
    "readings_of",
    "sets_of",
    "told_of_object",
]

Array = NDArray[np.float64]

_FRAME_S = 0.01
_LIGHT = 1e-8  # relative error of the light that the optical simulator adds up
_CALIBRATED_M = (0.1, 2.4)
_KEPT = 128  # sets of readings that are not made again
_OPTICAL = 2000  # frames, beyond which nothing is learnt that is worth the time


@dataclasses.dataclass(frozen=True, eq=False)
class Readings:
    """Frames and their truth.

    Attributes
    ----------
    frames : Frames
        The frames, those without an object first.
    range_m : ndarray, shape (n,)
        True ranges [m]; nan of a frame without object.
    """

    frames: Frames
    range_m: Array

    @property
    def present(self) -> NDArray[np.bool_]:
        """Where an object is, shape (n,)."""
        return np.isfinite(self.range_m)


def sets_of(
    scene: ReportScene, frames: int, seed: int, count: int, empty: int | None = None
) -> list[Readings]:
    """Make data sets of a scene, independent of one another and of those of other scenes.

    Parameters
    ----------
    frames : int
        Of each set, with the object.
    seed : int
        Of the report.
    count : int
        How many.
    empty : int, optional
        Frames without the object; left out: those of the scene.
    """
    without = scene.empty if empty is None else empty
    return [_made(scene, frames, _seed_of(scene, frames, seed, k), without) for k in range(count)]


@functools.lru_cache(maxsize=_KEPT)
def _made(scene: ReportScene, frames: int, seed: int, empty: int) -> Readings:
    """Return what the methods of one scene ask one after the other."""
    return readings_of(scene, frames, seed, empty)


def _seed_of(scene: ReportScene, frames: int, seed: int, number: int) -> int:
    """Return a seed of its own for a set: figures of several scenes are put together."""
    entropy = [seed, zlib.crc32(scene.name.encode()), frames, number]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])


def readings_of(scene: ReportScene, frames: int, seed: int, empty: int = 0) -> Readings:
    """Make readings of an object on its way, evenly in log range.

    Parameters
    ----------
    frames, empty : int
        Number of frames with and without the object.
    seed : int
        Of the noise.
    """
    if scene.plate:
        return _optical(scene, min(frames, _OPTICAL), seed, empty)
    ranges = np.r_[np.ones(empty), np.geomspace(scene.from_m, scene.to_m, frames)]
    way = SampledTrajectory(
        range_m=ranges.tolist(),
        time_s=(_FRAME_S * np.arange(ranges.size)).tolist(),
        object_present=[False] * empty + [True] * frames if empty else None,
    )
    made = simulate(scene.sensor, scene.truth, way, seed)
    return Readings(made.frames, made.range_m)


def _optical(scene: ReportScene, frames: int, seed: int, empty: int) -> Readings:
    rng = np.random.default_rng(seed)
    plate = plate_scene(scene.plate)
    values = scene.truth.crosstalk_values
    crosstalk = (0.0, 0.0) if values is None else tuple(map(float, values))  # type: ignore[arg-type]
    electronics = Electronics(crosstalk=(crosstalk[0], crosstalk[1]))
    wall = scene.truth.background
    shell = None if wall is None else Shell(radius_m=float(wall.distance_m))  # type: ignore[arg-type]
    bare = OpticalScene(electronics=electronics, background=shell)
    ranges = np.geomspace(scene.from_m, scene.to_m, frames)
    seen = series(
        bare.model_copy(update={"surfaces": (plate.plate(1.0),)}),
        lambda distance: plate.plate(distance).pose,
        ranges,
        scene.sensor,
        rng,
    )
    without = [read(bare, scene.sensor, rng).values for _ in range(empty)]
    both = np.array([*without, *seen.frames.readings.tolist()])
    present = np.arange(len(both)) >= empty
    found = Frames(
        both,
        time_s=_FRAME_S * np.arange(len(both), dtype=np.float64),
        object_present=present if empty else None,
    )
    return Readings(found, np.r_[np.full(empty, np.nan), seen.range_m])


@functools.cache
def _calibrated(plate: str, sensor: Sensor) -> tuple[float, float, float]:
    """Return c0, c1, c2 as a calibration at 40 distances without noise finds them."""
    made, light, ranges, modulation = plate_scene(plate), [], [], modulation_of(sensor)
    for distance in np.geomspace(*_CALIBRATED_M, 40).tolist():
        body = OpticalScene(surfaces=(made.plate(distance),))
        found = read(body, sensor, tolerance=_LIGHT).light.objects
        if isinstance(sensor, PulsedSensor):
            light.append(found.flux)
            ranges.append(found.pulse_distance_m(modulation))
        else:
            light.append(abs(found.phasor))
            ranges.append(found.phase_distance_m(modulation))
    fit = fit_object(np.array(ranges), np.array(light))
    return fit.c0, fit.c1, fit.c2


def told_of_object(scene: ReportScene) -> Scene:
    """Return what is told where the object is known: of a real plate what a calibration finds."""
    if not scene.plate:
        return scene.known
    c0, c1, c2 = _calibrated(scene.plate, scene.sensor)
    told = scene.known.model_dump(mode="json", exclude_unset=True)
    return parse_scene(told | {"object": {"c0": c0, "c1": c1, "c2": c2}})


def err_together(sensor: Sensor, told: Scene) -> bool:
    """Tell whether single frames have an error in common, which only other scenes would change.

    Parameters
    ----------
    told : Scene
        What a method that learns nothing from other frames is told: unknowns of their priors, or a
        model that may be wrong, are the same in all frames of all sets.
    """
    error = told.model_error
    return len(parameters_of(sensor, told)) > 0 or max(error.flux, error.range_m) > 0.0


def learns_crosstalk(scene: ReportScene) -> bool:
    """Tell whether a tracker learns crosstalk, and errs by nothing else that all tracks share."""
    values = scene.known.crosstalk_values or ()
    unknown = any(not isinstance(value, float | int) for value in values)
    error = scene.known.model_error
    return unknown and max(error.flux, error.range_m) == 0.0
