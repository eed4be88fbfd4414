"""Tracks of a known object whose crosstalk is learnt on the way: what they hold, how many are lost.

    python -m benchmarks.learnt_crosstalk [--tracks 16] [--wide]

Paths swing smoothly between two ranges, at about the stated rate. Cells differ in read noise, in
the farthest range, and in how far the crosstalk is unknown: from one read noise to 4,000. A track
is lost where any frame that is called unique lies more than five standard deviations off.

With ``--wide`` priors are half-normal laws far wider than the light: 2 and 10 times that of the
object at 1 m of the early window, five times as much of the late one, the crosstalk 0.3 and 1.5. A
track is lost where it is silently beyond four standard deviations in three frames or more.
"""

import argparse
import itertools

import numpy as np
from numpy.typing import NDArray

from inference.tracking.settings import TrackingSettings
from inference.tracking.track import step
from inference.tracking.tracker import tracker
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import PulsedSensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

Array = NDArray[np.float64]

C0, C1, C2 = 0.0769, -0.123, 0.0957
FRAMES, STEP_S, NEAREST_M, RATE = 300, 0.02, 0.2, 0.3
SETTINGS = TrackingSettings(visit_s=1e5, absence_s=1e5, rate_sd=RATE)
NOISES = (8e-4, 8e-5, 8e-6)
FARTHEST_M = (0.6, 1.0, 1.5, 3.0)
UNKNOWN_BY = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
WIDE_NOISES, WIDE_SD = (1e-2, 3e-3, 1e-3), (2.0, 10.0)
WIDE_FRAMES, WIDE_STEP_S, WIDE_CROSSTALK = 300, 0.05, (0.3, 1.5)


def path(rng: np.random.Generator, farthest: float) -> Array:
    """Swing between two ranges at about the rate that is stated."""
    low, high = np.log(1.1 * NEAREST_M), np.log(0.95 * farthest)
    half = 0.5 * (high - low) * rng.uniform(0.3, 1.0)
    middle = rng.uniform(low + half, high - half)
    speed = RATE / half * rng.uniform(0.5, 1.2)
    angle = speed * STEP_S * np.arange(FRAMES) + rng.uniform(0.0, 2.0 * np.pi)
    return np.asarray(np.exp(middle + half * np.sin(angle)))


def spread(sensor: PulsedSensor, noise: float, unknown_by: float, farthest: float) -> float:
    """Return the largest spread of log r by the crosstalk, of ranges that noise alone tells."""
    u = np.linspace(np.log(NEAREST_M), np.log(farthest), 400)
    flux = np.array([object_flux(r, C0 * C2, C0, C1) for r in np.exp(u)])
    light = np.column_stack([flux * np.exp(u) / sensor.r0, flux]) / noise
    slope = np.linalg.norm(np.gradient(light, u, axis=0), axis=1)
    told = slope > 10.0
    return float(np.hypot(1.0, unknown_by / noise) / slope[told].min()) if told.any() else 0.0


def cell(
    noise: float, farthest: float, unknown_by: float, discrepancy: float | str, tracks: int
) -> tuple[int, list[float], list[float]] | None:
    """Track; return how many are lost, what their intervals hold, and the worst of each."""
    read = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [noise, noise]}}
    sensor = parse_sensor(read)
    assert isinstance(sensor, PulsedSensor)
    if unknown_by < noise or not 0.1 < spread(sensor, noise, unknown_by, farthest) < 1.2:
        return None
    known = {"object": {"c0": C0, "c1": C1, "c2": C2}, "discrepancy": discrepancy}
    prior = {"prior": "normal", "mean": 0.0, "sd": unknown_by}
    law = {"prior": "loguniform", "low": NEAREST_M, "high": farthest}
    model = tracker(
        sensor, parse_scene(known | {"crosstalk": [prior, prior], "range_m": law}), SETTINGS
    )
    held, worst = [], []
    for seed in range(tracks):
        rng = np.random.default_rng(seed)
        r = path(rng, farthest)
        crosstalk = (unknown_by * rng.standard_normal(2)).tolist()
        truth = parse_scene({"object": known["object"], "crosstalk": crosstalk, "discrepancy": 0})
        trajectory = SampledTrajectory(
            range_m=r.tolist(), time_s=(STEP_S * np.arange(FRAMES)).tolist()
        )
        frames = simulate(sensor, truth, trajectory, rng).frames
        _, found = step(model, model.first, frames)
        unique = np.isfinite(found.range_m)
        z = np.abs((found.range_m - r)[unique] / found.sd_m[unique])
        held.append(float(np.mean(z < 1.645)) if z.size else np.nan)
        worst.append(float(z.max(initial=0.0)))
    return sum(w > 5.0 for w in worst), held, worst


