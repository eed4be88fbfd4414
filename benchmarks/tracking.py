"""The tracker: time a frame, and wrong roots on the way through a fold.

    python -m benchmarks.tracking [--tracks 200]

Speed: 100,000 frames with both windows usable and a known scene, against the `conventional`
estimate of the same frames and against looking for new objects everywhere in every frame. CPU time
of one core.

Wrong roots: objects that wander through a fold, where two ranges explain a frame and only the rate
tells which. A frame counts where the two roots are further apart than four standard deviations of
a frame, and after the fold has been crossed once. Baselines on the same frames: the heavier root of
each frame alone; the root that is nearer to the last one chosen; a bootstrap particle filter.
"""

import argparse
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.realtime.techniques.conventional import conventional_range
from inference.tracking.settings import TrackingSettings
from inference.tracking.track import step
from inference.tracking.tracker import Tracker, tracker
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import mean_readings
from tests.tracking.scenes import FOLD_M, FOLDED, PLATE, frames_of, scene_of, sensor_of, wander

Array = NDArray[np.float64]
SECONDS = 0.02
PARTICLES = 4000


def cpu(call: Any, repeats: int) -> float:
    """Least CPU time of some calls [s]."""
    best = float("inf")
    for _ in range(repeats):
        begin = time.process_time()
        call()
        best = min(best, time.process_time() - begin)
    return best


def speed(count: int = 100_000) -> None:
    sensor, scene = sensor_of(7.72e-6), scene_of(PLATE)
    ranges = 0.6 * np.exp(0.8 * np.sin(0.01 * np.arange(count)))
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    rng = np.random.default_rng(1)
    readings = mean_readings(sensor, terms, ranges) + 7.72e-6 * rng.standard_normal((count, 2))
    frames = frames_of(readings, 0.01)
    model = tracker(sensor, scene)
    few = frames.select(slice(0, 1000))
    step(model, model.first, few)
    conventional_range(sensor, few)
    fast = cpu(lambda: step(model, model.first, frames), 3)
    erring = tracker(sensor, scene_of(PLATE, discrepancy="default"))
    step(erring, erring.first, few)
    default = cpu(lambda: step(erring, erring.first, frames), 1)
    full = cpu(lambda: step(model, model.first, frames, full=True), 1)
    bare = cpu(lambda: conventional_range(sensor, frames), 20)
    plain = cpu(lambda: estimate(sensor, scene, frames, ["conventional"]), 5)
    state = model.first
    begin = time.process_time()
    for i in range(1000):
        state, _ = step(model, state, few.select(slice(i, i + 1)))
    single = (time.process_time() - begin) / 1000
    print(f"{'':<44}{'us a frame':>12}{'ratio':>13}")
    for name, seconds in (
        ("conventional estimate, all of it", plain / count),
        ("its division alone", bare / count),
        ("tracker, one batch", fast / count),
        ("tracker, errors of the model carried along", default / count),
        ("tracker, looking everywhere in every frame", full / count),
        ("tracker, frame by frame from Python", single),
    ):
        print(f"{name:<44}{seconds * 1e6:>12.3f}{seconds * count / plain:>13.3f}")


def particles(
    model: Tracker, readings: Array, table: tuple[Array, Array], fold: float, seed: int
) -> Array:
    """Probability below the fold by a bootstrap filter with systematic resampling."""
    rng = np.random.default_rng(seed)
    s, tau = model.settings.rate_sd, model.settings.rate_time_s
    grid, means = table
    u = rng.uniform(grid[0], grid[-1], 20 * PARTICLES)
    v = s * rng.standard_normal(u.size)
    decay = np.exp(-SECONDS / tau)
    out = np.empty(len(readings))
    by_rate = model.model.table.by_rate
    units = np.asarray(model.observed.units)
    used = np.array([model.settings.observables != "w2", True])
    for i, pair in enumerate(readings):
        if i:
            new = decay * v + s * np.sqrt(1 - decay**2) * rng.standard_normal(v.size)
            u, v = u + 0.5 * SECONDS * (v + new), new
        expected = np.column_stack([np.interp(u, grid, means[:, k]) for k in range(2)])
        if by_rate:
            expected *= v[:, None]
        logs = -0.5 * (((pair - expected) / units) ** 2 * used).sum(axis=1)
        logs[(u < grid[0]) | (u > grid[-1])] = -1e300
        weight = np.exp(logs - logs.max())
        weight /= weight.sum()
        out[i] = weight[u < fold].sum()
        places = (rng.uniform() + np.arange(PARTICLES)) / PARTICLES
        chosen = np.minimum(np.searchsorted(np.cumsum(weight), places), u.size - 1)
        u, v = u[chosen], v[chosen]
    return out


