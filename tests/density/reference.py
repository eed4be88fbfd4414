"""A slow, obvious frame integral: a dense grid, every peak refined, graded quadrature around it."""

import dataclasses
import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import PulsedSensor, Sensor, parse_sensor

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Case:
    """One frame, and the values of all parameters of a scene in which nothing is unknown."""

    sensor: Sensor
    scene: Scene
    c: tuple[float, float, float]
    crosstalk: tuple[float, float] | None
    background: tuple[float, float, float, float] | None
    low: float
    high: float
    reading: tuple[float, float]

    @property
    def frames(self) -> Frames:
        return Frames(np.array([self.reading]))


def mean_readings(case: Case, u: Array) -> tuple[Array, Array, Array, Array]:
    """Mean readings of scene and object, written anew from docs/model.md."""
    r = np.exp(u)
    c0, c1, c2 = case.c
    flux = case.sensor.known_gain * c0 * c2 / (r**2 * ((r + c1 / 2) ** 2 + (c0 - c1**2 / 4)))
    if isinstance(case.sensor, PulsedSensor):
        o1, o2 = flux * r / case.sensor.r0, flux
    else:
        phase = case.sensor.wave_number * r + case.sensor.known_phase_rad
        o1, o2 = flux * np.cos(phase), flux * np.sin(phase)
    m1, m2 = o1.copy(), o2.copy()
    if case.background is not None:
        strength, distance, s0, s1 = case.background
        visible = strength * (1 - s0 / (r**2 + s1 * r + s0))
        if isinstance(case.sensor, PulsedSensor):
            m1 += visible * distance / case.sensor.r0
            m2 += visible
        else:
            angle = case.sensor.wave_number * distance + case.sensor.known_phase_rad
            m1 += visible * math.cos(angle)
            m2 += visible * math.sin(angle)
    if case.crosstalk is not None:
        m1 += case.crosstalk[0]
        m2 += case.crosstalk[1]
    return m1, m2, o1, o2


def log_density(case: Case, u: Array) -> Array:
    """Log density of (readings, u), the range's prior loguniform on [low, high]."""
    m1, m2, o1, o2 = mean_readings(case, u)
    noise = case.sensor.noise
    pulsed = isinstance(case.sensor, PulsedSensor)
    # determinant and chi-square as sums of squares; `test_gaussian` holds the identity to mpmath
    e1, e2 = case.reading[0] - m1, case.reading[1] - m2
    n1, n2 = noise.shot * np.abs(m1), noise.shot * np.abs(m2)
    k = np.minimum(n1, n2) if pulsed else np.zeros_like(m1)
    a1, a2 = noise.read[0] ** 2 + n1 - k, noise.read[1] ** 2 + n2 - k
    s1, s2 = noise.relative * o1, noise.relative * o2
    determinant = a1 * a2 + k * (a1 + a2) + a2 * s1**2 + a1 * s2**2 + k * (s1 - s2) ** 2
    square = a2 * e1**2 + a1 * e2**2 + k * (e1 - e2) ** 2 + (s2 * e1 - s1 * e2) ** 2
    density = -square / determinant / 2 - np.log(determinant) / 2
    constant = math.log(2 * math.pi) + math.log(math.log(case.high / case.low))
    return np.asarray(density - constant, dtype=float)


def tops_of(case: Case, points: int = 20001) -> list[tuple[float, float]]:
    """Where the log density over u = log r has a top, ends included, and what it is there."""
    low, high = math.log(case.low), math.log(case.high)
    grid = np.linspace(low, high, points)
    values = log_density(case, grid)
    # tops lower than this are rounding, or so broad that the panels need not be graded for them
    drop = 1e-9
    inner = (
        np.flatnonzero((values[1:-1] > values[:-2] + drop) & (values[1:-1] >= values[2:] + drop))
        + 1
    )
    ends = [k for k, other in ((0, 1), (points - 1, points - 2)) if values[k] > values[other]]
    tops = []
    for k in sorted({*inner.tolist(), *ends, int(values.argmax())}):
        a, b = grid[max(k - 1, 0)], grid[min(k + 1, points - 1)]
        found: Any = optimize.minimize_scalar(
            lambda x: -float(log_density(case, np.array([x]))[0]),
            bounds=(a, b),
            method="bounded",
            options={"xatol": 1e-15},
        )
        better = -found.fun > values[k]
        u, value = (found.x, -found.fun) if better else (grid[k], values[k])
        # Brent's method knows u to the root of a rounding: once more, from that end on
        near = (max(a - u, -1e-7), min(b - u, 1e-7))
        finer: Any = optimize.minimize_scalar(
            lambda t, u=u: -float(log_density(case, np.array([u + t]))[0]),
            bounds=near,
            method="bounded",
            options={"xatol": 1e-17},
        )
        tops.append((u + finer.x, -finer.fun) if -finer.fun > value else (u, value))
    return tops


