"""How far tracks are off before a flat wall, whose shadow is not that of the model.

    python -m benchmarks.flat_wall [--tracks 60] [--flux 0.3]

A disk square-on to the sensor, on the axis, before an infinite flat diffuse wall, in closed form
(docs/model.md, 3.4-3.8): what the disk hides of the wall is a disk on it. Emitters are cos^N, N 0,
1 and 3, pulses of 10 to 30 ns and waves of 20 MHz. Object and shadow are stated as the numbers that
fit their exact light best over the stroke, the wall as frames without the disk tell it. Tracks of
20 s at 30 Hz, at a signal-to-noise ratio of 20 to 2000 at 1 m; the same tracks without the wall
stand beside.

Before them by how much the best shadow errs, for what `simulator.model_error.SHADOW_SD` says: of
the light that is left visible in units of (1 - S)/sqrt(S), of the distance that it seems to come
from in units of 1 - S, in root mean square over the tracks whose object hides more than half
somewhere.

A line a scene: tracks, those with a frame that is sure and wrong (one range, no misfit, no outlier,
5 standard deviations off), the share of such frames, tracks that say misfit, and by how much of the
wall's light the best shadow errs at most (10, 50, 90 % of the tracks). Then what techniques of
single frames say of every 20th, also of waves whose wall is 1.6 and 3.8 half turns away. With
--flux the scene states the sizes of the model's errors, of which the shadow's is then none.
"""

import argparse
import dataclasses
import itertools
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status
from inference.tracking.track import track
from simulator.constants import SPEED_OF_LIGHT
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor

Array = NDArray[np.float64]

KINDS = (
    {"kind": "sine_wave", "frequency_hz": 2e7},
    {"kind": "pulsed", "pulse_width_s": 1e-8},
    {"kind": "pulsed", "pulse_width_s": 2e-8},
    {"kind": "pulsed", "pulse_width_s": 3e-8},
)
# waves whose walls are more than half a turn of phase away [Hz, m]
FAR = ((2e7, 5.0), (4e7, 6.0))
COUNT, STEP_S = 600, 1 / 30
WHITE = 0.5  # albedo of the wall
HELD = 1.645  # sd: half of a 90 % interval
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


class Course(NamedTuple):
    """A disk's way before a wall."""

    kind: dict[str, object]
    albedo: float
    radius: float
    power: int
    noise: float
    way: Array  # (COUNT,) along the axis [m]
    grid: Array  # where object and shadow are fitted [m]
    wall: Array  # (1,) where it stands [m]


def course_of(number: int, rng: np.random.Generator, far: bool = False) -> Course:
    """Draw one, before a wall that is more than half a turn of phase away if ``far``."""
    hertz, metres = FAR[number % 2]
    kind = {"kind": "sine_wave", "frequency_hz": hertz} if far else dict(KINDS[number % 4])
    reach = parse_sensor({**kind, "noise": {"read": [1.0, 1.0]}}).max_range_m
    low, high = 0.15, min(0.68 * reach, 2.0)
    radius, albedo = np.exp(rng.uniform(np.log([0.03, 0.05]), np.log([1.0, 0.9]))).tolist()
    power = int(rng.choice([0, 1, 3]))
    way, grid = path_of(rng, number, low, high), np.geomspace(low, high, 40)
    signal = albedo * float(moments_of(np.ones(1), radius, power)[1].sum())
    noise = signal / float(np.exp(rng.uniform(np.log(20), np.log(2000))))
    wall = np.array([max(0.8 * reach, 1.02 * high) if reach < 5 else 3.0])
    if far:
        wall = np.array([metres])
    return Course(kind, albedo, radius, power, noise, way, grid, wall)


def bare_of(course: Course) -> tuple[Array, float, float]:
    """Return readings of the bare wall, shape (2,), the distance they tell [m] and its light."""
    paths, light = moments_of(course.wall, 1e3, course.power)
    readings, _ = read_of(course.kind, paths, WHITE * light)
    return readings[0], float(seen_distance(course, readings)[0]), float(WHITE * light.sum())


def hidden_of(course: Course, z: Array) -> tuple[Array, Array]:
    """Return readings and light of what the disk hides of the wall, shapes (n, 2) and (n,)."""
    wide = course.radius * course.wall[0] / z
    seen = [moments_of(course.wall, each, course.power) for each in wide]
    readings = [read_of(course.kind, paths, WHITE * light)[0][0] for paths, light in seen]
    return np.array(readings), np.array([WHITE * light.sum() for _, light in seen])


def seen_distance(course: Course, readings: Array) -> Array:
    """Return the effective distance of light that is read, shape (n,) [m]."""
    if course.kind["kind"] == "pulsed":
        reach = SPEED_OF_LIGHT * float(str(course.kind["pulse_width_s"])) / 2
        return np.asarray(reach * readings[:, 0] / readings[:, 1])
    turn = 4 * np.pi * float(str(course.kind["frequency_hz"])) / SPEED_OF_LIGHT
    return np.asarray(np.mod(np.arctan2(readings[:, 1], readings[:, 0]), 2 * np.pi) / turn)


def fitted_of(course: Course) -> tuple[dict[str, float], float, Array, dict[str, float]]:
    """Return the best shadow, its largest error, and ranges and numbers of the object."""
    paths, light = moments_of(course.grid, course.radius, course.power)
    _, r = read_of(course.kind, paths, course.albedo * light)
    _, gone = hidden_of(course, course.grid)
    visible = 1 - gone / bare_of(course)[2]
    shadow, error = fitted_shadow(r, visible, course.radius)
    return shadow, error, r, fitted_object(r, course.albedo * light.sum(1))


