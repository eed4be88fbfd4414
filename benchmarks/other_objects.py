"""Tracks of objects that differ from the one that is stated, and what `discrepancy.flux` does.

    python -m benchmarks.other_objects [--tracks 300] [--seed S] [--wall 1.0]

Each track, of 12 s at 25 Hz, is of an object whose c0 and c2 are those that are stated times two
lognormal factors: hands of all sizes, ground of all kinds. It rests, goes to and fro, approaches,
or jumps between two ranges every four seconds, from 0.08 to 1.6 m; pulses of 30 ns and waves of
20 MHz by turns, signal-to-noise ratios at 1 m of 30 to 3000, stated objects with a c0 of 0.003 to
10,000 m2 (ground that fills the view). The crosstalk is known, and so is a wall 3 m away, if one is
asked for, in units of the object's light at 1 m; the object's shadow is its own.

A line a spread of the factors (in log) and `discrepancy.flux`: frames with one range, frames that
are sure and more than five standard deviations off (no misfit, no outlier), tracks with more than
two such, tracks that say misfit, 90 % intervals that hold, and the median relative sd.
"""

import argparse
import secrets
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.tracking.track import track
from simulator.frames import Frames
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["frames_off", "random_visit"]

Array = NDArray[np.float64]

KINDS: tuple[dict[str, Any], ...] = (
    {"kind": "pulsed", "pulse_width_s": 3e-8},
    {"kind": "sine_wave", "frequency_hz": 2e7},
)
STEP_S, COUNT = 0.04, 300
SPREADS = (0.0, 0.1, 0.3, 0.5)
FLUXES = (None, 0.3, 0.5, 0.7)
FAR, WALL_M = 5.0, 3.0


def _path(rng: np.random.Generator) -> Array:
    t = STEP_S * np.arange(COUNT)
    near, far = np.exp(np.sort(rng.uniform(np.log(0.08), np.log(1.6), 2))).tolist()
    paths = (
        np.full(COUNT, far),
        np.sqrt(near * far) * (far / near) ** (0.5 * np.sin(2 * np.pi * t / 6)),
        far * (near / far) ** (t / t[-1]),
        np.where((t // 4) % 2, far, near),
    )
    return np.asarray(paths[int(rng.integers(4))])


def random_visit(
    rng: np.random.Generator, kind: dict[str, Any], spread: float, wall: float = 0.0
) -> Any:
    """Draw a track: the sensor, what is stated of the scene, the frames and their ranges.

    Parameters
    ----------
    rng : Generator
        Draws the track.
    kind : dict
        Of the sensor.
    spread : float
        Standard deviation of the logs of both factors [1].
    wall : float
        Strength of a wall in units of the object's light at 1 m; none where it is 0.
    """
    c0 = float(10.0 ** rng.uniform(-2.5, 4.0))
    c1 = 2.0 * c0**0.5 * float(np.expm1(rng.normal(0.0, 0.3))) if c0 < 10.0 else 0.0
    if wall > 0.0:  # a shadow allows no range below -c1
        c1 = abs(c1)
    stated = {"c0": c0, "c1": c1, "c2": 0.1}
    size, brightness = np.exp(spread * rng.standard_normal(2)).tolist()
    other = {"c0": c0 * size, "c1": c1 * size**0.5, "c2": 0.1 * brightness}
    light = object_flux(1.0, 0.1 * c0, c0, c1)
    noise = light / float(10.0 ** rng.uniform(1.5, 3.5))
    sensor = parse_sensor({**kind, "noise": {"read": [noise, noise]}})
    crosstalk = np.abs(noise * rng.normal(0.0, 50.0, 2)).tolist()
    r = _path(rng)
    known: dict[str, Any] = {"crosstalk": crosstalk}
    if wall > 0.0:
        known["background"] = {"strength": wall * light, "distance_m": WALL_M, "shadow": "object"}
    truth = parse_scene({"object": other, "discrepancy": 0, **known})
    path = SampledTrajectory(range_m=r.tolist(), time_s=(STEP_S * np.arange(COUNT)).tolist())
    frames: Frames = simulate(sensor, truth, path, rng).frames
    return sensor, {"object": stated, **known}, frames, r


def frames_off(visit: Any, flux: float | None) -> tuple[Array, Array, bool]:
    """Track; return how far ranges are off [sd], their relative sd, and whether misfit was said.

    Parameters
    ----------
    visit : tuple
        Of `random_visit`.
    flux : float, optional
        `discrepancy.flux`; left out, the scene's default.
    """
    sensor, stated, frames, r = visit
    if flux is not None:
        error = {"flux": flux, "range_m": 0.0008}
        # before a wall its default has to be said again
        if "background" in stated:
            error["shadow"] = 0.2
        stated = {**stated, "discrepancy": error}
    found = track(sensor, parse_scene(stated), frames)
    sure = ~found.misfit & (found.outlier < 0.5)
    off = np.where(sure, (found.range_m - r) / found.sd_m, np.nan)
    return off, found.sd_m / found.range_m, bool(found.misfit.any())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracks", type=int, default=300)
    parser.add_argument("--seed", type=int, help="left out: a fresh one")
    parser.add_argument("--wall", type=float, default=0.0, help="a wall, in the object's light")
    arguments = parser.parse_args()
    seed = secrets.randbits(31) if arguments.seed is None else arguments.seed
    print(f"seed {seed}, {arguments.tracks} tracks each")
    print("| spread | flux | one range | sure and far off | such tracks | misfit | hold | sd |")
    print("|---|---|---|---|---|---|---|---|")
    for spread in SPREADS:
        for flux in FLUXES:
            told = []
            for number in range(arguments.tracks):
                rng = np.random.default_rng([seed, number])
                visit = random_visit(rng, KINDS[number % 2], spread, arguments.wall)
                told.append(frames_off(visit, flux))
            off = np.abs(np.array([each[0] for each in told]))
            one = np.isfinite(off)
            far = np.count_nonzero(off > FAR, axis=1)
            print(
                f"| {spread} | {'default' if flux is None else flux} | {one.mean():.1%} "
                f"| {far.sum() / off.size:.2%} | {np.count_nonzero(far > 2)} "
                f"| {sum(each[2] for each in told)} | {np.mean(off[one] < 1.645):.1%} "
                f"| {np.nanmedian([each[1] for each in told]):.2%} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