def through_the_fold(name: str, model: Tracker, scene: Any, tracks: int, start: float) -> None:
    sensor, settings = model.sensor, model.settings
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    grid = np.linspace(model.model.table.start, model.model.table.end, 8001)
    curve = mean_readings(sensor, terms, np.exp(grid))
    by_rate = model.model.table.by_rate
    table = np.gradient(curve, grid, axis=0) if by_rate else curve
    # what a single frame sees: w2, or the direction of the derivative
    seen = np.unwrap(np.arctan2(table[:, 0], table[:, 1]), period=np.pi) if by_rate else table[:, 1]
    fold = start
    at = int(np.argmin(np.abs(grid - fold)))
    units = np.asarray(model.observed.units)
    rng = np.random.default_rng(7)
    wrong = dict.fromkeys(("frame by frame", "nearest to the last", "particles", "tracker"), 0)
    total = frames_count = 0
    spent = 0.0
    for k in range(tracks):
        side = rng.choice([-1.0, 1.0])
        while True:
            first = (fold + 0.2 * side + 0.05 * rng.standard_normal(), -0.4 * side)
            u, v = wander(rng, 150, settings, first, SECONDS)
            if u.min() > grid[0] + 0.1 and u.max() < grid[-1] - 0.1:
                break
        mean = np.column_stack([np.interp(u, grid, table[:, j]) for j in range(2)])
        mean = mean * v[:, None] if by_rate else mean
        readings = mean + units * rng.standard_normal(mean.shape)
        frames = frames_of(np.zeros_like(readings) if by_rate else readings, SECONDS)
        if by_rate:
            frames = Frames(frames.readings, frames.time_s, derivatives=readings)
        begin = time.process_time()
        _, result = step(model, model.first, frames)
        spent += time.process_time() - begin
        frames_count += len(u)
        rows, weights = np.log(result.hypotheses_m), np.nan_to_num(result.hypotheses_weight)
        below = np.where(rows < fold, weights, 0.0).sum(axis=1) / np.maximum(
            weights.sum(axis=1), 1e-300
        )
        ours = below > 0.5
        theirs = particles(model, readings, (grid, table), fold, k) > 0.5
        # the two roots of what a frame sees, and what it costs to tell them apart
        if by_rate:
            value = np.unwrap(np.arctan2(readings[:, 0], readings[:, 1]), period=np.pi)
            value = value + np.pi * np.round((np.median(seen) - value) / np.pi)
            noise = np.hypot(units[0] * readings[:, 1], units[1] * readings[:, 0])
            noise /= (readings**2).sum(axis=1)
        else:
            value, noise = readings[:, 1], np.full(len(u), units[1])
        left = grid[np.argmin(np.abs(seen[None, :at] - value[:, None]), axis=1)]
        right = grid[at + np.argmin(np.abs(seen[None, at:] - value[:, None]), axis=1)]
        slopes = np.abs(np.gradient(seen, grid))
        # a root's weight under an even prior is its width: one over the slope
        single = np.interp(left, grid, slopes) < np.interp(right, grid, slopes)
        nearest, last = np.empty(len(u), dtype=bool), u[0]
        for i in range(len(u)):
            nearest[i] = abs(left[i] - last) < abs(right[i] - last)
            last = left[i] if nearest[i] else right[i]
        truth = u < fold
        apart = np.abs(np.interp(u, grid, seen) - seen[at]) > 4 * noise
        crossed = np.cumsum(np.r_[False, truth[1:] != truth[:-1]]) > 0
        counted = apart & crossed
        total += int(counted.sum())
        for method, answer in zip(wrong, (single, nearest, theirs, ours), strict=True):
            wrong[method] += int((answer != truth)[counted].sum())
    print(
        f"\n{name}: {total} frames of {tracks} tracks, {spent / frames_count * 1e6:.1f} us a frame"
    )
    for method, count in wrong.items():
        print(f"  {method:<24}{100 * count / max(total, 1):>7.2f} % wrong")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracks", type=int, default=200)
    tracks = parser.parse_args().tracks
    speed()
    folded = scene_of(FOLDED)
    for noise in (2e-5, 1e-4):
        settings = TrackingSettings(observables="w2", rate_sd=0.5, outlier=1e-6, visit_s=1e4)
        model = tracker(sensor_of(noise), folded, settings)
        through_the_fold(f"w2 alone, noise {noise:g}", model, folded, tracks, float(np.log(FOLD_M)))
    scene = parse_scene(
        {
            "object": {"c0": 0.0769, "c1": -0.123, "c2": 0.03},
            "background": {
                "strength": 0.0176838825658,
                "distance_m": 3.0,
                "shadow": {"c0": 0.056137, "c1": -0.02829},
            },
            "range_m": {"prior": "loguniform", "low": 0.3, "high": 1.5},
        }
    )
    for noise in (1e-6, 5e-6):
        sensor = parse_sensor(
            {
                "kind": "pulsed",
                "pulse_width_s": 1e-7,
                "noise": {"read": [1e-3, 1e-3], "derivative": [noise, 10 * noise]},
            }
        )
        settings = TrackingSettings(
            observables="derivatives", rate_sd=0.5, outlier=1e-6, visit_s=1e4
        )
        model = tracker(sensor, scene, settings)
        through_the_fold(
            f"derivatives, noise {noise:g} and {10 * noise:g} a second",
            model,
            scene,
            tracks,
            float(np.log(0.715308)),
        )
    settings = TrackingSettings(rate_sd=0.5, outlier=1e-6, visit_s=1e4)
    model = tracker(sensor_of(1e-4), folded, settings)
    both_windows(model, folded, tracks)


def both_windows(model: Tracker, scene: Any, tracks: int) -> None:
    """Count frames in which the tracker is further than six deviations off."""
    terms = parameters_of(model.sensor, scene).terms(np.zeros((1, 0)))
    rng = np.random.default_rng(3)
    total = wrong = 0
    for _ in range(tracks):
        side = rng.choice([-1.0, 1.0])
        while True:
            first = (np.log(FOLD_M) + 0.2 * side, -0.4 * side)
            u, _ = wander(rng, 150, model.settings, first, SECONDS)
            if u.min() > model.model.table.start + 0.1 and u.max() < model.model.table.end - 0.1:
                break
        means = mean_readings(model.sensor, terms, np.exp(u))
        readings = means + np.asarray(model.sensor.noise.read) * rng.standard_normal(means.shape)
        _, result = step(model, model.first, frames_of(readings, SECONDS))
        off = np.abs(np.log(result.best_m) - u) / (result.best_sd_m / result.best_m)
        total += off.size
        wrong += int((~(off < 6.5)).sum())
    print(f"\nboth windows: {wrong} of {total} frames more than 6.5 standard deviations off")


if __name__ == "__main__":
    main()