def wide_path(motion: str, rng: np.random.Generator) -> Array:
    """Swing by an e-fold in five seconds or in twenty, or rest and then come near."""
    time = WIDE_STEP_S * np.arange(WIDE_FRAMES)
    if motion == "rests":
        way = np.sin(0.2 * np.pi * np.maximum(time - 5.0, 0.0)) ** 2
        return np.asarray(1.2 * np.exp(-0.9 * way * rng.uniform(0.5, 1.0)))
    period = 5.0 if motion == "swings" else 20.0
    angle = 2.0 * np.pi * time / period + rng.uniform(0.0, 2.0 * np.pi)
    return np.asarray(0.5 * np.exp(0.5 * np.sin(angle)))


def wide_cell(
    discrepancy: float | str, noise: float, sd: float, motion: str, tracks: int
) -> tuple[int, int, float]:
    """Track; return how many are lost, how many say misfit in most frames, and what is held."""
    read = {"kind": "pulsed", "pulse_width_s": 3e-8, "noise": {"read": [noise, noise]}}
    sensor = parse_sensor(read)
    known = {"object": {"c0": C0, "c1": C1, "c2": (1.0 + C1 + C0) / C0}}
    prior = [{"prior": "halfnormal", "sd": sd * part} for part in (1.0, 5.0)]
    scene = parse_scene(known | {"crosstalk": prior, "discrepancy": discrepancy})
    truth = parse_scene(known | {"crosstalk": list(WIDE_CROSSTALK), "discrepancy": 0})
    model = tracker(sensor, scene)
    lost, misfits, held = 0, 0, []
    for seed in range(tracks):
        rng = np.random.default_rng(seed)
        r = wide_path(motion, rng)
        time = WIDE_STEP_S * np.arange(WIDE_FRAMES)
        trajectory = SampledTrajectory(range_m=r.tolist(), time_s=time.tolist())
        _, found = step(model, model.first, simulate(sensor, truth, trajectory, rng).frames)
        told = np.isfinite(found.range_m) & ~found.misfit & (found.outlier < 0.5)
        z = np.abs(found.range_m - r)[told] / found.sd_m[told]
        lost += int(np.sum(z > 4.0) >= 3)
        misfits += int(found.misfit.mean() > 0.5)
        held.append(float(np.mean(z < 1.645)) if z.size else np.nan)
    return lost, misfits, float(np.nanmean(held))


def wide(tracks: int) -> None:
    """Print cells of wide priors."""
    print("discrepancy  read noise  sd of the prior  motion  held of 90 %  lost  misfit")
    total = np.zeros(3, dtype=int)
    discrepancies: tuple[float | str, ...] = (0.0, "default")
    motions = ("swings", "slowly", "rests")
    for case in itertools.product(discrepancies, WIDE_NOISES, WIDE_SD, motions):
        lost, misfits, held = wide_cell(*case, tracks)
        total += (lost, misfits, tracks)
        discrepancy, noise, sd, motion = case
        print(
            f"{discrepancy!s:>11}  {noise:10.0e}  {sd:15.0f}  {motion:>6}  {held:12.0%}  {lost:4d}"
            f"  {misfits:6d}"
        )
    print(f"{total[0]} of {total[2]} tracks lost, {total[1]} say misfit")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tracks", type=int, default=16, help="a cell")
    parser.add_argument("--wide", action="store_true", help="priors far wider than the light")
    args = parser.parse_args()
    if args.wide:
        wide(args.tracks)
        return
    lost = tracks = 0
    print("discrepancy  read noise  farthest  unknown by  held of 90 %  lost  worst")
    discrepancies: tuple[float | str, ...] = (0.0, "default")
    cells = itertools.product(discrepancies, NOISES, FARTHEST_M, UNKNOWN_BY)
    for discrepancy, noise, farthest, unknown_by in cells:
        found = cell(noise, farthest, unknown_by, discrepancy, args.tracks)
        if found is None:
            continue
        bad, held, worst = found
        lost, tracks = lost + bad, tracks + len(held)
        print(
            f"{discrepancy!s:>11}  {noise:10.0e}  {farthest:6.1f} m  {unknown_by / noise:8.1f} x"
            f"  {np.nanmean(held):12.0%}  {bad:4d}  {max(worst):5.1f}"
        )
    print(f"{lost} of {tracks} tracks lost")


if __name__ == "__main__":
    main()
