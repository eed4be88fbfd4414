"""Derivatives over 24 decades, held to power series of balls: nothing is differenced.

Mean readings along every value that may be unknown (`inference.frame.sensitivity`), and the log
density of a frame along its range (`inference.frame.log_density`). An error is counted in units of
what relative roundings of all that goes in would move the derivative by.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from flint import arb, arb_series, ctx

from inference.frame.arguments import Background, FrameScene, Instrument, RangePrior, Shape
from inference.frame.blocks import Block, Frame
from inference.frame.log_density import slope_and_curvature
from inference.frame.sensitivity import sensitivity
from simulator.parameters import Terms
from simulator.sensor import PulsedSensor, Sensor, parse_sensor
from tests.extreme.balls import exact

__all__ = ["Slopes", "density_errors", "light_errors", "slopes_of", "worst_slopes"]

_BITS = 512
_MOVED = 2.0**-200
_EPSILON = float(np.finfo(float).eps)
Series = Any  # a ball, or a power series of balls
Numbers = dict[str, Series]
Pair = tuple[Series, Series]
VALUES = ("c0", "c1", "c2", "x1", "x2", "strength", "distance", "s0", "s1")


@dataclasses.dataclass(frozen=True)
class Slopes:
    """A frame in numbers: what light and density are differentiated at.

    Attributes
    ----------
    sensor : Sensor
        With numbers alone.
    values : tuple of float
        In the order of `inference.frame.sensitivity.Value`, up to the shadow's c1.
    log_r : float
        [log m].
    residual : (float, float)
        Reading less mean, in standard deviations of its read noise.
    law : (float, float)
        Centre and standard deviation of a normal law of log r.
    """

    sensor: Sensor
    values: tuple[float, ...]
    log_r: float
    residual: tuple[float, float]
    law: tuple[float, float]

    @property
    def numbers(self) -> Numbers:
        """All that goes in, exact."""
        of = dict(zip(VALUES, map(exact, self.values), strict=True))
        of |= {"u": exact(self.log_r), "gain": exact(self.sensor.known_gain)}
        if isinstance(self.sensor, PulsedSensor):
            return of | {"r0": exact(self.sensor.r0)}
        phase = exact(self.sensor.known_phase_rad)
        return of | {"wave": exact(self.sensor.wave_number), "phase": phase}


def slopes_of(rng: np.random.Generator) -> Iterator[Slopes]:
    """Draw frames: 1 ps to 1 s, 1 Hz to 1 THz, shapes to 1e-15 of the pole, noise to 1e-12."""
    while True:
        read = 10.0 ** rng.uniform(-12, 12, 2)
        noise = {"read": read.tolist()}
        gain = 10.0 ** rng.uniform(-6, 6)
        if rng.random() < 0.5:
            width = 10.0 ** rng.uniform(-12, 0)
            about: dict[str, Any] = {"kind": "pulsed", "pulse_width_s": width}
            reach = 299792458 * width / 2
        else:
            frequency = 10.0 ** rng.uniform(0, 12)
            about = {"kind": "sine_wave", "frequency_hz": frequency}
            about["phase_offset_rad"] = rng.uniform(-3, 3)
            reach = 299792458 / frequency / 2 * 10.0 ** rng.uniform(0, 2)
        r = reach * 10.0 ** rng.uniform(-4, 0)
        size, hidden = r * 10.0 ** rng.uniform(-4, 4, 2)
        c0, s0 = float(size * size), float(hidden * hidden)
        c1, s1 = size * _shape(rng), hidden * _shape(rng)
        if c1 < 0 and rng.random() < 0.3:  # beside the sharp top of the light
            r = -c1 / 2 * (1 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, 0))
        # the light is so many times the read noise
        flux = read[0] * 10.0 ** rng.uniform(-2, 12)
        if rng.random() < 0.4:
            noise["shot"] = read[0] * min(read[0] / flux, 1.0) * 10.0 ** rng.uniform(-2, 6)
        if rng.random() < 0.4:
            noise["relative"] = 10.0 ** rng.uniform(-9, 1)
        q = (r + c1 / 2) ** 2 + (c0 - c1 * c1 / 4)
        c2 = flux * r * r * (max(q, 1e-15 * c0) / c0) / gain
        around = flux * 10.0 ** rng.uniform(-6, 6, 3)
        values = (c0, c1, c2, around[0] * rng.choice([-1, 1]), around[1], around[2])
        far = reach * 10.0 ** rng.uniform(-3, 0)
        residual = rng.normal(size=2) * 10.0 ** rng.uniform(-1, 6)
        sensor = parse_sensor({**about, "gain": gain, "noise": noise})
        yield Slopes(
            sensor,
            tuple(map(float, (*values, far, s0, s1))),
            math.log(r),
            (float(residual[0]), float(residual[1])),
            (math.log(r) + rng.normal(), 10.0 ** rng.uniform(-6, 1)),
        )


def _shape(rng: np.random.Generator) -> float:
    """Return c1 in units of the size: to 1e-15 of the pole, about one, or large."""
    which = rng.random()
    if which < 0.4:
        return float(-2 * (1 - 10.0 ** rng.uniform(-15, 0)))
    return float(rng.uniform(-1.9, 2) if which < 0.8 else 10.0 ** rng.uniform(0, 6))


def light(of: Numbers) -> tuple[Pair, Pair]:
    """Return the object's part of the mean readings, and all of them."""
    r = of["u"].exp()
    flux = of["gain"] * of["c0"] * of["c2"] / (r * r * (r * (r + of["c1"]) + of["c0"]))
    visible = r * (r + of["s1"])
    visible = of["strength"] * visible / (visible + of["s0"])
    near, far = _shares(of, r), _shares(of, of["distance"])
    signal = flux * near[0], flux * near[1]
    mean = tuple(
        s + visible * f + x for s, f, x in zip(signal, far, (of["x1"], of["x2"]), strict=True)
    )
    return signal, (mean[0], mean[1])