def reference(case: Case, points: int = 20001) -> float:
    """Log of the frame's integral over u = log r."""
    low, high = math.log(case.low), math.log(case.high)
    tops = tops_of(case, points)
    best = max(value for _, value in tops)
    high_tops = [u for u, value in tops if value > best - 60]
    # valleys need not be exact: they only divide the interval
    cuts = [low, *[0.5 * (a + b) for a, b in itertools.pairwise(high_tops)], high]
    pieces = []
    for u, a, b in zip(high_tops, cuts[:-1], cuts[1:], strict=True):
        for end in (a, b):
            if end == u:
                continue
            # graded geometrically away from the top: 16 nodes in each of many panels
            reach = abs(end - u)
            first = min(1e-13, 1e-3 * reach)  # a top may lie a rounding off an end
            edges = np.concatenate([[0.0], np.geomspace(first, reach, 700)])
            nodes, weights = np.polynomial.legendre.leggauss(16)
            width = np.diff(edges)[:, None]
            x = u + math.copysign(1.0, end - u) * (edges[:-1, None] + width * 0.5 * (1 + nodes))
            terms = log_density(case, x.ravel()) + np.log((0.5 * width * weights).ravel())
            pieces.append(special.logsumexp(terms))
    return float(special.logsumexp(pieces))


class Terms(NamedTuple):
    """Which terms a case has; each combination is machine code of its own."""

    pulsed: bool
    crosstalk: bool
    background: bool
    shot: bool
    relative: bool


# Compiling the kernels for all 32 takes minutes. In these every pair of terms occurs together, and
# every term alone.
FEW_TERMS = (
    *(
        Terms(*pattern)
        for pattern in itertools.product(
            (True, False), (True, False), (True, False), (False,), (False,)
        )
    ),
    *(
        Terms(pulsed, *rest)
        for pulsed in (True, False)
        for rest in (
            (False, False, True, False),
            (False, False, False, True),
            (True, True, True, True),
        )
    ),
)


def random_case(rng: np.random.Generator, among: Sequence[Terms] | None = None) -> Case:
    """A random frame, ordinary or extreme, with any terms or with some of those given."""
    has = None if among is None else among[int(rng.integers(len(among)))]
    c0 = 10 ** rng.uniform(-4, 3)
    c1 = math.sqrt(c0) * (rng.uniform(-1.99, 2) if rng.random() < 0.7 else 10 ** rng.uniform(-1, 2))
    c2 = 10 ** rng.uniform(-4, 0)
    shot = rng.random() < 0.3 if has is None else has.shot
    relative = rng.random() < 0.3 if has is None else has.relative
    if rng.random() < 0.5 if has is None else has.pulsed:
        sensor_data: dict[str, Any] = {
            "kind": "pulsed",
            "pulse_width_s": 10 ** rng.uniform(-8, -6.5),
        }
    else:
        sensor_data = {
            "kind": "sine_wave",
            "frequency_hz": 10 ** rng.uniform(6, 8),
            "phase_offset_rad": rng.uniform(-3, 3),
        }
    probe = parse_sensor({**sensor_data, "noise": {"read": [1.0, 1.0]}})
    high = min(20.0, probe.max_range_m if isinstance(probe, PulsedSensor) else 20.0)
    low = min(0.02, high / 100)
    r = math.exp(rng.uniform(math.log(low), math.log(high)))
    flux = c0 * c2 / (r**2 * ((r + c1 / 2) ** 2 + c0 - c1**2 / 4))
    sigma = flux * 10 ** rng.uniform(-6, 0.5)
    crosstalk = background = None
    if rng.random() < 0.4 if has is None else has.crosstalk:
        crosstalk = (flux * rng.normal(), flux * rng.normal())
    if rng.random() < 0.4 if has is None else has.background:
        background = (
            flux * 10 ** rng.uniform(-2, 2),
            rng.uniform(0.3, 1.0) * high,
            c0 * 10 ** rng.uniform(-0.5, 0.5),
            math.sqrt(c0) * rng.uniform(0, 1),
        )
    sensor = parse_sensor(
        {
            **sensor_data,
            "noise": {
                "read": [sigma * 10 ** rng.uniform(-1, 0.5), sigma],
                "shot": float(sigma**2 / flux * 10 ** rng.uniform(-2, 1)) if shot else 0.0,
                "relative": float(10 ** rng.uniform(-4, -1)) if relative else 0.0,
            },
        }
    )
    scene: dict[str, Any] = {"object": {"c0": c0, "c1": c1, "c2": c2}}
    if crosstalk:
        scene["crosstalk"] = list(crosstalk)
    if background:
        strength, distance, s0, s1 = background
        scene["background"] = {
            "strength": strength,
            "distance_m": distance,
            "shadow": {"c0": s0, "c1": s1},
        }
    scene["range_m"] = {"prior": "loguniform", "low": low, "high": high}
    near = high if background is None else min(high, background[1])  # an object stands before it
    case = Case(
        sensor, parse_scene(scene), (c0, c1, c2), crosstalk, background, low, near, (0.0, 0.0)
    )
    m1, m2, _, _ = mean_readings(case, np.array([math.log(min(r, near))]))
    read = sensor.noise.read
    spread = 1.0 if rng.random() < 0.8 else 10 ** rng.uniform(0, 3)
    reading = (
        float(m1[0] + spread * read[0] * rng.normal()),
        float(m2[0] + spread * read[1] * rng.normal()),
    )
    return dataclasses.replace(case, reading=reading)
