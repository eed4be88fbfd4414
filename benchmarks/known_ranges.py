"""What little knowledge does for recorded photons behind unknown crosstalk: a table.

    python -m benchmarks.known_ranges [--seconds 60] [--every 1] [--cells 8] [--bounds]

Crosstalk of 10 and 30 % of the signal at 0.3 m is added to the photons of a plane at 0.1 to 0.4 m;
nothing is known of the object. Told is in turn nothing more; five frames without the object; the
nearest and the farthest distance, by a ruler; and odometry over every fourth position. Ruler and
odometry err as they say. Only positions whose range was told by nothing are counted. Beside the
width stand two bounds on it, to first order at the truth (`benchmarks.recorded_bounds`): with
errors of the model as they stand by default, and as large as those of this recording are.
`--bounds` prints these alone, and how large the recording's are. Needs
../shared/data/tmf8820_plane.json.
"""

import argparse
import dataclasses
import itertools
import sys

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.recorded import EMPTY, RecordedCell, recorded_frames
from benchmarks.recorded_bounds import Truth, demanded, fitted_object, widths
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from tests.recorded.experiment import PATH

__all__ = ["CELLS", "TOLD", "told", "with_knowledge"]

RULER_M = 5e-4
ODOMETRY_M = 3e-4
_STRIDE = 4  # positions from one that odometry tells to the next
CELLS = tuple(
    RecordedCell(kind, 0.1, share, housing, 0)
    for housing in (True, False)
    for share in (0.1, 0.3)
    for kind in ("pulsed", "sine wave")
)
TOLD = ("two distances", "odometry", "five empty frames", "nothing")


def with_knowledge(
    what: str, frames: Frames, truth: NDArray[np.float64], seed: int
) -> tuple[Frames, NDArray[np.bool_]]:
    """Tell ranges of frames; return them, and of which frames nothing was told."""
    rng, free = np.random.default_rng(seed), np.isfinite(truth)
    if what == "two distances":
        ends = [int(np.nanargmin(truth)), int(np.nanargmax(truth))]
        known = np.full(truth.size, np.nan)
        known[ends] = truth[ends] + RULER_M * rng.standard_normal(2)
        free[ends] = False
        sd = np.full(truth.size, RULER_M)
        return dataclasses.replace(frames, known_range_m=known, known_range_sd_m=sd), free
    if what == "odometry":
        some = np.arange(0, truth.size, _STRIDE)
        moved = np.full(truth.size, np.nan)
        error = ODOMETRY_M * rng.standard_normal(some.size)
        moved[some] = truth[some] - truth[0] + error
        free[some] = False
        sd = np.full(truth.size, ODOMETRY_M)
        return dataclasses.replace(frames, displacement_m=moved, displacement_sd_m=sd), free
    return frames, free


def truth_of(cell: RecordedCell, seed: int, every: int) -> tuple[Truth, Frames]:
    """Return a cell's truth, its object as it explains the light best, and its frames."""
    sensor, scene, frames, range_m = recorded_frames(cell, seed)
    *_, clean, _ = recorded_frames(dataclasses.replace(cell, share=0.0), seed)
    chosen = np.flatnonzero(np.isnan(range_m) | (np.arange(range_m.size) % every == 0))
    frames, clean, range_m = frames.select(chosen), clean.select(chosen), range_m[chosen]
    there = np.isfinite(range_m)
    pulsed = cell.kind == "pulsed"
    light = clean.readings[there, 1] if pulsed else np.hypot(*clean.readings[there].T)
    crosstalk = (frames.readings - clean.readings)[0].tolist()
    names = ("crosstalk.w1", "crosstalk.w2") if pulsed else ("crosstalk.i", "crosstalk.q")
    fitted = fitted_object(light / sensor.known_gain, range_m[there])
    at = fitted | dict(zip(names, crosstalk, strict=True))
    return Truth(sensor, scene, range_m, at), frames


def bounds(truth: Truth, frames: Frames, free: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Return median bounds on the width, and the size of the recording's errors for the second."""
    times = demanded(truth, frames)
    first, second = (float(np.median(widths(truth, frames, size)[free])) for size in (1.0, times))
    return first, second, times


def told(cell: RecordedCell, what: str, seed: int, every: int, seconds: float) -> str:
    """Infer the ranges of a cell with knowledge; return a row of the table.

    Where there are no seconds to infer anything, the row has the bounds alone.
    """
    cell = dataclasses.replace(cell, empty=EMPTY if what == "five empty frames" else 0)
    known, frames = truth_of(cell, seed, every)
    sensor, scene, truth, _ = known
    frames, free = with_knowledge(what, frames, truth, seed)
    by_default, own, times = bounds(known, frames, free)
    where = "housing" if cell.housing else "0.3 m"
    name = f"| {cell.kind} | {cell.share:.0%}, {where} | {what} "
    bound = f"| {by_default:.2%} | {own:.2%} |"
    if not seconds:
        return f"{name}{bound} {times:.1f} |"
    settings = SamplerSettings(ensembles=2, seed=seed, target_ess=200, max_seconds=seconds)
    found = infer(sensor, parse_scene(scene), frames, settings)
    low, middle, high = (getattr(found.range_m, q)[free] for q in ("q05", "q50", "q95"))
    at = truth[free]
    held, width = np.mean((low <= at) & (at <= high)), np.median((high - low) / at)
    error = np.median(np.abs(middle / at - 1))
    (scale,) = (row.status for row in found.identifiability if row.parameter == "range_m")
    return (
        f"{name}| {held:.0%} | {width:.2%} {bound} "
        f"{error:.2%} | {'yes' if found.fit.misfit else 'no'} | {scale.replace('_', ' ')} "
        f"| {'yes' if found.verdict.converged else 'no'} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="of each posterior")
    parser.add_argument("--every", type=int, default=1, help="use each such position only")
    parser.add_argument("--cells", type=int, default=len(CELLS))
    parser.add_argument("--bounds", action="store_true", help="the bounds alone")
    given = parser.parse_args()
    if not PATH.exists():
        sys.exit(f"no recordings: {PATH} is absent")
    names = "| sensor | crosstalk | told | "
    names += "" if given.bounds else "held | width | "
    names += "bound, default errors | bound, own errors | "
    names += "own over default |" if given.bounds else "error | misfit | scale | converged |"
    print(names)
    print("|---" * (names.count("|") - 1) + "|")
    seconds = 0.0 if given.bounds else given.seconds
    for (number, cell), what in itertools.product(enumerate(CELLS[: given.cells]), TOLD):
        print(told(cell, what, number, given.every, seconds), flush=True)


if __name__ == "__main__":
    main()
