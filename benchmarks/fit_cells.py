"""The joint fit by sensor, unknowns and signal-to-noise ratio: what is answered, and is it right.

    python -m benchmarks.fit_cells [--sets 20] [--told exact default] [--kinds ..] [--snrs ..]

Random data sets of `tests.fits.random_sets`, of one signal-to-noise ratio a cell (in the middle of
the stroke): told that the model is exact, which it then is; and told nothing of it, where objects
err as the default says. Columns: sets that are refused, and of these how many whose ranges the
truth leaves open by less than a factor of e (Cramer-Rao bound without priors: *needless*); sets
that say misfit; the others, and of these, of an exact model, how many *right*: the same optimum
(deviance within 0.1, or a better one) as a climb from the truth. Of those answered: frames with one
range, how many of them lie within two of their standard deviations, sets of which less than half
do, the median standard deviation in parts of the range, sets with a frame beyond five that is near
no fold; and processor time of all.

Resumable: a table a cell in `out/fit_cells`.
"""

import argparse
import functools
import itertools
import math
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.resumable import Row, code_version, resume, rows_of
from inference.estimate import estimate
from inference.estimates import TechniqueResult
from inference.fits.answer.determined import LIMIT
from inference.fits.likelihood.erring_point import slopes_of_priors
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.maximum import maximum_from
from inference.fits.likelihood.problem import FitProblem, fit_problem
from tests.fits.random_sets import CLASSES, RandomSet, best_of, best_with_priors, random_set
from tests.fits.scenes import values_of

KINDS = ("pulsed", "sine_wave")
SNRS = (1e2, 1e3, 1e4, 1e5, 1e7, 1e9)
TOLD = {"exact": 0, "default": "default"}
COLUMNS = (
    "set", "version", "refused", "alone", "open", "misfit", "excess", "frames", "unique", "held",
    "width", "worst", "seconds",
)  # fmt: skip
_SAME = 0.1
_FAR_SD = 5.0