def _shares(of: Numbers, distance: Series) -> Pair:
    if "wave" in of:
        phase = of["wave"] * distance + of["phase"]
        return phase.cos(), phase.sin()
    late = distance / of["r0"]
    return (late if _number(late) < 1 else late * 0 + 1), arb(1)


def _number(x: Series) -> arb:
    return x[0] if isinstance(x, arb_series) else x


def log_density(of: Numbers) -> Series:
    """Return the log density of a frame and its range, but for what depends on neither."""
    signal, mean = light(of)
    e1, e2 = of["y1"] - mean[0], of["y2"] - mean[1]
    n1, n2 = (of["shot"] * (m if _number(m) > 0 else -m) for m in mean)
    k = (n1 if _number(n1) < _number(n2) else n2) if "r0" in of else arb(0)
    a1, a2 = of["read1"] ** 2 + n1 - k, of["read2"] ** 2 + n2 - k
    d1, d2 = of["relative"] * signal[0], of["relative"] * signal[1]
    area = a1 * a2 + k * (a1 + a2) + a2 * d1 * d1 + a1 * d2 * d2 + k * (d1 - d2) * (d1 - d2)
    across = d2 * e1 - d1 * e2
    square = a2 * e1 * e1 + a1 * e2 * e2 + k * (e1 - e2) * (e1 - e2) + across * across
    law = (of["u"] - of["centre"]) / of["spread"]
    return -(square / area + area.log() + law * law) / 2


def _slope(function: Callable[[Numbers], Series], of: Numbers, along: str) -> arb:
    value = function({**of, along: arb_series([of[along], 1], prec=2)})
    return value[1] if isinstance(value, arb_series) else arb(0)


