"""Time a frame of every real-time technique, against baselines of the same run.

    python -m benchmarks.realtime [--frames 100000]

Baselines: `w1 / w2` in numpy for the conventional range of a pulse, `arctan2` for a sine wave; a
loop over frames of `numpy.roots` on the technique's polynomial for a pulse; a loop over frames of
`scipy.optimize.brentq` on every sign change on a grid for a sine wave. The grid
(docs/model.md, exact): logarithmic and linear points merged, 60 a half turn of the phase and never
fewer than 120. Loops are timed on some hundred frames and scaled.
"""

import argparse
import math
import time
import timeit
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from inference.estimate import estimate
from inference.realtime.registry import TECHNIQUES
from inference.realtime.techniques.conventional import conventional_range
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import PulsedSensor, Sensor, parse_sensor

Array = NDArray[np.float64]

C0, C1, C2 = 0.0769, -0.123, 0.0957
FAR, STRENGTH, C0S, C1S = 3.0, 0.0176838825658, 0.056137, -0.02829
K = C0 * C2


def best(action: Callable[[], object], repeat: int) -> float:
    """Least processor time of a call [s]: others on the machine do not count."""
    action()
    return min(timeit.repeat(action, number=1, repeat=repeat, timer=time.process_time))


def frames_of(sensor: Sensor, r: Array, background: bool) -> Frames:
    q, qs = r * r + C1 * r + C0, r * r + C1S * r + C0S
    flux = K / (r * r * q)
    change = -flux * (4 * r * r + 3 * C1 * r + 2 * C0) / (r * q)
    back = STRENGTH * (r * r + C1S * r) / qs * background
    back_change = STRENGTH * C0S * (2 * r + C1S) / qs**2 * background
    if isinstance(sensor, PulsedSensor):
        pair = ((flux * r + back * FAR) / sensor.r0, flux + back)
        rate = ((change * r + flux + back_change * FAR) / sensor.r0, change + back_change)
    else:
        k = sensor.wave_number
        turn, far = np.exp(1j * k * r), np.exp(1j * k * FAR)
        x, dx = flux * turn + back * far, (change + 1j * k * flux) * turn + back_change * far
        pair, rate = (x.real, x.imag), (dx.real, dx.imag)
    return Frames(np.column_stack(pair), derivatives=np.column_stack(rate))


def polynomial(name: str, a: float, b: float, r0: float) -> list[float]:
    """Coefficients for one frame, highest power first; a = r0 times the first, b the second."""
    a *= r0
    match name:
        case "intensity":
            return [b, b * C1, b * C0, 0.0, -K]
        case "intensity_w1":
            return [a, a * C1, a * C0, -K]
        case "differential":
            return [3 * b, 2 * C1 * b - 4 * a, C0 * b - 3 * C1 * a, -2 * C0 * a]
        case "background_cancelling":
            d = b - a / FAR
            return [d, d * C1, d * C0, K / FAR, -K]
        case "background_intensity":
            u, v = b - STRENGTH, a - STRENGTH * FAR
            return [u, u * C1S - v, b * C0S - C1S * v, -a * C0S]
        case _:
            q = a / b
            e, s = (FAR - q) * STRENGTH * C0S, C1S**2 + 2 * C0S
            n2, n1, n0 = 4 * q - 2 * C1, 3 * C1 * q - C0, 2 * C0 * q
            return [
                2 * e,
                e * (4 * C1 + C1S) - 3 * K,
                e * (2 * C1**2 + 4 * C0 + 2 * C1 * C1S) + K * (n2 - 6 * C1S),
                e * (4 * C0 * C1 + C1S * (C1**2 + 2 * C0)) + K * (n1 + 2 * C1S * n2 - 3 * s),
                e * (2 * C0**2 + 2 * C0 * C1 * C1S)
                + K * (n0 + 2 * C1S * n1 + s * n2 - 6 * C0S * C1S),
                e * C0**2 * C1S + K * (2 * C1S * n0 + s * n1 + 2 * C0S * C1S * n2 - 3 * C0S**2),
                K * (s * n0 + 2 * C0S * C1S * n1 + C0S**2 * n2),
                K * (2 * C0S * C1S * n0 + C0S**2 * n1),
                K * C0S**2 * n0,
            ]


def roots_loop(name: str, readings: Array, r0: float) -> list[Array]:
    found = []
    for a, b in readings.tolist():
        z = np.roots(polynomial(name, a, b, r0))
        found.append(z.real[(np.abs(z.imag) < 1e-9 * np.abs(z)) & (z.real > 0)])
    return found


