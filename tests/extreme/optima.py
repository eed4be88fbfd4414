"""The optimum of a joint fit in 50 digits: Gauss and Newton over all unknowns and all ranges."""

import dataclasses
import math
from typing import Any

import mpmath
import numpy as np
from mpmath import mp, mpf
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.fits.likelihood.maximum import TOP
from simulator.frames import Frames
from simulator.sensor import PulsedSensor, Sensor
from tests.fits.scenes import (
    OBJECT,
    VAGUE,
    WALL,
    data,
    exact_scene,
    path,
    sensor_of,
    values_of,
)

__all__ = ["CASES", "SNRS", "FitMiss", "excess_of", "fit_miss"]

Array = NDArray[np.float64]

_DIGITS = 50
_STEP = 1e-20  # of differences, relative to the unknown's own size
_TURNS = 60
_LIGHT_M_S = 299792458
_NEAREST_M = 0.02  # of the ranges that a scene allows where it states none
_EPSILON = float(np.finfo(float).eps)

SNRS = (1e-2, 1.0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12)
UNKNOWN_WALL: dict[str, Any] = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": {"prior": "uniform", "low": 2.2, "high": 8.0},
    "shadow": {"c0": 0.056, "c1": 0.013},
}
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "object": ({}, {"object": OBJECT}),
    "crosstalk": ({"crosstalk": [VAGUE, VAGUE]}, {"object": OBJECT, "crosstalk": [0.002, 0.01]}),
    "wall": (
        {"object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]}, "background": UNKNOWN_WALL},
        {"object": OBJECT, "background": WALL},
    ),
}


@dataclasses.dataclass(frozen=True)
class FitMiss:
    """What became of a fit.

    Attributes
    ----------
    refused : str
        The reason; empty where it answered.
    excess : float
        Its chi-square above that of the reference; nan where it left the ranges that are allowed.
    rounding : float
        What the rounding of readings and model may move a chi-square by.
    moved : float
        How far the best values lie from those of the reference, in the fit's standard deviations,
        at worst.
    """

    refused: str
    excess: float = math.nan
    rounding: float = math.nan
    moved: float = math.nan


def _means(sensor: Sensor, v: dict[str, Any], r: Any) -> tuple[Any, Any]:
    """Return the two readings of one frame, written down once more from docs/model.md."""
    gain = mpf(sensor.known_gain)
    c0, c1, c2 = (v[f"object.c{k}"] for k in range(3))
    light = gain * c0 * c2 / (r * r * (r * r + c1 * r + c0))
    far, wall = mpf(0), mpf(0)
    if "background.strength" in v:
        far = v["background.distance_m"]
        seen = r * (r + v["background.shadow.c1"])
        wall = v["background.strength"] * seen / (seen + v["background.shadow.c0"])
    if isinstance(sensor, PulsedSensor):
        r0 = mpf(_LIGHT_M_S) * mpf(sensor.pulse_width_s) / 2
        first, second = (light * r + wall * far) / r0, light + wall
    else:
        k = 4 * mp.pi * mpf(sensor.frequency_hz) / _LIGHT_M_S
        first = light * mp.cos(k * r) + wall * mp.cos(k * far)
        second = light * mp.sin(k * r) + wall * mp.sin(k * far)
    one, other = sensor.columns
    zero = mpf(0)
    return (
        first + v.get(f"crosstalk.{one}", zero),
        second + v.get(f"crosstalk.{other}", zero),
    )


