"""What little knowledge does for exact optics behind unknown crosstalk: a table.

    python -m benchmarks.little_knowledge [--sets 50] [--only odometry] [--first-order]

Plates and disks, diffuse or glossy, square-on or tilted, of `benchmarks.coverage.classes`: 24
frames over a stroke, SNR 1000 in its middle, pulses and sine waves by turns. Crosstalk is 10 or
30 % of the signal there, at an angle of its own; known is that it is no larger than that signal,
and nothing of the object. Told is in turn nothing more; five frames without the object; the
nearest and the farthest distance, by a ruler; and odometry over every fourth position. Ruler and
odometry err as they say (`benchmarks.known_ranges`, which does the same to recorded photons). Only
frames whose range was told by nothing are counted.

Columns: share of 90 % intervals that hold the truth, their width over the range (median, and what
nine sets of ten stay below), median error, sets that say misfit or not identified or have not
converged, what the others hold, and how many of these are more than 5 standard deviations off in
some frame. Resumable: a table for each in `out/little_knowledge`. With `--first-order` nothing is
inferred: how far each range is missed at the truth, where everything is linear
(`benchmarks.recorded_bounds`), which takes a third of a second a set.
"""

import argparse
import dataclasses
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.classes import SNR, SceneClass, draw
from benchmarks.known_ranges import TOLD, with_knowledge
from benchmarks.recorded_bounds import Truth, beyond, fitted_object
from benchmarks.resumable import Row, code_version, resume, rows_of
from benchmarks.sampling import sample
from inference.posterior.sampling.verdict import MAX_R_HAT
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor

__all__ = ["SHARES", "Case", "case_of", "line", "row_of"]

GROUP = SceneClass("known ranges")
SHARES = (0.1, 0.3)
EMPTY = 5
OUT = Path("out/little_knowledge")
COLUMNS = ("set", "scene", "version", "held", "frames", "width", "error", "worst", "says")
_NORMAL_90 = 1.6449  # half the width of a normal law's 90 % interval, in standard deviations
_FAR_SD = 5.0


@dataclasses.dataclass(frozen=True, eq=False)
class Case:
    """Frames behind crosstalk, what is stated of them, and the truth.

    Attributes
    ----------
    name : str
        Of the surface.
    sensor, scene, frames : Sensor, dict, Frames
        What is stated and read.
    range_m : ndarray, shape (n,)
        True effective distances [m]; nan of a frame without object.
    asked : ndarray of bool, shape (n,)
        Frames of which no range was told.
    """

    name: str
    sensor: Sensor
    scene: dict[str, Any]
    frames: Frames
    range_m: NDArray[np.float64]
    asked: NDArray[np.bool_]


