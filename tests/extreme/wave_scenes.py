"""Random scenes of sine waves over 24 decades, and readings that are hard to invert."""

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
from flint import arb
from numpy.typing import NDArray

from simulator.sensor import SineWaveSensor, parse_sensor
from tests.extreme.balls import exact
from tests.extreme.scene_in_numbers import SceneInNumbers

__all__ = ["LIGHT", "Wave", "frames_of", "waves"]

Array = NDArray[np.float64]
LIGHT = 299792458


@dataclasses.dataclass(frozen=True, kw_only=True)
class Wave(SceneInNumbers):
    """A scene of a sine wave, in numbers."""

    frequency_hz: float
    offset: float

    @property
    def sensor(self) -> SineWaveSensor:
        parsed = parse_sensor(
            {
                "kind": "sine_wave",
                "frequency_hz": self.frequency_hz,
                "phase_offset_rad": self.offset,
                "gain": self.gain,
                "noise": {"read": [1e-50, 1e-50], "derivative": [1e-50, 1e-50]},
            }
        )
        assert isinstance(parsed, SineWaveSensor)
        return parsed

    @property
    def high(self) -> arb:
        """Upper end of the technique's interval [m]; of the intensity the half wavelength."""
        half = arb(LIGHT) / (2 * exact(self.frequency_hz))
        if "differential" not in self.technique:
            return exact(self.distance) if self.technique.startswith("background") else half
        near = half / 2
        if self.technique == "differential":
            return near
        return near if near < exact(self.distance) else exact(self.distance)

    def readings(self, r: Array) -> Array:
        """Readings at ranges [m], or their derivatives."""
        k = self.sensor.wave_number
        q = (r + self.c1 / 2) ** 2 + (self.c0 - self.c1**2 / 4)
        light = self.gain * self.c0 * self.c2 / (r * r * q)
        x = light * np.exp(1j * (k * r + self.offset))
        far = np.exp(1j * (k * self.distance + self.offset))
        hidden = r * (r + self.c1s) + self.c0s
        if "differential" in self.technique:
            x = x / r * (-2 - r * (2 * r + self.c1) / q + 1j * k * r)
            if self.technique != "differential":
                x = x + self.strength * self.c0s * (2 * r + self.c1s) / hidden**2 * far
        elif self.technique.startswith("background"):
            x = x + self.strength * r * (r + self.c1s) / hidden * far
        return np.column_stack([x.real, x.imag])


def waves(technique: str, rng: np.random.Generator) -> Iterator[Wave]:
    """Scenes of 1 Hz to 1 THz, lengths over 12 decades about it, shapes to 1e-15 of the pole."""
    while True:
        frequency = 10.0 ** rng.uniform(0, 12)
        half = LIGHT / (2 * frequency)
        reach = half * 10.0 ** rng.uniform(*((-4, 1.3) if rng.random() < 0.98 else (1.3, 2.2)))
        size = reach * 10.0 ** rng.uniform(-4, 4)
        c0 = float(size * size)
        if rng.random() < 0.5:
            c1 = float(-2 * size * (1 - 10.0 ** rng.uniform(-15, -0.3)))
        else:
            c1 = float(size * 10.0 ** rng.uniform(-12, 6) * rng.choice([-1e-6, 1.0]))
        c0s = float(c0 * 10.0 ** rng.uniform(-3, 1))
        c1s = float(size * 10.0 ** rng.uniform(-6, 2))
        if rng.random() < 0.3:
            c1s = float(-2 * math.sqrt(c0s) * (1 - 10.0 ** rng.uniform(-9, -0.1)))
        if not (c1 > -2 * math.sqrt(c0) and c1s > -2 * math.sqrt(c0s)):
            continue
        gain, c2 = 10.0 ** rng.uniform(-12, 12), 10.0 ** rng.uniform(-4, 2)
        # what the object sends from where the background stands, over 8 decades
        light = gain * c0 * c2 / (reach**2 * (reach * (reach + c1) + c0))
        yield Wave(
            technique=technique,
            frequency_hz=float(frequency),
            offset=float(rng.uniform(-math.pi, math.pi)),
            gain=float(gain),
            c0=c0,
            c1=c1,
            c2=float(c2),
            distance=float(reach),
            strength=float(light * 10.0 ** rng.uniform(-4, 4)),
            c0s=c0s,
            c1s=c1s,
        )


def frames_of(e: Wave, n: int, rng: np.random.Generator) -> Array:
    """Readings at random ranges, near the shape's pole, hard by folds, and without sense."""
    high = float(e.high)
    size = math.sqrt(e.c0)
    r = np.concatenate(
        [
            high * (1 - 10.0 ** rng.uniform(-9, -0.01, n // 4)),
            high * 10.0 ** rng.uniform(-4, 0, n // 4),
            np.clip(size * 10.0 ** rng.uniform(-3, 1, n // 4), 0, high * 0.999),
        ]
    )
    found = e.readings(r)
    any_phase = np.exp(1j * rng.uniform(-math.pi, math.pi, n // 4))
    heights = np.hypot(*e.readings(high * rng.uniform(0.1, 1, n // 4)).T) * any_phase
    found = np.concatenate([found, np.column_stack([heights.real, heights.imag])])
    found = np.concatenate([found, found[rng.integers(0, len(found), n // 4)] * 1e-8])
    found = np.concatenate([found, _by_folds(e, high, rng)])
    sizes = np.abs(found)
    good = np.isfinite(found).all(axis=1) & (sizes.max(axis=1) < 1e200)
    return np.asarray(found[good & (sizes.min(axis=1) > 1e-200)])


def _by_folds(e: Wave, high: float, rng: np.random.Generator) -> Array:
    """Readings beside two turning points of what the technique inverts, to 1e-12."""
    size = math.sqrt(e.c0)
    grid = np.unique(
        np.concatenate([size * np.geomspace(1e-2, 1e2, 1500), high * np.linspace(0, 1, 1500)])
    )
    grid = grid[(grid > 0) & (grid < high)]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(_one_number(e, grid))))) + 1
    found = []
    for turn in rng.permutation(turns)[:2]:
        low, up = grid[turn - 1], grid[turn + 1]
        for _ in range(3):  # to 1e-8 of the range, where the number is right to rounding
            near = np.linspace(low, up, 400)
            values = _one_number(e, near)
            best = int(np.argmax(np.abs(values - 0.5 * (values[0] + values[-1]))))
            low, up = near[max(best - 1, 0)], near[min(best + 1, 399)]
        x = e.readings(near[best : best + 1]) @ np.array([1, 1j])
        off = rng.choice([-1.0, 1.0], 4) * 10.0 ** rng.uniform(-12, -3, 4)
        found.append(x * (np.exp(1j * off) if "differential" in e.technique else 1 + off))
    x = np.concatenate(found) if found else np.empty(0, complex)
    return np.column_stack([x.real, x.imag])


def _one_number(e: Wave, r: Array) -> Array:
    """What a technique makes of a frame, for readings at ranges."""
    x: NDArray[np.complex128] = e.readings(r) @ np.array([1, 1j])
    with np.errstate(all="ignore"):
        if "differential" in e.technique:
            return np.asarray(np.unwrap(np.angle(x), period=math.pi))
        if e.technique == "background_cancelling":
            far = e.sensor.wave_number * e.distance + e.offset
            return np.asarray((x * np.exp(-1j * far)).imag)
        if e.technique == "background_intensity":
            return np.asarray(np.unwrap(np.angle(x)))
        return np.asarray(np.abs(x))