def _optimum(
    sensor: Sensor, frames: Frames, known: dict[str, float], start: dict[str, float], ranges: Array
) -> tuple[float, dict[str, float]]:
    """Return the least chi-square downhill of a start, and where it lies; inf beyond the ranges."""
    names = list(start)
    read = [mpf(value) for value in sensor.noise.read]
    y = [[mpf(float(value)) for value in row] for row in frames.readings]
    fixed = {name: mpf(value) for name, value in known.items()}
    d, n = len(names), len(ranges)

    def frame(x: Any, i: int, values: dict[str, Any]) -> list[Any]:
        m = _means(sensor, values, mp.exp(x[d + i]))
        return [(y[i][k] - m[k]) / read[k] for k in range(2)]

    def values_at(x: Any) -> dict[str, Any]:
        return fixed | {name: x[j] for j, name in enumerate(names)}

    def cost_of(x: Any) -> Any:
        values = values_at(x)
        return mp.fsum(e * e for i in range(n) for e in frame(x, i, values))

    x = [mpf(start[name]) for name in names] + [mp.log(mpf(float(r))) for r in ranges]
    cost, damping = cost_of(x), mpf(0)
    for _ in range(_TURNS):
        # a frame's range enters its own readings alone: its share is taken off first
        normal, right = mp.zeros(d), mp.zeros(d, 1)
        own = []
        values = values_at(x)
        for i in range(n):
            e = frame(x, i, values)
            columns = []
            for j in [*range(d), d + i]:
                step = mpf(_STEP) * (abs(x[j]) if x[j] else 1)
                y_ = list(x)
                y_[j] += step
                there = frame(y_, i, values_at(y_) if j < d else values)
                columns.append([(e[k] - there[k]) / step for k in range(2)])
            g = columns.pop()
            size = g[0] ** 2 + g[1] ** 2
            # across the curve, where the range plays no part
            across = [g[1] / mp.sqrt(size), -g[0] / mp.sqrt(size)]
            a = [c[0] * across[0] + c[1] * across[1] for c in columns]
            b = e[0] * across[0] + e[1] * across[1]
            for j in range(d):
                right[j] += a[j] * b
                for m in range(d):
                    normal[j, m] += a[j] * a[m]
            own.append((g, size, columns, e))
        scale = [mp.sqrt(normal[j, j]) or mpf(1) for j in range(d)]
        for j in range(d):
            normal[j, j] += damping * scale[j] ** 2
        move = mp.lu_solve(normal, right) if d else mp.zeros(0, 1)
        trial = [x[j] + move[j] for j in range(d)]
        for i, (g, size, columns, e) in enumerate(own):
            rest = [e[k] - sum(columns[j][k] * move[j] for j in range(d)) for k in range(2)]
            along = (g[0] * rest[0] + g[1] * rest[1]) / size
            trial.append(x[d + i] + max(min(along, mpf("0.5")), mpf("-0.5")))
        new = cost_of(trial)
        if new <= cost:
            gained, cost, x = cost - new, new, trial
            damping /= 10
            if gained < mpf("1e-9") * (1 + cost):
                break
        else:
            damping = max(damping * 10, mpf("1e-6"))
            if damping > mpf("1e12"):
                break
    found = {name: float(x[j]) for j, name in enumerate(names)}
    low, high = (mp.log(mpf(end)) for end in (_NEAREST_M, sensor.max_range_m))
    inside = all(low < u < high for u in x[d:])
    return (float(cost) if inside else math.inf), found


def fit_miss(kind: str, case: str, snr: float, frames: int = 10, seed: int = 1) -> FitMiss:
    """Fit, and hold the answer to the best of two climbs: from the truth, and from the answer."""
    told, truth = CASES[case]
    sensor, trajectory = sensor_of(kind, snr), path(frames)
    shown, scene = data(sensor, truth, trajectory, seed), exact_scene(told)
    found = estimate(sensor, scene, shown, ["joint_fit"])
    if not found.results:
        return FitMiss(next(row.reason for row in found.left_out if row.name == "joint_fit"))
    (result,) = found.results
    assert result.parameters is not None
    assert result.fit is not None
    exact = values_of(sensor, truth)
    start = {name: exact[name] for name in result.parameters}
    known = {name: value for name, value in exact.items() if name not in start}
    with mpmath.workdps(_DIGITS):
        cost, values = _optimum(sensor, shown, known, start, np.array(trajectory.range_m))
        answer = {name: item["value"] for name, item in result.parameters.items()}
        if (
            all(value is not None for value in answer.values())
            and np.isfinite(result.range_m).all()
        ):
            other, near = _optimum(sensor, shown, known, answer, result.range_m)
            if other < cost:
                cost, values = other, near
    if math.isinf(cost):
        return FitMiss("")
    moved = max(
        abs(item["value"] - values[name]) / item["sd"] if item["value"] is not None else 0.0
        for name, item in result.parameters.items()
    )
    light = np.abs(shown.readings / np.asarray(sensor.noise.read))
    # a residual of one standard deviation, moved by a few roundings of its reading
    rounding = 8 * _EPSILON * float(light.sum()) + (8 * _EPSILON) ** 2 * float((light**2).sum())
    return FitMiss("", result.fit["chi_square"] - cost, rounding, moved)


def excess_of(miss: FitMiss) -> float:
    """Return by how much a chi-square is too large, over what may remain and what rounding does."""
    return miss.excess / (TOP + miss.rounding)
