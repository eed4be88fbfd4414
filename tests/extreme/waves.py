"""Numbers of roots of sine waves in ball arithmetic, over 24 decades, and how far roots are off.

The equations are those of docs/model.md, exact, multiplied out so that they have no pole; phases
are formed from the exact frequency, never from a rounded wave number.
"""

import dataclasses
import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from flint import arb, arb_series, ctx

from inference.estimate import all_roots
from simulator.frames import Frames
from simulator.scene import parse_scene
from tests.extreme.balls import BITS, Function, exact, roots_of
from tests.extreme.tally import Tally
from tests.extreme.wave_scenes import LIGHT, Wave, frames_of, waves

__all__ = ["WAVES", "certified_roots", "tally_waves", "wave_error"]

EPSILON = float(np.finfo(float).eps)
# readings and frequencies this close to a fold, relative, may have the count of either side
_EXCUSED = [k * EPSILON for k in (1, 4, 16)]


Series = Any  # a ball, or a power series of balls


class Balls(NamedTuple):
    """A frame: its scene in balls, the readings less the sensor's phase offset."""

    x: arb
    y: arb
    k: arb
    far: arb
    gain: arb  # K, gain c0 c2
    c0: arb
    c1: arb
    strength: arb
    c0s: arb
    c1s: arb

    def sizes(self) -> "Balls":
        """Everything as large as it is: what relative errors are relative to."""
        return Balls(*(abs(part) for part in self))


def _balls(e: Wave, first: float, second: float) -> Balls:
    i, q, offset = exact(first), exact(second), exact(e.offset)
    cosine, sine = offset.cos(), offset.sin()
    return Balls(
        x=i * cosine + q * sine,
        y=q * cosine - i * sine,
        k=4 * arb.pi() * exact(e.frequency_hz) / LIGHT,
        far=exact(e.distance),
        gain=exact(e.gain) * exact(e.c0) * exact(e.c2),
        c0=exact(e.c0),
        c1=exact(e.c1),
        strength=exact(e.strength),
        c0s=exact(e.c0s),
        c1s=exact(e.c1s),
    )


class Equation(NamedTuple):
    """An equation of the range, what relative errors of its terms amount to, the object's light."""

    value: Callable[[Balls, Series], Series]
    size: Callable[[Balls, Series], Series]
    light: Callable[[Balls, Series], Series] | None = None


def _q(b: Balls, r: Series) -> Series:
    return r * (r + b.c1) + b.c0


def _q_shadow(b: Balls, r: Series) -> Series:
    return r * (r + b.c1s) + b.c0s


def _a(b: Balls, r: Series) -> Series:
    return r * (4 * r + 3 * b.c1) + 2 * b.c0


def _turned(b: Balls, r: Series) -> tuple[Series, Series]:
    """rho times cosine and sine of k r - psi."""
    cosine, sine = (b.k * r).cos(), (b.k * r).sin()
    return b.x * cosine + b.y * sine, b.x * sine - b.y * cosine


def _rho(b: Balls) -> Series:
    return (b.x * b.x + b.y * b.y).sqrt()


def _intensity(b: Balls, r: Series) -> Series:
    return _rho(b) * r * r * _q(b, r) - b.gain


def _intensity_size(b: Balls, r: Series) -> Series:
    s = b.sizes()
    return _rho(b) * r * r * _q(s, r) + s.gain


def _differential(b: Balls, r: Series) -> Series:
    cosine, sine = _turned(b, r)
    return _a(b, r) * sine - b.k * r * _q(b, r) * cosine


def _differential_size(b: Balls, r: Series) -> Series:
    s, kr = b.sizes(), b.k * r
    cosine, sine = (abs(part) for part in _turned(b, r))
    value = _a(s, r) * sine + kr * _q(s, r) * cosine
    return value + (1 + kr) * abs(_a(b, r) * cosine + kr * _q(b, r) * sine)


def _cancelling(b: Balls, r: Series) -> Series:
    angle = b.k * b.far
    free = b.y * angle.cos() - b.x * angle.sin()
    return free * r * r * _q(b, r) + b.gain * (b.k * (b.far - r)).sin()


def _cancelling_size(b: Balls, r: Series) -> Series:
    s, angle, left = b.sizes(), b.k * b.far, b.k * (b.far - r)
    free = s.y * abs(angle.cos()) + s.x * abs(angle.sin())
    turned = abs(b.x * angle.cos() + b.y * angle.sin())  # what an error of the phase moves it by
    wave = abs(left.sin()) + abs(left.cos()) * b.k * b.far
    return (free + turned) * r * r * _q(s, r) + s.gain * wave


def _own(b: Balls, r: Series) -> Series:
    _, sine = _turned(b, r)
    return sine * _q_shadow(b, r) + b.strength * r * (r + b.c1s) * (b.k * (b.far - r)).sin()


def _own_size(b: Balls, r: Series) -> Series:
    s, left = b.sizes(), b.k * (b.far - r)
    cosine, sine = (abs(part) for part in _turned(b, r))
    phase = b.k * b.far
    wall = s.strength * r * (r + s.c1s) * (abs(left.sin()) + abs(left.cos()) * phase)
    return _q_shadow(s, r) * (sine + cosine * (1 + b.k * r)) + wall


