"""Scenes that a technique may serve, and readings of them, written straight from docs/model.md.

The menu is what a technique finds its scenes in: each is tried in all of those that its own needs,
immunities and obstacle allow. A technique that serves none of them needs a scene here.
"""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import PulsedSensor, Sensor, SineWaveSensor, parse_sensor

__all__ = ["MENU", "TERMS", "Setting", "frames_of", "light_of", "sensor_of", "span"]

Array = NDArray[np.float64]

TERMS = ("crosstalk", "background", "discrepancy")

# a plate of 0.4 m with c1 > 0, so that the bounds of an unknown object hold
C0, C1, C2 = 0.0817, 0.0574, 0.103
OBJECT = {"c0": C0, "c1": C1, "c2": C2}
CROSSTALK = (0.003, 0.01)  # in no special proportion to r0, or to the wall's distance
STRENGTH, DISTANCE = 0.0177, 3.0
WALL: dict[str, Any] = {"strength": STRENGTH, "distance_m": DISTANCE}
SHADOW = {"c0": 0.056, "c1": 0.013}
OWN_SHADOW = {"c0": C0, "c1": C1}
VAGUE = {"prior": "normal", "mean": 0.0, "sd": 0.05}
BRIGHTNESS = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}
READ = 1e-6  # the plate at 1 m reads 7e-3
SPEED = 1.0
_WAVES = 50  # of a smooth error: the kurtosis of its slope is 3.5, of a normal 3


@dataclasses.dataclass(frozen=True)
class Setting:
    """A scene as it is stated, and what is true.

    Attributes
    ----------
    name : str
        For messages.
    stated : dict
        The scene's document.
    crosstalk : bool
        Whether the readings contain crosstalk.
    shadow : dict or None
        Shadow of the background that the readings contain; None where there is none.
    discrepancy : bool
        Whether the object's flux differs from the model's.
    unknown : tuple of str
        Which of `TERMS` are in the readings without being known; of a background it is enough that
        it is there.
    errors : (float, float), optional
        Stated standard deviations of the model's errors, of the flux and of the effective distance
        [m]; left out the model is exact.
    """

    name: str
    stated: dict[str, Any]
    crosstalk: bool = False
    shadow: dict[str, float] | None = None
    discrepancy: bool = False
    unknown: tuple[str, ...] = ()
    errors: tuple[float, float] = (0.0, 0.0)

    @property
    def scene(self) -> Scene:
        """The scene as it is stated."""
        flux, range_m = self.errors
        return parse_scene(self.stated | {"discrepancy": {"flux": flux, "range_m": range_m}})

    def with_term(self, term: str) -> "Setting":
        """Return the same statement on readings that contain a term more."""
        changes: dict[str, Any] = {
            "crosstalk": {"crosstalk": True},
            "background": {"shadow": SHADOW},
            "discrepancy": {"discrepancy": True},
        }
        return dataclasses.replace(self, name=f"{self.name}, and {term}", **changes[term])

    def without(self, path: str) -> "Setting":
        """Return the same readings where one number of the object or the wall is unknown.

        Parameters
        ----------
        path : str
            Of the scene, such as ``background.shadow.c0``.
        """
        part, *between, name = path.split(".")
        unknown = dict(self.stated[part])
        holder = unknown
        for inner in between:
            holder[inner] = dict(holder[inner])
            holder = holder[inner]
        holder[name] = {"prior": "lognormal", "median": holder[name], "sigma": 0.5}
        stated = self.stated | {part: unknown}
        return dataclasses.replace(self, name=f"{self.name}, {path} unknown", stated=stated)

    def contains(self, term: str) -> bool:
        """Whether the readings contain a term."""
        return {
            "crosstalk": self.crosstalk,
            "background": self.shadow is not None,
            "discrepancy": self.discrepancy,
        }[term]


