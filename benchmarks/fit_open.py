"""What the joint fit of an exact model answers where the frames alone may leave the ranges open.

    python -m benchmarks.fit_open [--sets 40] [--seed 9500] [--decades 4 6] [--kinds ..]
    python -m benchmarks.fit_open --classes far

Random data sets of `tests.fits.random_sets` from a seed on, their signal-to-noise ratio drawn
between two decades. Columns: sets that are refused; those that say misfit; the others, and of
these how many by the priors of the scene; of those answered, frames with one range, how many of
them 90 % intervals and two standard deviations hold, the median standard deviation in parts of the
range, sets with a frame, and with an `identified` unknown, beyond five; and processor time of all.

The class "far" is of an object up to the sensor's reach, behind crosstalk that is known to 3 %
(`tests.fits.random_sets.far_set`): its far frames are dark. There nothing is said of how well the
model holds, the noise is of its own, whatever the decades, and ranges beside a fold do not count.

Resumable: a table a class in `out/fit_open`.
"""

import argparse
import functools
import itertools
import math
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.resumable import Row, code_version, resume, rows_of
from inference.estimate import estimate
from tests.fits.random_sets import CLASSES, far_set, random_set
from tests.fits.scenes import values_of

KINDS = ("pulsed", "sine_wave")
FAR = "far"
COLUMNS = (
    "set", "version", "refused", "priors", "misfit", "frames", "unique", "held90", "held", "width",
    "worst", "identified", "seconds",
)  # fmt: skip
HEAD = (
    f"{'':36}{'sets':>5}{'refused':>8}{'misfit':>7}{'answered':>9}{'priors':>7}{'unique':>9}"
    f"{'in 90 %':>9}{'in 2 sd':>9}{'width':>9}{'> 5 sd':>7}{'unknown':>8}{'median s':>9}{'most':>6}"
)
_OF_90 = 1.6448536269514722
_FAR_SD = 5.0


def row_of(kind: str, name: str, decades: tuple[float, float], first: int, number: int) -> Row:
    """Fit one data set, and say what became of it."""
    if name == FAR:
        one = far_set(kind, first + number)
    else:
        one = random_set(name, kind, first + number, decades=decades)
    frames, truth_m = one.simulation.frames, one.simulation.range_m
    begin = time.process_time()
    found = estimate(one.sensor, one.scene, frames, ["joint_fit"])
    row: dict[str, str | float | int] = {
        "version": code_version(),
        "seconds": time.process_time() - begin,
        "frames": int(np.count_nonzero(frames.present)),
    }
    if not found.results:
        (reason,) = [out.reason for out in found.left_out if out.name == "joint_fit"]
        return {**row, "refused": reason}
    (result,) = found.results
    assert result.fit is not None
    assert result.parameters is not None
    row |= {"priors": int(result.fit["by_priors"]), "misfit": int(result.fit["misfit"])}
    unique = np.isfinite(result.range_m) & np.isfinite(result.sd_m)
    if name == FAR:
        unique &= ~result.near_fold
    off = np.abs(result.range_m - truth_m)[unique] / result.sd_m[unique]
    known = values_of(one.sensor, one.truth)
    sure = [
        abs(entry["value"] - known[path]) / entry["sd"]
        for path, entry in result.parameters.items()
        if entry["status"] == "identified"
    ]
    row |= {
        "unique": int(unique.sum()),
        "held90": int((off < _OF_90).sum()),
        "held": int((off < 2.0).sum()),
        "worst": float(off.max(initial=0.0)),
        "identified": max(sure, default=0.0),
    }
    if off.size:
        row["width"] = float(np.median((result.sd_m / result.range_m)[unique]))
    return row


def line(rows: Sequence[dict[str, str]], name: str) -> str:
    """Return a line of the table."""
    refused = sum(bool(row["refused"]) for row in rows)
    misfit = sum(row["misfit"] == "1" for row in rows)
    rest = [row for row in rows if not row["refused"] and row["misfit"] != "1"]
    counted = ("frames", "unique", "held90", "held")
    frames, unique, held90, held = (sum(int(row[of] or 0) for row in rest) for of in counted)
    widths = [float(row["width"]) for row in rest if row["width"]]
    far, unknown = (
        sum(float(row[of] or 0) > _FAR_SD for row in rest) for of in ("worst", "identified")
    )
    seconds = [float(row["seconds"]) for row in rows] or [math.nan]

    def share(part: int, whole: int) -> str:
        return f"{100 * part / whole:7.1f} %" if whole else f"{'-':>9}"

    width = f"{np.median(widths):9.1e}" if widths else f"{'-':>9}"
    priors = sum(row["priors"] == "1" for row in rest)
    return (
        f"{name:36}{len(rows):5}{refused:8}{misfit:7}{len(rest):9}{priors:7}{share(unique, frames)}"
        f"{share(held90, unique)}{share(held, unique)}{width}{far:7}{unknown:8}"
        f"{np.median(seconds):9.1f}{max(seconds):6.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--seed", type=int, default=9500)
    parser.add_argument("--decades", nargs=2, type=float, default=(4.0, 6.0))
    parser.add_argument("--out", type=Path, default=Path("out/fit_open"))
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=KINDS)
    parser.add_argument("--classes", nargs="*", choices=(*CLASSES, FAR), default=("everything",))
    given = parser.parse_args()
    low, high = given.decades
    print(HEAD)
    for kind, name in itertools.product(given.kinds, given.classes):
        file = f"{kind}_{name.replace(' ', '_')}_{low:g}_{high:g}_{given.seed}.csv"
        work = functools.partial(row_of, kind, name, (low, high), given.seed)
        resume(given.out / file, COLUMNS, range(given.sets), work)
        rows = rows_of(given.out / file)[: given.sets]
        print(line(rows, f"{kind}, {name}"), flush=True)
        told = [row for row in rows if row["priors"] == "1"]
        print(line(told, "  by priors"), flush=True)


if __name__ == "__main__":
    main()
