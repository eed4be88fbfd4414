"""How far tracks are off before a flat wall, whose shadow is not that of the model.

    python -m benchmarks.flat_wall [--tracks 60] [--flux 0.3]

A disk square-on to the sensor, on the axis, before an infinite flat diffuse wall, in closed form
(docs/model.md, 3.4-3.8): what the disk hides of the wall is a disk on it. Emitters are cos^N, N 0,
1 and 3, pulses of 10 to 30 ns and waves of 20 MHz. Object and shadow are stated as the numbers that
fit their exact light best over the stroke, the wall as it is. Tracks of 20 s at 30 Hz, at a
signal-to-noise ratio of 20 to 2000 at 1 m; the same tracks without the wall stand beside.

A line a scene: tracks, those with a frame that is sure and wrong (one range, no misfit, no outlier,
5 standard deviations off), the share of such frames, tracks that say misfit, and by how much of the
wall's light the best shadow errs at most (10, 50, 90 % of the tracks).
"""

import argparse

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.track import track
from simulator.constants import SPEED_OF_LIGHT
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]

KINDS = (
    {"kind": "sine_wave", "frequency_hz": 2e7},
    {"kind": "pulsed", "pulse_width_s": 1e-8},
    {"kind": "pulsed", "pulse_width_s": 2e-8},
    {"kind": "pulsed", "pulse_width_s": 3e-8},
)
COUNT, STEP_S = 600, 1 / 30
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)


def moments_of(z: Array, radius: float, power: int) -> tuple[Array, Array]:
    """Return half paths [m] and their light of a disk at every z, shape (n, nodes), albedo 1."""
    least = z / np.hypot(z, radius)
    cosines = least[:, None] + (1 - least[:, None]) * (_NODES + 1) / 2
    weights = _WEIGHTS / 2 * (1 - least[:, None]) * cosines ** (power + 4)
    return z[:, None] / cosines, weights * (power + 1) / np.pi / z[:, None] ** 2


def read_of(kind: dict[str, object], paths: Array, light: Array) -> tuple[Array, Array]:
    """Return readings, shape (n, 2), and effective distances [m] of such light."""
    if kind["kind"] == "pulsed":
        reach = SPEED_OF_LIGHT * float(str(kind["pulse_width_s"])) / 2
        late = (light * np.minimum(paths / reach, 1)).sum(1)
        return np.column_stack([late, light.sum(1)]), (light * paths).sum(1) / light.sum(1)
    turn = 4 * np.pi * float(str(kind["frequency_hz"])) / SPEED_OF_LIGHT
    wave = (light * np.exp(1j * turn * paths)).sum(1)
    distance = np.mod(np.angle(wave), 2 * np.pi) / turn
    return np.column_stack([wave.real, wave.imag]), distance


def fitted_object(r: Array, flux: Array) -> dict[str, float]:
    """Return c0, c1 and c2 that fit the flux best."""

    def parts(x: Array) -> tuple[float, float]:
        c0 = float(np.exp(x[0]))
        return c0, float(2 * np.sqrt(c0) * np.expm1(x[1]))

    def left(x: Array) -> Array:
        c0, c1 = parts(x)
        return np.asarray(x[0] + x[2] - np.log(r**2 * (r**2 + c1 * r + c0)) - np.log(flux))

    x = scipy.optimize.least_squares(left, [-3.0, -0.1, -3.0]).x
    c0, c1 = parts(x)
    return {"c0": c0, "c1": c1, "c2": float(np.exp(x[2]))}


def fitted_shadow(r: Array, visible: Array, radius: float) -> tuple[dict[str, float], float]:
    """Return c0' and c1' that fit the visible share best, and their largest error."""

    def left(x: Array) -> Array:
        seen = r**2 + np.exp(x[1]) * r
        return np.asarray(seen / (seen + np.exp(x[0])) - visible)

    x = scipy.optimize.least_squares(left, [2 * np.log(radius), np.log(radius) - 2]).x
    shadow = {"c0": float(np.exp(x[0])), "c1": float(np.exp(x[1]))}
    return shadow, float(np.abs(left(x)).max())


