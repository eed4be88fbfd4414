"""What little knowledge does for recorded photons behind unknown crosstalk: a table.

    python -m benchmarks.known_ranges [--seconds 60] [--every 1] [--cells 8]

Crosstalk of 10 and 30 % of the signal at 0.3 m is added to the photons of a plane at 0.1 to 0.4 m;
nothing is known of the object. Told is in turn nothing more; five frames without the object; the
nearest and the farthest distance, by a ruler; and odometry over every fourth position. Ruler and
odometry err as they say. Only positions whose range was told by nothing are counted. Needs
../shared/data/tmf8820_plane.json.
"""

import argparse
import dataclasses
import itertools
import sys

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.recorded import EMPTY, RecordedCell, recorded_frames
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


def told(cell: RecordedCell, what: str, seed: int, every: int, seconds: float) -> str:
    """Infer the ranges of a cell with knowledge; return a row of the table."""
    cell = dataclasses.replace(cell, empty=EMPTY if what == "five empty frames" else 0)
    sensor, scene, frames, truth = recorded_frames(cell, seed)
    chosen = np.flatnonzero(np.isnan(truth) | (np.arange(truth.size) % every == 0))
    frames, truth = frames.select(chosen), truth[chosen]
    frames, free = with_knowledge(what, frames, truth, seed)
    settings = SamplerSettings(ensembles=2, seed=seed, target_ess=200, max_seconds=seconds)
    found = infer(sensor, parse_scene(scene), frames, settings)
    low, middle, high = (getattr(found.range_m, q)[free] for q in ("q05", "q50", "q95"))
    at = truth[free]
    held, width = np.mean((low <= at) & (at <= high)), np.median((high - low) / at)
    error = np.median(np.abs(middle / at - 1))
    (scale,) = (row.status for row in found.identifiability if row.parameter == "range_m")
    where = "housing" if cell.housing else "0.3 m"
    return (
        f"| {cell.kind} | {cell.share:.0%}, {where} | {what} | {held:.0%} | {width:.2%} "
        f"| {error:.2%} | {'yes' if found.fit.misfit else 'no'} | {scale.replace('_', ' ')} "
        f"| {'yes' if found.verdict.converged else 'no'} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="of each posterior")
    parser.add_argument("--every", type=int, default=1, help="use each such position only")
    parser.add_argument("--cells", type=int, default=len(CELLS))
    given = parser.parse_args()
    if not PATH.exists():
        sys.exit(f"no recordings: {PATH} is absent")
    print("| sensor | crosstalk | told | held | width | error | misfit | scale | converged |")
    print("|---|---|---|---|---|---|---|---|---|")
    for (number, cell), what in itertools.product(enumerate(CELLS[: given.cells]), TOLD):
        print(told(cell, what, number, given.every, given.seconds), flush=True)


if __name__ == "__main__":
    main()