def shadow_errors(number: int) -> tuple[Array, Array] | None:
    """Return a shadow's errors in units of their law: of light, of its distance; None if small."""
    course = course_of(number, np.random.default_rng([number, 3]))
    shadow, _, r, _ = fitted_of(course)
    inner = r * (r + shadow["c1"])
    share = inner / (inner + shadow["c0"])
    if share.min() > 0.5:
        return None
    bare, distance, whole = bare_of(course)
    gone, hidden = hidden_of(course, course.grid)
    light = (1 - hidden / whole) / share - 1
    farther = seen_distance(course, bare - gone) - distance
    if course.kind["kind"] != "pulsed":
        whole_turn = SPEED_OF_LIGHT / (2 * float(str(course.kind["frequency_hz"])))
        farther -= whole_turn * np.round(farther / whole_turn)
    farther /= distance
    felt = share > 0.1  # of what is all but hidden nothing is left to tell a distance by
    return light * np.sqrt(share) / (1 - share), (farther / (1 - share))[felt]


class Seen(NamedTuple):
    """What is stated and read, and the truth."""

    sensor: Sensor
    scene: Scene
    frames: Frames
    truth: Array
    error: float


def seen_of(number: int, walled: bool, flux: float | None = None, far: bool = False) -> Seen:
    """Return frames of a course."""
    rng = np.random.default_rng([number, 3])
    course = course_of(number, rng, far)
    shadow, error, _, numbers = fitted_of(course)
    paths, light = moments_of(course.way, course.radius, course.power)
    readings, truth = read_of(course.kind, paths, course.albedo * light)
    scene: dict[str, object] = {"object": numbers}
    if flux is not None:
        scene["discrepancy"] = {"flux": flux, "range_m": 8e-4}
    if walled:
        bare, distance, _ = bare_of(course)
        pulsed = course.kind["kind"] == "pulsed"
        strength = float(bare[1] if pulsed else np.hypot(*bare))
        scene["background"] = {"strength": strength, "distance_m": distance, "shadow": shadow}
        readings = readings + bare - hidden_of(course, course.way)[0]
    readings = readings + course.noise * rng.standard_normal((COUNT, 2))
    sensor = parse_sensor({**course.kind, "noise": {"read": [course.noise, course.noise]}})
    frames = Frames(readings, time_s=STEP_S * np.arange(COUNT, dtype=np.float64))
    return Seen(sensor, parse_scene(scene), frames, truth, error)


def wrong_of(number: int, walled: bool, flux: float | None = None) -> tuple[float, bool, float]:
    """Return the share of frames that are sure and wrong, misfit, and the shadow's error."""
    seen = seen_of(number, walled, flux)
    said = track(seen.sensor, seen.scene, seen.frames)
    sure = (said.status == Status.UNIQUE) & ~said.misfit & (said.outlier < 0.5)
    off = np.abs(said.best_m - seen.truth) > 5 * said.best_sd_m
    return float((sure & off).mean()), bool(said.misfit.any()), seen.error


def single_frames(
    number: int, technique: str, flux: float | None = None, far: bool = False
) -> Array:
    """Return of every 20th frame with one range how many sd it is off, and its relative sd."""
    seen = seen_of(number, True, flux, far)
    some = np.arange(0, COUNT, 20)
    frames = dataclasses.replace(
        seen.frames, readings=seen.frames.readings[some], time_s=STEP_S * some.astype(np.float64)
    )
    (said,) = estimate(seen.sensor, seen.scene, frames, [technique]).results
    one = (said.status == Status.UNIQUE) & np.isfinite(said.sd_m)
    off, sd = np.abs(said.range_m - seen.truth[some])[one], said.sd_m[one]
    return np.column_stack([off / sd, sd / seen.truth[some][one]])


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracks", type=int, default=60)
    parser.add_argument("--flux", type=float, help="the flux's error that the scene states")
    arguments = parser.parse_args()
    tracks = arguments.tracks
    parts = [pair for n in range(tracks) if (pair := shadow_errors(n)) is not None]
    light, farther = (rms(np.concatenate(each)) for each in zip(*parts, strict=True))
    print(f"shadows err by {light:.2f} (1 - S)/sqrt(S), distances by {farther:.2f} (1 - S)\n")
    print("| scene | tracks | sure and wrong | such frames | say misfit | shadow errs by |")
    print("|---|---|---|---|---|---|")
    for walled in (False, True):
        found = np.array([wrong_of(n, walled, arguments.flux) for n in range(tracks)])
        errs = np.quantile(found[:, 2], [0.1, 0.5, 0.9]).round(3)
        name = "a flat wall" if walled else "no wall"
        wrong, misfit = int((found[:, 0] > 0).sum()), int(found[:, 1].sum())
        share = 100 * found[:, 0].mean()
        print(f"| {name} | {tracks} | {wrong} | {share:.1f} % | {misfit} | {errs} |", flush=True)
    print(
        "\n| frames by themselves | told | held by 90 % | beyond 5 sd | sd |\n|---|---|---|---|---|"
    )
    techniques = ("background_intensity", "background_cancelling")
    for technique, far in itertools.product(techniques, (False, True)):
        off, sd = np.concatenate(
            [single_frames(n, technique, arguments.flux, far) for n in range(tracks)]
        ).T
        held = f"{100 * np.mean(off < HELD):.0f} %"
        width = f"{100 * np.median(sd):.1f} %"
        name = technique + (", far walls" if far else "")
        print(f"| {name} | {off.size} | {held} | {int((off > 5).sum())} | {width} |")


if __name__ == "__main__":
    main()