MENU = (
    Setting("a known object", {"object": OBJECT}),
    Setting("an unknown object", {}),
    Setting("known crosstalk", {"object": OBJECT, "crosstalk": list(CROSSTALK)}, crosstalk=True),
    Setting(
        "unknown crosstalk",
        {"object": OBJECT, "crosstalk": [VAGUE, VAGUE]},
        crosstalk=True,
        unknown=("crosstalk",),
    ),
    Setting(
        "unknown crosstalk before an object of unknown brightness",
        {"object": {"c0": C0, "c1": C1}, "crosstalk": [VAGUE, VAGUE]},
        crosstalk=True,
        unknown=("crosstalk",),
    ),
    Setting(
        "unknown crosstalk and an unknown object",
        {"crosstalk": [VAGUE, VAGUE]},
        crosstalk=True,
        unknown=("crosstalk",),
    ),
    Setting(
        "a known wall",
        {"object": OBJECT, "background": WALL | {"shadow": SHADOW}},
        shadow=SHADOW,
        unknown=("background",),
    ),
    Setting(
        "a known wall behind an unknown object",
        {"background": WALL | {"shadow": SHADOW}},
        shadow=SHADOW,
        unknown=("background",),
    ),
    Setting(
        "a wall of unknown strength",
        {"object": OBJECT, "background": WALL | {"strength": BRIGHTNESS, "shadow": SHADOW}},
        shadow=SHADOW,
        unknown=("background",),
    ),
    Setting(
        "a wall with an unknown shadow",
        {"object": OBJECT, "background": WALL},
        shadow=SHADOW,
        unknown=("background",),
    ),
    Setting(
        "a wall with the object's own shadow, both unknown",
        {"background": WALL | {"strength": BRIGHTNESS, "shadow": "object"}},
        shadow=OWN_SHADOW,
        unknown=("background",),
    ),
    Setting(
        "a known wall and unknown crosstalk",
        {
            "object": OBJECT,
            "background": WALL | {"shadow": SHADOW},
            "crosstalk": [VAGUE, VAGUE],
        },
        crosstalk=True,
        shadow=SHADOW,
        unknown=("crosstalk", "background"),
    ),
)


def sensor_of(kind: str, quiet: float = 1.0, full_scale: float | None = None) -> Sensor:
    """Return a sensor with every kind of noise, times a factor."""
    timing = {"pulse_width_s": 1e-7} if kind == "pulsed" else {"frequency_hz": 5e6}
    read = quiet * READ
    noise = {
        "read": [read, read],
        "shot": quiet * quiet * 1e-10,
        "relative": quiet * 1e-5,
        "derivative": [3 * read, 3 * read],
    }
    document: dict[str, Any] = {"kind": kind, "noise": noise} | timing
    if full_scale is not None:
        document["full_scale"] = [full_scale, full_scale]
    return parse_sensor(document)


@dataclasses.dataclass(frozen=True, eq=False)
class SmoothErrors:
    """A Gaussian process along log r for each frame, with Matern 5/2 correlation of length 1.

    A sum of waves whose frequencies are drawn from its spectrum, which is Student's t with five
    degrees of freedom (Rahimi and Recht 2007).

    Attributes
    ----------
    frequency, cosine, sine : ndarray, shape (waves, n)
        Frequencies, and normal amplitudes.
    """

    frequency: Array
    cosine: Array
    sine: Array

    @classmethod
    def drawn(cls, rng: np.random.Generator, sd: float, n: int) -> "SmoothErrors":
        """Draw a process for each of n frames."""
        size = sd / math.sqrt(_WAVES)
        frequency = rng.standard_t(5.0, (_WAVES, n))
        return cls(frequency, *(size * rng.standard_normal((2, _WAVES, n))))

    def __call__(self, r: Any) -> Any:
        turn = self.frequency * np.log(r)
        return np.sum(self.cosine * np.cos(turn) + self.sine * np.sin(turn), axis=0)