def _own_light(b: Balls, r: Series) -> Series:
    cosine, _ = _turned(b, r)
    return cosine - b.strength * r * (r + b.c1s) / _q_shadow(b, r) * (b.k * (b.far - r)).cos()


def _both(b: Balls, r: Series) -> Series:
    cosine, sine = _turned(b, r)
    shadow = _q_shadow(b, r)
    _, far = _turned(b, b.far)
    q = _q(b, r)
    wall = b.strength * b.c0s * (2 * r + b.c1s) * r * r * r * q * q * far
    return b.gain * shadow * shadow * (b.k * r * q * cosine - _a(b, r) * sine) + wall


def _both_size(b: Balls, r: Series) -> Series:
    s, kr, angle = b.sizes(), b.k * r, b.k * b.far
    cosine, sine = (abs(part) for part in _turned(b, r))
    c_far, s_far = (abs(part) for part in _turned(b, b.far))
    shadow, q = _q_shadow(s, r), _q(s, r)
    wall = s.strength * s.c0s * (2 * r + s.c1s) * r * r * r * q * q
    own = kr * q * cosine + _a(s, r) * sine + (1 + kr) * (kr * q * sine + _a(s, r) * cosine)
    return s.gain * shadow * shadow * own + wall * (s_far + c_far * (1 + angle))


WAVES: dict[str, Equation] = {
    "intensity": Equation(_intensity, _intensity_size),
    "differential": Equation(_differential, _differential_size),
    "background_cancelling": Equation(_cancelling, _cancelling_size),
    "background_intensity": Equation(_own, _own_size, _own_light),
    "background_cancelling_differential": Equation(_both, _both_size),
}


def certified_roots(e: Wave, first: float, second: float) -> list[arb] | None:
    """Enclose all roots; None where the count is not decided."""
    ctx.prec = BITS
    b, equation = _balls(e, first, second), WAVES[e.technique]
    high = e.high
    if e.technique == "intensity":
        high = 2 * (abs(b.c1) + (4 * b.gain / _rho(b)).root(4))
        high = high.mid()
    g: Function = lambda r: equation.value(b, r)  # noqa: E731
    found = roots_of(g, high)
    if found is None or equation.light is None:
        return found
    # of a background that is seen the rest is the object: neither is negative
    seen = [r for r in found if r + b.c1s > 0]
    lights = [equation.light(b, r) for r in seen]
    drowned = 256 * EPSILON * (_rho(b) + b.strength)  # in the rounding of the readings
    if not all(abs(light) > drowned for light in lights):
        return None
    if any((r + b.c1s).contains(0) for r in found):
        return None
    return [r for r, light in zip(seen, lights, strict=True) if light > 0]


def _count(e: Wave, first: float, second: float) -> int | None:
    found = certified_roots(e, first, second)
    return None if found is None else len(found)


def _excused(e: Wave, first: float, second: float, count: int) -> bool:
    """Say whether readings or a frequency within rounding have the count."""
    for d in _EXCUSED:
        for s1, s2, s3 in itertools.product((-d, 0.0, d), repeat=3):
            moved = dataclasses.replace(e, frequency_hz=e.frequency_hz * (1 + s3))
            exactly = _count(moved, first * (1 + s1), second * (1 + s2))
            if exactly is None or exactly == count:
                return True
    return False


def tally_waves(technique: str, scenes: int, frames: int, rng: np.random.Generator) -> Tally[Wave]:
    """Count every root of many frames twice, and hold each to the equation it solves.

    The error of a root is |g(r)| over |r g'(r)| + what relative errors of g's terms, phases among
    them, amount to, in units of rounding.
    """
    total = Tally[Wave]()
    for e in itertools.islice(waves(technique, rng), scenes):
        readings = frames_of(e, frames, rng)
        if not len(readings):
            continue
        given = Frames(readings)
        if "differential" in technique:
            time_s = np.arange(float(len(readings)))
            given = Frames(np.ones_like(readings), time_s=time_s, derivatives=readings)
        result = all_roots(technique, e.sensor, parse_scene(e.document), given)
        for n, (first, second) in enumerate(readings.tolist()):
            roots = result.roots_m[n, : result.root_count[n]]
            if technique == "background_intensity":
                roots = roots[roots > -e.c1s]
            count = len(roots)
            total.frames += 1
            total.roots += count
            certified = _count(e, first, second)
            if count != certified:
                if certified is None or _excused(e, first, second, count):
                    total.excused += 1
                else:
                    total.wrong.append((e, (first, second), count, certified))
                continue
            for root in roots.tolist():
                error = wave_error(e, first, second, root)
                if error > total.worst:
                    total.worst, total.where = error, (e, (first, second), root)
    return total


def wave_error(e: Wave, first: float, second: float, root: float) -> float:
    """Return how far a root is off, in units of its condition times rounding."""
    ctx.prec = BITS
    b, equation, r = _balls(e, first, second), WAVES[e.technique], exact(root)
    y = equation.value(b, arb_series([r, 1], prec=2))
    size = abs(r * y[1]) + equation.size(b, r)
    return float(abs(y[0]) / size) / EPSILON
