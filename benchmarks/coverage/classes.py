"""Classes of scenes seen through exact optics, and what inference is told of each."""

import dataclasses
import math
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.intervals import interval_row
from benchmarks.resumable import Row
from inference.posterior.settings import SamplerSettings
from simulator.catalogue import PlateScene, plate_scene
from simulator.frames import Frames
from simulator.optics.assembly import OpticalScene, read
from simulator.optics.electronics import Electronics
from simulator.optics.motion import series
from simulator.optics.surfaces import Disk, Rectangle, Shell
from simulator.sensor import Sensor, parse_sensor

__all__ = [
    "CLASSES",
    "FRAMES",
    "TERMS",
    "DataSet",
    "SceneClass",
    "at",
    "class_row",
    "draw",
    "settings_of",
    "surface",
    "told",
]

Array = NDArray[np.float64]

FRAMES = 24
SNR = 1000.0  # of the object in the middle of its stroke
KINDS: tuple[dict[str, Any], ...] = (
    {"kind": "pulsed", "pulse_width_s": 1e-7},
    {"kind": "sine_wave", "frequency_hz": 5e6},
)
# the sizes of Appendix B, and the disks of the misfit table
PLATES = ("W01H01", "W02H02", "W04H04", "W08H08", "W16H16", "W01H16", "W02H08", "W08H02", "W16H01")
RADII_M = (0.05, 0.1, 0.2, 0.4, 0.8)
MATERIALS = {"diffuse": "R00", "glossy": "R01"}
TILTS = {"T00": ("T00",), "tilted": ("T12", "T06", "T04")}
# what the scene says of a shadow of which nothing is known: sizes up to metres. The default prior
# of a shadow ties it to the c0 of a diffuse object; a glossy one has up to 1e17 times as much
SHADOW: Mapping[str, Any] = {
    "c0": {"prior": "lognormal", "median": 0.05, "sigma": 2.0},
    "c1": {"prior": "normal", "mean": 0.0, "sd": 0.5},
}
# what the scene says of the model's error; of the ranges it says nothing
_WALKED = "walked"  # nothing is stated of the method either, which is then `emcee`
TERMS: Mapping[str, Mapping[str, Any]] = {
    "default": {},
    "exact": {"discrepancy": 0},
    _WALKED: {},
}


@dataclasses.dataclass(frozen=True)
class SceneClass:
    """A class of scenes.

    Attributes
    ----------
    name : str
        Its name.
    shapes, materials, tilts : tuple of str
        What a data set chooses from.
    crosstalk, background : bool
        Whether there is any.
    """

    name: str
    shapes: tuple[str, ...] = ("plate", "disk")
    materials: tuple[str, ...] = ("diffuse", "glossy")
    tilts: tuple[str, ...] = ("T00", "tilted")
    crosstalk: bool = False
    background: bool = False

    @property
    def slug(self) -> str:
        """Name of its file."""
        return self.name.lower().replace(", ", "-").replace(" ", "-")


CLASSES: Mapping[str, SceneClass] = {
    each.slug: each
    for each in (
        *(
            SceneClass(f"{material} {shape}, {tilt}", (shape,), (material,), (tilt,))
            for shape in ("plate", "disk")
            for material in MATERIALS
            for tilt in TILTS
        ),
        SceneClass("crosstalk", crosstalk=True),
        SceneClass("background", background=True),
    )
}


@dataclasses.dataclass(frozen=True, eq=False)
class DataSet:
    """Readings of a surface on its way, with the truth.

    Attributes
    ----------
    sensor : Sensor
        The sensor.
    frames : Frames
        Its readings.
    range_m : ndarray, shape (n,)
        True effective distances [m].
    name : str
        Which surface.
    terms : dict
        What inference is told of crosstalk and background.
    """

    sensor: Sensor
    frames: Frames
    range_m: Array
    name: str
    terms: dict[str, Any]


def surface(group: SceneClass, rng: np.random.Generator) -> tuple[str, PlateScene, float]:
    """Choose a surface: its name, a plate that carries material and tilt, a disk's radius or 0."""
    material = MATERIALS[str(rng.choice(group.materials))]
    tilt = str(rng.choice(TILTS[str(rng.choice(group.tilts))]))
    if str(rng.choice(group.shapes)) == "plate":
        plate = plate_scene(f"{rng.choice(PLATES)}{material}{tilt}")
        return plate.code, plate, 0.0
    radius = float(rng.choice(RADII_M))
    return f"disk {radius:g} {material}{tilt}", plate_scene(f"W01H01{material}{tilt}"), radius