def _units(function: Callable[[Numbers], Series], of: Numbers, along: str, found: float) -> float:
    """Return the error of a slope in units of its condition times rounding.

    An overflow of what is to be represented is no error; what underflows has lost its digits.
    """
    right = _slope(function, of, along)
    condition = abs(right)
    for name, x in of.items():
        size = abs(x)
        if name == "u" and size < 1:
            size = arb(1)  # what rounding of log r leaves of r
        moved = _slope(function, {**of, name: x + size * exact(_MOVED)}, along)
        condition += abs(moved - right) / exact(_MOVED)
    if not math.isfinite(found):
        return 0.0 if abs(float(right.mid())) > 1e300 else math.inf
    least = exact(1e-290) / exact(_EPSILON)
    off = abs(exact(found) - right)
    return float((off / ((condition + least) * exact(_EPSILON))).mid())


def light_errors(case: Slopes) -> dict[str, float]:
    """Return the error of every derivative of the mean readings, by reading and value."""
    ctx.prec = _BITS
    of, v = case.numbers, np.array(case.values)
    terms = Terms(v[None, :3], v[None, 3:5], v[None, 5:], np.zeros((1, 8)))
    found = sensitivity(case.sensor, terms, np.array([case.log_r]))
    c0, s0 = math.sqrt(case.values[0]), math.sqrt(case.values[7])
    scales = [v[0], c0, v[2], 1.0, 1.0, v[5], v[6], v[7], s0]
    errors = {}
    for j in range(2):

        def reading(numbers: Numbers, j: int = j) -> Series:
            return light(numbers)[1][j]

        for name, scale, by in zip(VALUES, scales, found.by_term[0, j], strict=True):
            errors[f"{name}, reading {j + 1}"] = _units(reading, of, name, by / scale)
        errors[f"log r, reading {j + 1}"] = _units(reading, of, "u", found.by_range[0, j])
    return errors


def density_errors(case: Slopes) -> dict[str, float]:
    """Return the error of the slope of a log density along log r."""
    ctx.prec = _BITS
    noise, of = case.sensor.noise, case.numbers
    mean = light(of)[1]
    reading = [
        float(m.mid()) + e * s for m, e, s in zip(mean, case.residual, noise.read, strict=True)
    ]
    strength = case.sensor.known_gain * case.values[0] * case.values[2]
    pulsed = isinstance(case.sensor, PulsedSensor)
    r0 = case.sensor.r0 if isinstance(case.sensor, PulsedSensor) else 0.0
    wave = None
    if not isinstance(case.sensor, PulsedSensor):
        wave = (case.sensor.wave_number, case.sensor.known_phase_rad)
    instrument = Instrument(r0, wave, noise.read, noise.shot or None, noise.relative or None)
    centre, spread = case.law
    prior = RangePrior(0.0, -1.0, 0.0, 0.0, centre, 1 / spread, 0.0, math.inf, False)
    scene = FrameScene(
        Shape(strength, case.values[0], case.values[1]),
        (case.values[3], case.values[4]),
        Background(*case.values[5:]),
        prior,
        instrument,
        None,
    )
    rise, bend = slope_and_curvature(
        case.log_r, Block(Frame(reading[0], reading[1], 1.0, None), None), scene
    )
    assert bend >= 0 or math.isnan(bend)
    of |= {"y1": exact(reading[0]), "y2": exact(reading[1])}
    of |= {"read1": exact(noise.read[0]), "read2": exact(noise.read[1])}
    of |= {"shot": exact(noise.shot), "relative": exact(noise.relative)}
    of |= {"centre": exact(centre), "spread": 1 / exact(1 / spread)}
    kind = ("pulse" if pulsed else "sine wave") + (", shot" if noise.shot else "")
    kind += ", relative" if noise.relative else ""
    return {f"density, {kind}": _units(log_density, of, "u", rise)}


def worst_slopes(frames: int, rng: np.random.Generator) -> dict[str, tuple[float, Slopes]]:
    """Return the worst error of every derivative, and where it is."""
    worst: dict[str, tuple[float, Slopes]] = {}
    for case in itertools.islice(slopes_of(rng), frames):
        for name, error in (light_errors(case) | density_errors(case)).items():
            if not error <= worst.get(name, (-1.0,))[0]:
                worst[name] = error, case
    return worst
