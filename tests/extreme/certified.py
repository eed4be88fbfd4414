"""Numbers of roots in exact arithmetic, over 24 decades of everything, and how far answers are off.

A pulse's equation is a polynomial in the range whose coefficients are exact: readings and scene are
binary numbers, of which sums and products are formed as fractions. A Sturm chain then counts its
roots in an interval without any rounding (docs/model.md, single-frames has the equations).
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from inference.estimate import all_roots
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, parse_sensor
from tests.extreme.scene_in_numbers import SceneInNumbers
from tests.extreme.sturm import roots_between, value
from tests.extreme.tally import Tally

__all__ = ["FAMILIES", "Extreme", "extremes", "root_error", "tally"]

Array = NDArray[np.float64]
EPSILON = float(np.finfo(float).eps)
# readings this close to a fold, relative, may have the count of either side: their product with
# the scene's numbers is rounded, as every reading is
_EXCUSED = [k * EPSILON for k in (1, 2, 4, 8, 16)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Extreme(SceneInNumbers):
    """A scene of a pulse, in numbers."""

    pulse_width_s: float

    @property
    def sensor(self) -> PulsedSensor:
        parsed = parse_sensor(
            {
                "kind": "pulsed",
                "pulse_width_s": self.pulse_width_s,
                "gain": self.gain,
                "noise": {"read": [1e-50, 1e-50], "derivative": [1e-50, 1e-50]},
            }
        )
        assert isinstance(parsed, PulsedSensor)
        return parsed

    def readings(self, r: Array) -> Array:
        """Readings of the object, and of a wall, at ranges of any size [m]."""
        r0 = self.sensor.r0
        q = (r + self.c1 / 2) ** 2 + (self.c0 - self.c1**2 / 4)
        light = self.gain * self.c0 * self.c2 / (r * r * q)
        w1, w2 = light * r / r0, light
        if "differential" in self.technique:
            slope = -light / r * (2 + r * (2 * r + self.c1) / q)
            w1, w2 = (slope * r + light) / r0, slope
            if self.technique != "differential":
                hidden = r * (r + self.c1s) + self.c0s
                wall = self.strength * self.c0s * (2 * r + self.c1s) / hidden**2
                w1, w2 = w1 + wall * self.distance / r0, w2 + wall
        elif self.technique.startswith("background"):
            wall = self.strength * r * (r + self.c1s) / (r * (r + self.c1s) + self.c0s)
            w1, w2 = w1 + wall * self.distance / r0, w2 + wall
        return np.column_stack([w1, w2])


Polynomial = Callable[[Extreme, Fraction, Fraction], list[Fraction]]


def _f(*values: float) -> list[Fraction]:
    return [Fraction(v) for v in values]


def _intensity(e: Extreme, _: Fraction, w2: Fraction) -> list[Fraction]:
    c0, c1, c2, gain = _f(e.c0, e.c1, e.c2, e.gain)
    return [w2, w2 * c1, w2 * c0, Fraction(0), -gain * c2 * c0]


def _late(e: Extreme, w1: Fraction, _: Fraction) -> list[Fraction]:
    c0, c1, c2, gain, r0 = _f(e.c0, e.c1, e.c2, e.gain, e.sensor.r0)
    return [r0 * w1, r0 * w1 * c1, r0 * w1 * c0, -gain * c2 * c0]


def _cancelling(e: Extreme, w1: Fraction, w2: Fraction) -> list[Fraction]:
    c0, c1, c2, gain, r0, far = _f(e.c0, e.c1, e.c2, e.gain, e.sensor.r0, e.distance)
    free, k = far * w2 - r0 * w1, gain * c2 * c0
    return [free, free * c1, free * c0, k, -k * far]


def _differential(e: Extreme, w1: Fraction, w2: Fraction) -> list[Fraction]:
    c0, c1, r0 = _f(e.c0, e.c1, e.sensor.r0)
    w = r0 * w1
    return [3 * w2, 2 * c1 * w2 - 4 * w, c0 * w2 - 3 * c1 * w, -2 * c0 * w]


def _wall(e: Extreme, w1: Fraction, w2: Fraction) -> list[Fraction]:
    b, c0s, c1s, r0, far = _f(e.strength, e.c0s, e.c1s, e.sensor.r0, e.distance)
    w = r0 * w1 - b * far
    return [w2 - b, (w2 - b) * c1s - w, w2 * c0s - c1s * w, -(w + b * far) * c0s]


def _times(*factors: Sequence[Fraction]) -> list[Fraction]:
    product = [Fraction(1)]
    for q in factors:
        out = [Fraction(0)] * (len(product) + len(q) - 1)
        for (i, a), (j, b) in itertools.product(enumerate(product), enumerate(q)):
            out[i + j] += a * b
        product = out
    return product


def _both(e: Extreme, w1: Fraction, w2: Fraction) -> list[Fraction]:
    """4.83 times w2: of degree 8, and right also where w2 is zero."""
    return _light_and_wall(e, w1, w2, -1)


def _light_and_wall(e: Extreme, w1: Fraction, w2: Fraction, sign: int) -> list[Fraction]:
    """The polynomial, or with a sign of 1 and positive numbers the sizes of its terms."""
    one, zero = Fraction(1), Fraction(0)
    numbers = (e.c0, e.c1, e.gain, e.c2, e.strength, e.c0s, e.c1s, e.distance, e.sensor.r0)
    c0, c1, gain, c2, b, c0s, c1s, far, r0 = _f(*numbers)
    if sign > 0:
        c1, c1s, w1, w2 = abs(c1), abs(c1s), abs(w1), abs(w2)
    w = r0 * w1
    q, shadow = [one, c1, c0], [one, c1s, c0s]
    n = [sign * 3 * w2, 4 * w + sign * 2 * c1 * w2, 3 * c1 * w + sign * c0 * w2, 2 * c0 * w]
    own = _times([gain * c2 * c0], n, shadow, shadow)
    wall = _times([(far * w2 + sign * w) * b * c0s], [2 * one, c1s, zero, zero, zero], q, q)
    length = max(len(own), len(wall))
    own, wall = ([zero] * (length - len(p)) + p for p in (own, wall))
    return [x + y for x, y in zip(own, wall, strict=True)]


FAMILIES: dict[str, Polynomial] = {
    "intensity": _intensity,
    "intensity_w1": _late,
    "differential": _differential,
    "background_cancelling": _cancelling,
    "background_intensity": _wall,
    "background_cancelling_differential": _both,
}


def _sizes(e: Extreme, p: Sequence[Fraction], w1: float, w2: float) -> list[Fraction]:
    """Sizes of what the coefficients are made of, where they are differences of it."""
    if e.technique == "background_cancelling_differential":
        return _light_and_wall(e, Fraction(w1), Fraction(w2), 1)
    if e.technique != "background_intensity":
        return [abs(c) for c in p]
    b, c0s, c1s, r0, far = _f(e.strength, e.c0s, abs(e.c1s), e.sensor.r0, e.distance)
    light, late = abs(Fraction(w2)) + b, r0 * abs(Fraction(w1))
    return [light, light * c1s + late + b * far, light * c0s + c1s * (late + b * far), late * c0s]


def extremes(technique: str, rng: np.random.Generator) -> Iterator[Extreme]:
    """Scenes over 24 decades of lengths and amounts of light, shapes to 1e-15 of their pole."""
    while True:
        size = 10.0 ** rng.uniform(-6, 6)
        c0 = float(size * size)
        if rng.random() < 0.5:  # near the pole, where the light has a sharp second maximum
            c1 = float(-2 * size * (1 - 10.0 ** rng.uniform(-15, -0.3)))
        else:
            c1 = float(size * 10.0 ** rng.uniform(-12, 6) * rng.choice([-1e-6, 1.0]))
        if not c1 > -2 * math.sqrt(c0):
            continue
        reach = size * 10.0 ** rng.uniform(-2, 4)
        yield Extreme(
            technique=technique,
            pulse_width_s=float(2 * reach / 299792458.0),
            gain=float(10.0 ** rng.uniform(-12, 12)),
            c0=c0,
            c1=c1,
            c2=float(10.0 ** rng.uniform(-4, 2)),
            distance=float(reach * rng.uniform(0.05, 1.0)),
            strength=float(10.0 ** rng.uniform(-12, 12)),
            c0s=float(c0 * 10.0 ** rng.uniform(-3, 1)),
            c1s=float(size * 10.0 ** rng.uniform(-6, 2)),
        )


def _frames(e: Extreme, n: int, rng: np.random.Generator) -> Array:
    """Readings at random ranges, hard by the folds of the curve, and without sense."""
    size = math.sqrt(e.c0)
    high = e.distance if e.technique.startswith("background") else 1e4 * size
    r = np.concatenate(
        [
            high * (1 - 10.0 ** rng.uniform(-9, -0.01, n // 4)),
            np.minimum(size * 10.0 ** rng.uniform(-6, 4, n - n // 4), high),
        ]
    )
    found = e.readings(r)
    dense = size * np.geomspace(1e-3, 1e3, 4001)
    curve = e.readings(dense[dense < high])
    column = 0 if e.technique == "intensity_w1" else 1
    if e.technique == "background_cancelling" and curve.size:
        curve[:, 1] -= curve[:, 0] * e.sensor.r0 / e.distance
        curve[:, 0] = 0.0
    if len(curve) > 2:
        turns = np.flatnonzero(np.diff(np.sign(np.diff(curve[:, column])))) + 1
        for turn in turns[:4]:
            near = 1 + rng.choice([-1.0, 1.0], 6) * 10.0 ** rng.uniform(-12, -3, 6)
            found = np.concatenate([found, curve[turn] * near[:, None]])
    found *= 10.0 ** rng.choice([0.0, 0.0, 0.0, -8.0, 8.0], len(found))[:, None]
    return found[np.isfinite(found).all(axis=1) & (np.abs(found) < 1e200).all(axis=1)]


def _exact_count(e: Extreme, w1: float, w2: float, high: Fraction | None) -> int:
    p = FAMILIES[e.technique](e, Fraction(w1), Fraction(w2))
    # an object stands before its background
    at_end = e.technique.startswith("background") and high is not None and value(p, high) == 0
    return roots_between(p, high) - at_end if any(p) else 0


def tally(technique: str, scenes: int, frames: int, rng: np.random.Generator) -> Tally[Extreme]:
    """Count every root of many frames twice, and hold each to the equation it solves.

    The condition of a root r is 1 + |sum of the terms' sizes / (r p'(r))|: what a relative error of
    the terms moves it by. Its error is |p(r) / (r p'(r))|, to first order, in exact arithmetic.
    """
    total = Tally[Extreme]()
    for e in itertools.islice(extremes(technique, rng), scenes):
        sensor = e.sensor
        readings = _frames(e, frames, rng)
        if not len(readings):
            continue
        derivatives = readings if "differential" in technique else None
        given = Frames(
            np.ones_like(readings) if derivatives is not None else readings,
            time_s=np.arange(float(len(readings))),
            derivatives=derivatives,
        )
        result = all_roots(technique, sensor, parse_scene(e.document), given)
        high = _end(e)
        for n, (w1, w2) in enumerate(readings.tolist()):
            count = int(result.root_count[n])
            exact = _exact_count(e, w1, w2, high)
            total.frames += 1
            total.roots += count
            if count != exact:
                shifts = [
                    shift for d in _EXCUSED for shift in itertools.product((-d, 0.0, d), repeat=2)
                ]
                around = {_exact_count(e, w1 * (1 + a), w2 * (1 + b), high) for a, b in shifts}
                if count in around:
                    total.excused += 1
                else:
                    total.wrong.append((e, (w1, w2), count, exact))
                continue
            for root in result.roots_m[n, :count].tolist():
                error = root_error(e, w1, w2, root)
                if error > total.worst:
                    total.worst, total.where = error, (e, (w1, w2), root)
    return total


def _end(e: Extreme) -> Fraction | None:
    if e.technique == "intensity":
        return None
    if e.technique.startswith("background"):
        return Fraction(e.distance)
    return Fraction(e.sensor.r0)


def root_error(e: Extreme, w1: float, w2: float, root: float) -> float:
    """Return how far a root is off, in units of its condition times rounding."""
    p, r = FAMILIES[e.technique](e, Fraction(w1), Fraction(w2)), Fraction(root)
    sizes = _sizes(e, p, w1, w2)
    n = len(p) - 1
    slope = r * value([c * (n - k) for k, c in enumerate(p[:-1])], r)
    size = value(sizes, r)
    if slope == 0:
        return 0.0  # a double root, of infinite condition
    return float(abs(value(p, r)) / (abs(slope) + size) / Fraction(EPSILON))