Errors = tuple[SmoothErrors, SmoothErrors]


def _signal(sensor: Sensor, setting: Setting, r: Any, errors: Errors | None = None) -> Any:
    """Return the object's readings, shape (2, n); r may be complex."""
    flux = C0 * C2 / (r**2 * (r**2 + C1 * r + C0))
    if setting.discrepancy:
        flux = flux * np.exp(0.1 * np.sin(3.0 * np.log(r) + 1.0))
    if errors is None:
        return flux * _carrier(sensor, r)
    of_flux, of_range = errors
    return flux * np.exp(of_flux(r)) * _carrier(sensor, r + of_range(r))


def _carrier(sensor: Sensor, r: Any) -> Any:
    if isinstance(sensor, PulsedSensor):
        return np.stack([r / sensor.r0, np.ones_like(r)])
    assert isinstance(sensor, SineWaveSensor)
    return np.stack([np.cos(sensor.wave_number * r), np.sin(sensor.wave_number * r)])


def _mean(sensor: Sensor, setting: Setting, r: Any, errors: Errors | None) -> Any:
    """Return mean readings, shape (2, n); r may be complex."""
    mean = _signal(sensor, setting, r, errors)
    if setting.crosstalk:
        mean = mean + np.array(CROSSTALK)[:, None]
    if setting.shadow is not None:
        c0, c1 = setting.shadow["c0"], setting.shadow["c1"]
        visible = (r**2 + c1 * r) / (r**2 + c1 * r + c0)
        mean = mean + STRENGTH * visible * _carrier(sensor, np.full_like(r, DISTANCE))
    return mean


def frames_of(
    sensor: Sensor,
    setting: Setting,
    range_m: Array,
    rng: np.random.Generator,
    *,
    one_error: bool = False,
) -> Frames:
    """Draw frames of an object at given ranges that recedes at `SPEED`.

    Parameters
    ----------
    sensor : Sensor
        Its noise.
    setting : Setting
        What is true.
    range_m : ndarray, shape (n,)
        True ranges [m].
    rng : numpy.random.Generator
        Source of the noise, and of the errors of the model that the setting states.
    one_error : bool
        Whether all frames are of one object and have one error, or each has its own.
    """
    n = range_m.size
    errors = None
    if any(setting.errors):
        of_flux, of_range = (
            SmoothErrors.drawn(rng, sd, 1 if one_error else n) for sd in setting.errors
        )
        errors = (of_flux, of_range)
    mean = _mean(sensor, setting, range_m, errors)
    signal = _signal(sensor, setting, range_m, errors)
    noise = sensor.noise
    read = np.array(noise.read)[:, None]
    shot = noise.shot * np.abs(mean)
    shared = shot.min(axis=0) if sensor.kind == "pulsed" else np.zeros(n)
    readings = mean + read * rng.standard_normal((2, n))
    readings += np.sqrt(shot - shared) * rng.standard_normal((2, n))
    readings += np.sqrt(shared) * rng.standard_normal(n)
    readings += noise.relative * signal * rng.standard_normal(n)
    # exactly: an imaginary step of which the square is nothing
    step = 1e-100
    slope = _mean(sensor, setting, range_m + 1j * step, errors).imag / step
    assert noise.derivative is not None
    rates = SPEED * slope + np.array(noise.derivative)[:, None] * rng.standard_normal((2, n))
    times = (range_m - range_m[0]) / SPEED
    increasing = bool((np.diff(times) > 0).all())
    return Frames(
        readings.T.copy(), time_s=times if increasing else None, derivatives=rates.T.copy()
    )


def span(n: int) -> Array:
    """Return ranges at even distances between 0.3 and 2 m."""
    return np.linspace(0.3, 2.0, n)


def light_of(sensor: Sensor, range_m: float) -> float:
    """Return the object's larger reading at a range."""
    return float(np.abs(_signal(sensor, MENU[0], np.array([range_m]))).max())