def at(plate: PlateScene, radius: float, distance_m: float) -> Rectangle | Disk:
    rectangle = plate.plate(distance_m)
    if not radius:
        return rectangle
    return Disk(radius_m=radius, pose=rectangle.pose, material=rectangle.material)


def draw(group: SceneClass, number: int, snr: float = SNR) -> DataSet:
    """Draw a data set of a class.

    The stroke starts at 0.1 to 0.4 m and ends 2 to 6 times as far; positions are spread evenly in
    log r within it. Crosstalk is normal with a tenth of the signal in the stroke's middle, and
    inference is told three tenths; the strength of a background is known to a factor exp(0.5), its
    distance exactly, of its shadow that it is up to metres wide.

    Parameters
    ----------
    group : SceneClass
        The class.
    number : int
        Of the data set: it alone fixes everything. Even ones are pulsed, odd ones sine waves.
    snr : float
        Of the object in the middle of its stroke.

    Returns
    -------
    DataSet
    """
    rng = np.random.default_rng([zlib.crc32(group.slug.encode()), number])
    kind = KINDS[number % 2]
    name, plate, radius = surface(group, rng)
    low = float(np.exp(rng.uniform(np.log(0.1), np.log(0.4))))
    high = low * float(np.exp(rng.uniform(np.log(2.0), np.log(6.0))))
    distances = np.exp(np.sort(rng.uniform(np.log(low), np.log(high), FRAMES)))
    silent = parse_sensor({**kind, "noise": {"read": [1.0, 1.0]}})

    def signal(distance_m: float) -> tuple[float, float]:
        scene = OpticalScene(surfaces=(at(plate, radius, distance_m),))
        return read(scene, silent, tolerance=1e-6).mean

    middle = float(np.hypot(*signal(math.sqrt(low * high))))
    noise = middle / snr
    sensor = parse_sensor({**kind, "noise": {"read": [noise, noise]}})
    scene = OpticalScene(surfaces=(at(plate, radius, 1.0),))
    terms: dict[str, Any] = {}
    if group.crosstalk:
        first, second = (0.1 * middle * rng.standard_normal(2)).tolist()
        scene = scene.model_copy(update={"electronics": Electronics(crosstalk=(first, second))})
        terms["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": 0.3 * middle}] * 2
    if group.background:
        distance = float(rng.uniform(3.0, 6.0))
        shell = Shell(radius_m=distance)
        scene = scene.model_copy(update={"background": shell})
        bare = read(OpticalScene(background=shell), silent, tolerance=1e-6).mean
        # w2, or the modulus: what the scene language calls a background's strength
        strength = bare[1] if kind["kind"] == "pulsed" else float(np.hypot(*bare))
        median = strength * float(np.exp(0.5 * rng.standard_normal()))
        terms["background"] = {
            "strength": {"prior": "lognormal", "median": median, "sigma": 0.5},
            "distance_m": distance,
            "shadow": SHADOW,
        }
    seen = series(scene, lambda d: at(plate, radius, d).pose, distances, sensor, rng)
    return DataSet(sensor, Frames(seen.frames.readings), seen.range_m, name, terms)


def told(data: DataSet, term: str) -> dict[str, Any]:
    """Return the scene that inference is given: nothing is known of the object."""
    return {**data.terms, **TERMS[term]}


def settings_of(term: str, number: int) -> SamplerSettings:
    """Return how a data set is sampled: by `auto`, but where no method is stated."""
    if term == _WALKED:
        return SamplerSettings(seed=number)
    return SamplerSettings(method="auto", seed=number)


def class_row(group: SceneClass, term: str, number: int, version: str = "") -> Row:
    """Draw a data set and hold its posterior's intervals to the truth."""
    data = draw(group, number)
    settings, scene = settings_of(term, number), told(data, term)
    return interval_row(data.name, data.sensor, scene, data.frames, data.range_m, settings, version)