def path_of(rng: np.random.Generator, number: int, low: float, high: float) -> Array:
    """Return distances: at rest, to and fro slowly, and at 2 m/s."""
    t = STEP_S * np.arange(COUNT)
    if number % 3 == 0:
        return np.full(COUNT, rng.uniform(low, high))
    if number % 3 == 1:
        swing = np.sin(2 * np.pi * t / rng.uniform(3, 12))
        return np.asarray(np.sqrt(low * high) * (high / low) ** (0.5 * swing))
    gone = np.mod(2 * t, 2 * (high - low))
    return np.asarray(low + np.minimum(gone, 2 * (high - low) - gone))


def wrong_of(number: int, walled: bool, flux: float | None = None) -> tuple[float, bool, float]:
    """Return the share of frames that are sure and wrong, misfit, and the shadow's error."""
    rng = np.random.default_rng([number, 3])
    kind = KINDS[number % 4]
    reach = parse_sensor({**kind, "noise": {"read": [1.0, 1.0]}}).max_range_m
    low, high = 0.15, min(0.68 * reach, 2.0)
    radius, albedo = np.exp(rng.uniform(np.log([0.03, 0.05]), np.log([1.0, 0.9])))
    power = int(rng.choice([0, 1, 3]))
    z, grid = path_of(rng, number, low, high), np.geomspace(low, high, 40)
    noise = (
        albedo
        * moments_of(np.ones(1), radius, power)[1].sum()
        / np.exp(rng.uniform(np.log(20), np.log(2000)))
    )
    paths, light = moments_of(np.concatenate([z, grid]), radius, power)
    readings, distances = read_of(kind, paths, albedo * light)
    truth, r = distances[:COUNT], distances[COUNT:]
    scene: dict[str, object] = {"object": fitted_object(r, albedo * light[COUNT:].sum(1))}
    if flux is not None:
        scene["discrepancy"] = {"flux": flux, "range_m": 8e-4}
    readings, error = readings[:COUNT], 0.0
    if walled:
        at, white = np.array([max(0.8 * reach, 1.02 * high) if reach < 5 else 3.0]), 0.5
        paths, light = moments_of(at, 1e3, power)
        bare, distance = read_of(kind, paths, white * light)
        hidden = [moments_of(at, radius * at[0] / each, power) for each in [*z, *grid]]
        gone = [read_of(kind, p, white * q)[0][0] for p, q in hidden[:COUNT]]
        visible = 1 - np.array([q.sum() for _, q in hidden[COUNT:]]) / light.sum()
        shadow, error = fitted_shadow(r, visible, radius)
        strength = float(bare[0, 1] if kind["kind"] == "pulsed" else np.hypot(*bare[0]))
        where = float(distance[0])
        scene["background"] = {"strength": strength, "distance_m": where, "shadow": shadow}
        readings = readings + bare - np.array(gone)
    readings = readings + noise * rng.standard_normal((COUNT, 2))
    sensor = parse_sensor({**kind, "noise": {"read": [noise, noise]}})
    frames = Frames(readings, time_s=STEP_S * np.arange(COUNT, dtype=np.float64))
    said = track(sensor, parse_scene(scene), frames)
    sure = (said.status == Status.UNIQUE) & ~said.misfit & (said.outlier < 0.5)
    off = np.abs(said.best_m - truth) > 5 * said.best_sd_m
    return float((sure & off).mean()), bool(said.misfit.any()), error


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracks", type=int, default=60)
    parser.add_argument("--flux", type=float, help="the flux's error that the scene states")
    arguments = parser.parse_args()
    tracks = arguments.tracks
    print("| scene | tracks | sure and wrong | such frames | say misfit | shadow errs by |")
    print("|---|---|---|---|---|---|")
    for walled in (False, True):
        found = np.array([wrong_of(n, walled, arguments.flux) for n in range(tracks)])
        errs = np.quantile(found[:, 2], [0.1, 0.5, 0.9]).round(3)
        name = "a flat wall" if walled else "no wall"
        wrong, misfit = int((found[:, 0] > 0).sum()), int(found[:, 1].sum())
        share = 100 * found[:, 0].mean()
        print(f"| {name} | {tracks} | {wrong} | {share:.1f} % | {misfit} | {errs} |", flush=True)


if __name__ == "__main__":
    main()
