"""Intervals of real-time techniques and of the tracker against exact optics, objects known.

    python -m benchmarks.realtime_coverage [--sets 6]

Surfaces and strokes are those of `benchmarks.coverage` (bare plates and disks, diffuse and glossy,
square-on and tilted; pulses and sine waves by turns; signal-to-noise ratio 1000). The object is
known as a calibration knows it: c0, c1, c2 fitted to its exact light at 40 log-spaced distances
from 0.1 to 2.4 m. Frames are 0.1 s apart. For every class: the share of ranges within 1.645
standard deviations of the truth, of how many frames, and the median width of that interval over
the range, by default and with `"discrepancy": 0`. Frames that are ambiguous or beside a fold are
left out.
"""

import argparse
import zlib
from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.calibrated_object import calibrated_object
from benchmarks.coverage.classes import CLASSES, FRAMES, DataSet, SceneClass, draw, surface
from inference.estimate import estimate
from inference.tracking.track import track
from simulator.frames import Frames
from simulator.scene import parse_scene

Array = NDArray[np.float64]

TECHNIQUES = ("conventional", "intensity", "intensity_w1", "differential", "tracker")
SCENES = {"default": "default", "0": 0}
_Z = 1.6448536269514722  # of a 90 % interval


def calibrated(group: SceneClass, number: int) -> dict[str, float] | None:
    """Return c0, c1, c2 of a data set's surface; None where its light does not determine them."""
    rng = np.random.default_rng([zlib.crc32(group.slug.encode()), number])
    _, plate, radius = surface(group, rng)
    return calibrated_object(plate, radius)


def misses(data: DataSet, known: dict[str, float], name: str, discrepancy: object) -> Array:
    """Return errors over sd, and sd over range, shape (2, frames); nan where nothing is told."""
    scene = parse_scene(
        {
            "object": known,
            "range_m": {"prior": "reference", "low": 0.02, "high": 14.9},
            "discrepancy": discrepancy,
        }
    )
    frames = Frames(data.frames.readings, time_s=0.1 * np.arange(FRAMES, dtype=np.float64))
    if name == "tracker":
        found = track(data.sensor, scene, frames)
        range_m, sd_m = found.range_m, found.sd_m
    else:
        served = estimate(data.sensor, scene, frames, [name]).results
        if not served:
            return np.full((2, FRAMES), np.nan)
        range_m, sd_m = served[0].range_m, served[0].sd_m
    return np.array([(range_m - data.range_m) / sd_m, sd_m / data.range_m])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=6)
    sets = parser.parse_args().sets
    groups = [g for g in CLASSES.values() if not (g.crosstalk or g.background)]
    pooled: dict[tuple[str, str], list[Array]] = defaultdict(list)
    head = " | ".join(f"{name}, {scene}" for name in TECHNIQUES for scene in SCENES)
    print(f"| class | {head} |\n|{'---|' * (1 + len(TECHNIQUES) * len(SCENES))}")
    for group in groups:
        rows: dict[tuple[str, str], list[Array]] = defaultdict(list)
        for number in range(sets):
            known = calibrated(group, number)
            if known is None:
                continue
            data = draw(group, number)
            for name in TECHNIQUES:
                for scene, discrepancy in SCENES.items():
                    rows[name, scene].append(misses(data, known, name, discrepancy))
        for key, found in rows.items():
            pooled[key] += found
        print(f"| {group.name} | {_cells(rows)} |", flush=True)
    print(f"| all | {_cells(pooled)} |")


def _cells(rows: dict[tuple[str, str], list[Array]]) -> str:
    cells = []
    for name in TECHNIQUES:
        for scene in SCENES:
            z, width = np.concatenate(rows[name, scene], axis=1)
            told = np.isfinite(z)
            if not told.any():
                cells.append("-")
                continue
            held, wide = np.mean(np.abs(z[told]) < _Z), 2 * _Z * np.median(width[told])
            cells.append(f"{held:.0%} of {told.mean():.0%}, {wide:.1%}")
    return " | ".join(cells)


if __name__ == "__main__":
    main()
