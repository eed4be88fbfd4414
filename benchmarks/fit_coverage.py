"""The fit over all frames of an object of which nothing is known, against exact optics.

    python -m benchmarks.fit_coverage [--sets 40] [--only crosstalk --only background]

Data sets are those of `benchmarks.coverage` (24 frames of a plate or a disk on its way, diffuse or
glossy, a signal-to-noise ratio of 1000). For every class: sets that are refused or say misfit, the
share of ranges within 1.645 standard deviations of the truth, the medians of that interval's width
and of the error, how far the farthest range is off, sets in which less than half is held, and the
processor time of a set.
"""

import argparse
import time

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.classes import CLASSES, draw, told
from inference.estimate import estimate
from simulator.scene import parse_scene

Array = NDArray[np.float64]

_Z = 1.6448536269514722  # of a 90 % interval


def asked(group: str, number: int) -> tuple[str, Array]:
    """Fit a data set.

    Returns
    -------
    (str, ndarray), shape (3, frames)
        What it says, and error over standard deviation, that over the range, and error over the
        range; nan where no range is told, or beside a fold.
    """
    data = draw(CLASSES[group], number)
    found = estimate(data.sensor, parse_scene(told(data, "default")), data.frames, ["joint_fit"])
    if not found.results:
        return "refused", np.full((3, len(data.frames)), np.nan)
    (result,) = found.results
    off = result.range_m - data.range_m
    rows = np.array([off / result.sd_m, result.sd_m / data.range_m, off / data.range_m])
    rows[:, result.near_fold] = np.nan
    misfit = result.fit is not None and result.fit["misfit"]
    return "misfit" if misfit else "told", rows


def line(group: str, sets: int) -> str:
    """Return a class's line of the table."""
    before = time.process_time()
    found = [asked(group, number) for number in range(sets)]
    seconds = (time.process_time() - before) / sets
    said = [word for word, _ in found]
    off, wide, error = np.stack([rows for _, rows in found], axis=1)
    told_of = np.isfinite(off)
    inside = np.where(told_of, np.abs(off) < _Z, False)
    each = inside.sum(axis=1)[told_of.any(axis=1)] / told_of.sum(axis=1)[told_of.any(axis=1)]
    return (
        f"| {group} | {sets} | {said.count('refused')} | {said.count('misfit')} "
        f"| {told_of.mean():.0%} | {inside.sum() / told_of.sum():.0%} "
        f"| {2 * _Z * np.nanmedian(wide):.1%} | {np.nanmedian(np.abs(error)):.1%} "
        f"| {np.nanmax(np.abs(off)):.1f} | {np.count_nonzero(each < 0.5)} | {seconds:.1f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=40, help="of every class")
    parser.add_argument("--only", action="append", choices=sorted(CLASSES), help="left out: all")
    given = parser.parse_args()
    print(
        "| class | sets | refused | misfit | told | held | width | error | farthest [sd] "
        "| sets less than half held | s a set |\n|---|---|---|---|---|---|---|---|---|---|---|"
    )
    for group in given.only or CLASSES:
        print(line(group, given.sets), flush=True)


if __name__ == "__main__":
    main()