def bounds_at(
    one: RandomSet, problem: FitProblem, truth: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the common relative standard deviation of the ranges without and with priors."""
    _, facts = residuals_and_information(problem, truth, np.log(one.simulation.range_m))
    rows = np.vstack([facts.jacobian, slopes_of_priors(problem, truth)])
    response = facts.response[problem.present]
    shared = np.linalg.norm(response @ np.linalg.pinv(rows), axis=1)
    return float(np.median(facts.sd_of(response))), float(np.median(shared))


def row_of(told: str, kind: str, name: str, snr: float, number: int) -> Row:
    """Fit one data set, and say what became of it."""
    decade = math.log10(snr)
    one = random_set(name, kind, number, TOLD[told], TOLD[told], (decade, decade))
    frames, truth_m = one.simulation.frames, one.simulation.range_m
    problem = fit_problem(one.sensor, one.scene, frames)
    known = values_of(one.sensor, one.truth)
    truth = problem.coordinates(np.array([[known[path] for path in problem.names]]))[0]
    alone, with_priors = bounds_at(one, problem, truth)
    begin = time.process_time()
    found = estimate(one.sensor, one.scene, frames, ["joint_fit"])
    seconds = time.process_time() - begin
    row: dict[str, str | float | int] = {
        "version": code_version(),
        "alone": alone,
        "open": with_priors,
        "frames": int(problem.present.sum()),
        "seconds": seconds,
    }
    if not found.results:
        (reason,) = [out.reason for out in found.left_out if out.name == "joint_fit"]
        return {**row, "refused": reason}
    (result,) = found.results
    assert result.fit is not None
    row["misfit"] = int(result.fit["misfit"])
    if problem.erring:  # not the best fit is the answer, but the most probable one
        return {**row, **_ranges_of(result, truth_m)}
    if result.fit["by_priors"]:
        reference = best_with_priors(one, problem, truth)
    else:
        reference = maximum_from(problem, truth).deviance
    row["excess"] = best_of(result.fit) - reference
    return {**row, **_ranges_of(result, truth_m)}


def _ranges_of(result: TechniqueResult, truth_m: NDArray[np.float64]) -> Row:
    unique = np.isfinite(result.range_m) & np.isfinite(result.sd_m)
    off = np.abs(result.range_m - truth_m)[unique] / result.sd_m[unique]
    plain = ~result.near_fold[unique]
    told = {"unique": int(unique.sum()), "held": int((off < 2.0).sum())}
    if not off.size:
        return told
    width = float(np.median((result.sd_m / result.range_m)[unique]))
    return {**told, "width": width, "worst": float(off[plain].max(initial=0.0))}


def line(cells: Sequence[Sequence[dict[str, str]]], name: str) -> str:
    """Return a line of the table for rows of one or more cells."""
    rows = [row for cell in cells for row in cell]
    refused = [row for row in rows if row["refused"]]
    needless = sum(float(row["alone"]) < LIMIT for row in refused)
    misfit = sum(row["misfit"] == "1" for row in rows)
    rest = [row for row in rows if not row["refused"] and row["misfit"] != "1"]
    compared = [float(row["excess"]) for row in rest if row["excess"]]
    right = sum(excess <= _SAME for excess in compared)
    less = sum(int(row["held"]) < 0.5 * int(row["unique"]) for row in rest if row["unique"])
    counted = ("frames", "unique", "held")
    frames, unique, held = (sum(int(row[of] or 0) for row in rest) for of in counted)
    widths = [float(row["width"]) for row in rest if row["width"]]
    far = sum(float(row["worst"] or 0) > _FAR_SD for row in rest)
    seconds = [float(row["seconds"]) for row in rows] or [math.nan]

    def share(part: int, whole: int) -> str:
        return f"{100 * part / whole:7.1f} %" if whole else f"{'-':>9}"

    width = f"{np.median(widths):9.1e}" if widths else f"{'-':>9}"
    return (
        f"{name:42}{len(rows):5}{len(refused):8}{needless:9}{misfit:7}{len(rest):9}"
        f"{share(right, len(compared))}{share(unique, frames)}{share(held, unique)}{less:6}{width}"
        f"{far:7}{np.median(seconds):8.2f}{max(seconds):7.1f}"
    )


HEAD = (
    f"{'':42}{'sets':>5}{'refused':>8}{'needless':>9}{'misfit':>7}{'answered':>9}"
    f"{'right':>9}"
    f"{'unique':>9}{'held':>9}{'less':>6}{'width':>9}{'> 5 sd':>7}{'median s':>8}{'most':>7}"
)


def name_of(told: str, kind: str, name: str, snr: float) -> str:
    return f"{told}_{kind}_{name.replace(' ', '_')}_{snr:.0e}.csv"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=20)
    parser.add_argument("--out", type=Path, default=Path("out/fit_cells"))
    parser.add_argument("--told", nargs="*", choices=TOLD, default=list(TOLD))
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=KINDS)
    parser.add_argument("--classes", nargs="*", choices=CLASSES, default=CLASSES)
    parser.add_argument("--snrs", nargs="*", type=float, default=SNRS)
    given = parser.parse_args()
    print(HEAD)
    for told, kind in itertools.product(given.told, given.kinds):
        of_kind = []
        for name in given.classes:
            of_class = []
            for snr in given.snrs:
                path = given.out / name_of(told, kind, name, snr)
                work = functools.partial(row_of, told, kind, name, snr)
                resume(path, COLUMNS, range(given.sets), work)
                of_class.append(rows_of(path)[: given.sets])
                print(line(of_class[-1:], f"{told}, {kind}, {name}, {snr:.0e}"), flush=True)
            print(line(of_class, f"{told}, {kind}, {name}"), flush=True)
            of_kind += of_class
        print(line(of_kind, f"{told}, {kind}"), flush=True)


if __name__ == "__main__":
    main()