def case_of(what: str, number: int) -> Case:
    """Return data set `number` with the knowledge that is named in `TOLD`."""
    data = draw(GROUP, number)
    rng = np.random.default_rng([7, number])
    noise = float(data.sensor.noise.read[0])
    signal = noise * SNR
    angle = rng.uniform(0.0, np.pi / 2 if data.sensor.kind == "pulsed" else 2 * np.pi)
    size = SHARES[(number // 2) % len(SHARES)] * signal
    crosstalk = size * np.array([np.cos(angle), np.sin(angle)])
    readings, truth = data.frames.readings + crosstalk, data.range_m
    present: NDArray[np.bool_] | None = None
    if what == "five empty frames":
        dark = crosstalk + noise * rng.standard_normal((EMPTY, 2))
        readings = np.concatenate([dark, readings])
        truth = np.concatenate([np.full(EMPTY, np.nan), truth])
        present = np.isfinite(truth)
    frames, asked = with_knowledge(what, Frames(readings, object_present=present), truth, number)
    law = {"prior": "halfnormal", "sd": signal}
    if data.sensor.kind != "pulsed":
        law = {"prior": "normal", "mean": 0.0, "sd": signal}
    return Case(data.name, data.sensor, {"crosstalk": [law, law]}, frames, truth, asked)


def row_of(what: str, number: int, version: str = "") -> Row:
    """Infer the ranges of a data set; return its line of the table."""
    case = case_of(what, number)
    settings = SamplerSettings(ensembles=2, seed=number, target_ess=200)
    scene = parse_scene(case.scene)
    found = sample(case.sensor, scene, case.frames, settings, every_gate=False)
    said = found.posterior
    done = found.ess is not None and found.rhat is not None and found.rhat <= MAX_R_HAT
    low, middle, high = (getattr(said.range_m, q)[case.asked] for q in ("q05", "q50", "q95"))
    truth = case.range_m[case.asked]
    (scale,) = (row.status for row in said.identifiability if row.parameter == "range_m")
    doubts = (
        ("misfit", said.fit.misfit),
        ("not converged", not done),
        ("not identified", scale == "not_identified"),
    )
    return {
        "scene": case.name,
        "version": version,
        "held": int(np.sum((low <= truth) & (truth <= high))),
        "frames": truth.size,
        "width": float(np.median((high - low) / truth)),
        "error": float(np.median(np.abs(middle / truth - 1))),
        "worst": float(np.max(np.abs(middle - truth) / (high - low)) * 2 * _NORMAL_90),
        "says": "; ".join(name for name, said_so in doubts if said_so),
    }


def line(what: str, rows: Sequence[dict[str, str]]) -> str:
    """Return a line of the table over data sets."""

    def numbers(column: str, of: Sequence[dict[str, str]]) -> NDArray[np.float64]:
        return np.array([float(row[column]) for row in of])

    silent = [row for row in rows if not row["says"]]
    held = numbers("held", rows).sum() / numbers("frames", rows).sum()
    alone = numbers("held", silent).sum() / max(numbers("frames", silent).sum(), 1.0)
    widths = numbers("width", rows)
    far = int(np.sum(numbers("worst", silent) > _FAR_SD))
    return (
        f"| {what} | {len(rows)} | {held:.0%} | {np.median(widths):.2%} "
        f"| {np.quantile(widths, 0.9):.1%} | {np.median(numbers('error', rows)):.2%} "
        f"| {len(rows) - len(silent)} | {alone:.0%} | {far} |"
    )


def missed(what: str, number: int) -> NDArray[np.float64]:
    """Return by how many standard deviations ranges of a data set are missed, to first order."""
    case, clean = case_of(what, number), draw(GROUP, number).frames.readings
    pulsed = case.sensor.kind == "pulsed"
    light = clean[:, 1] if pulsed else np.hypot(*clean.T)
    there = np.isfinite(case.range_m)
    crosstalk = (case.frames.readings[there] - clean)[0].tolist()
    at = fitted_object(light / case.sensor.known_gain, case.range_m[there])
    at |= dict(zip([f"crosstalk.{name}" for name in case.sensor.columns], crosstalk, strict=True))
    return beyond(Truth(case.sensor, case.scene, case.range_m, at), case.frames)[case.asked]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=50, help="0: read the tables")
    parser.add_argument("--only", action="append", choices=TOLD)
    parser.add_argument("--first-order", action="store_true")
    given = parser.parse_args()
    version, chosen = code_version(), given.only or TOLD
    if given.first_order:
        print("| told | sets | held | sets of which none is held | farthest, in sd |")
        print("|---" * 5 + "|")
        for what in chosen:
            off = [np.abs(missed(what, number)) for number in range(given.sets)]
            held = np.array([float((each < _NORMAL_90).mean()) for each in off])
            far = max(float(each.max()) for each in off)
            print(f"| {what} | {held.size} | {held.mean():.0%} | {(held == 0).sum()} | {far:.1f} |")
        return
    tables = {what: OUT / f"{what.replace(' ', '-')}.csv" for what in chosen}
    for number in range(given.sets):  # every kind first, so that any time tells
        for what, table in tables.items():
            work = functools.partial(row_of, what, version=version)
            resume(table, COLUMNS, range(number + 1), work)
    print("| told | sets | held | width | nine of ten below | error | in doubt | others | far |")
    print("|---" * 9 + "|")
    for what, table in tables.items():
        if rows := rows_of(table):
            print(line(what, rows))


if __name__ == "__main__":
    main()