def equation(name: str, i: float, q: float, k: float) -> Callable[[Any], Any]:
    """Return a sine wave's equation, which numpy evaluates on a grid and brentq at a point."""

    def f(r: Any) -> Any:
        quad = r * r + C1 * r + C0
        cos, sin = np.cos(k * r), np.sin(k * r)
        match name:
            case "intensity":
                return K / (r * r * quad) - math.hypot(i, q)
            case "background_cancelling":
                y = q * math.cos(k * FAR) - i * math.sin(k * FAR)
                return y * r * r * quad + K * np.sin(k * (FAR - r))
        qs = r * r + C1S * r + C0S
        if name == "background_intensity":
            return (i * sin - q * cos) * qs + STRENGTH * (r * r + C1S * r) * np.sin(k * (FAR - r))
        a = 4 * r * r + 3 * C1 * r + 2 * C0
        x, y = -a * cos - k * r * quad * sin, -a * sin + k * r * quad * cos
        if name != "differential":
            back = STRENGTH / K * C0S * (2 * r + C1S) * r**3 * (quad / qs) ** 2
            x, y = x + back * math.cos(k * FAR), y + back * math.sin(k * FAR)
        return x * q - y * i

    return f


def brentq_loop(name: str, readings: Array, k: float, high: float) -> list[list[float]]:
    count = max(60 * math.ceil(k * high / math.pi), 60)
    grid = np.unique(
        np.concatenate([np.geomspace(1e-3, high, count), np.linspace(1e-3, high, count)])
    )
    found = []
    for i, q in readings.tolist():
        f = equation(name, i, q, k)
        signs = np.signbit(f(grid))
        found.append(
            [
                brentq(f, grid[j], grid[j + 1], xtol=1e-14)
                for j in np.flatnonzero(signs[1:] != signs[:-1])
            ]
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=100_000)
    n = parser.parse_args().frames
    rng = np.random.default_rng(1)
    r = np.exp(rng.uniform(np.log(0.1), np.log(2.5), n))
    noise = {"read": [1e-9, 1e-9], "derivative": [1e-9, 1e-9]}
    sensors = (
        parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise}),
        parse_sensor({"kind": "sine_wave", "frequency_hz": 5e6, "noise": noise}),
    )
    target = {"c0": C0, "c1": C1, "c2": C2}
    behind = {"strength": STRENGTH, "distance_m": FAR, "shadow": {"c0": C0S, "c1": C1S}}
    print(f"{n} frames, one thread; ranges log-uniform in 0.1-2.5 m\n")
    print(
        f"{'technique':36}{'sensor':11}{'ns/frame':>9}{'cost':>6}  "
        f"{'baseline':16}{'ns/frame':>9}{'ratio':>9}"
    )

    def row(name: str, sensor: Sensor, spent: float, cost: str, base: str, other: float) -> None:
        ratio = other / spent
        shown = f"{ratio:.3g} x" if ratio >= 1 else f"1/{1 / ratio:.3g}"
        print(
            f"{name:36}{sensor.kind:11}{1e9 * spent:9.3g}{cost:>6}  {base:16}"
            f"{1e9 * other:9.3g}{shown:>9}"
        )

    for sensor in sensors:
        plain, full = frames_of(sensor, r, False), frames_of(sensor, r, True)
        first, second = plain.readings[:, 0].copy(), plain.readings[:, 1].copy()
        pulsed = isinstance(sensor, PulsedSensor)
        if pulsed:
            base, label = best(partial(np.divide, first, second), 200) / n, "w1 / w2"
        else:
            base, label = best(partial(np.arctan2, second, first), 50) / n, "arctan2(q, i)"
        alone = best(partial(conventional_range, sensor, plain), 200) / n
        row("conventional, range alone", sensor, alone, "", label, base)
        unit = 0.0
        for name, technique in TECHNIQUES.items():
            if sensor.kind not in technique.kinds:
                continue
            frames = full if technique.uses_background else plain
            data = {"object": target} | (
                {"background": behind} if technique.uses_background else {}
            )
            scene: Scene = parse_scene(data)
            spent = (
                best(
                    partial(estimate, sensor, scene, frames, [name]),
                    100 if name == "conventional" else 7,
                )
                / n
            )
            unit = unit or spent
            cost = f"{spent / unit:.0f}"
            if name == "conventional":
                row(name, sensor, spent, cost, label, base)
                continue
            seen = frames.derivatives if technique.differential else frames.readings
            assert seen is not None
            if isinstance(sensor, PulsedSensor):
                some, r0 = seen[:500], sensor.r0
                loop = best(partial(roots_loop, name, some, r0), 3) / len(some)
                row(name, sensor, spent, cost, "numpy.roots", loop)
            else:
                some, k = seen[:100], sensor.wave_number
                high = FAR if technique.uses_background else math.pi / k
                loop = best(partial(brentq_loop, name, some, k, high), 3) / len(some)
                row(name, sensor, spent, cost, "scipy brentq", loop)


if __name__ == "__main__":
    main()
