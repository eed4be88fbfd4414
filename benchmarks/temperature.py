"""Sensors that warm up: do intervals of unknown temperature coefficients hold the truth?

    python -m benchmarks.temperature [--sets 24] [--table PATH] [--seconds 30]

Readings are exactly the model's. Object and drifts of gain and delay are drawn from the
priors that inference has, for a sine wave of 20 MHz and a pulse of 20 ns in turn; twelve frames lie
between 0.3 and 1.5 m and between 20 and 50 degrees, in no common order. Told is in turn four of the
ranges, by a ruler of a millimetre; five frames without the object, where crosstalk is unknown as
well; and both. Sets that are in the table are not done again: an interrupted run goes on.
"""

import argparse
import dataclasses
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.resumable import Row, code_version, resume, rows_of
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["COLUMNS", "KINDS", "TOLD", "cell_of", "row_of", "said"]

RULER_M = 1e-3
FRAMES, EMPTY = 12, 5
_NOISE = {"read": [1e-4, 1e-4]}  # of the median object's 0.01 at 1 m
_DRIFTS = {
    "gain_drift_per_k": {"prior": "normal", "mean": -0.002, "sd": 0.002},
    "delay_drift_s_per_k": {"prior": "normal", "mean": 0.0, "sd": 2e-11},
}
SENSORS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 2e-8},
    "sine wave": {"kind": "sine_wave", "frequency_hz": 2e7},
}
KINDS = tuple(SENSORS)
TOLD = ("known ranges", "empty frames", "known ranges and empty frames")
_CROSSTALK = [{"prior": "normal", "mean": 0.0, "sd": 0.01}] * 2
_NAMES = ("sensor.temperature.gain_drift_per_k", "sensor.temperature.delay_drift_s_per_k")
COLUMNS = ("set", "commit", "sensor", "told", "converged", "misfit", "gain_held", "delay_held",
            "gain_sd", "delay_sd", "gain", "delay", "ranges_held", "ranges")  # fmt: skip


def cell_of(number: int) -> tuple[str, str]:
    """Return sensor and what is told of a set: all cells come in turn."""
    return KINDS[number % len(KINDS)], TOLD[number // len(KINDS) % len(TOLD)]


def row_of(number: int, settings: SamplerSettings) -> Row:
    """Draw a scene and a sensor, simulate frames, infer both back: a line of the table."""
    kind, told = cell_of(number)
    empty = EMPTY if "empty" in told else 0
    document: dict[str, Any] = {"discrepancy": 0}
    if empty:
        document["crosstalk"] = _CROSSTALK
    sensor = parse_sensor(SENSORS[kind] | {"noise": _NOISE, "temperature": _DRIFTS})
    scene = parse_scene(document)
    rng = np.random.default_rng((20261123, number))
    ranges = np.geomspace(0.3, 1.5, FRAMES)
    kelvin = rng.permutation(np.linspace(293.15, 323.15, FRAMES + empty))
    path = SampledTrajectory(
        range_m=[*ranges.tolist(), *[1.0] * empty],
        time_s=[0.1 * k for k in range(FRAMES + empty)],
        temperature_k=kelvin.tolist(),
        object_present=[True] * FRAMES + [False] * empty,
    )
    made = simulate(sensor, scene, path, number)
    frames, free = made.frames, np.isfinite(made.range_m)
    if "known" in told:
        known = np.full(FRAMES + empty, np.nan)
        at = rng.permutation(FRAMES)[:4]
        known[at] = ranges[at] + RULER_M * rng.standard_normal(4)
        free[at] = False
        sd = np.full(known.size, RULER_M)
        frames = dataclasses.replace(frames, known_range_m=known, known_range_sd_m=sd)
    found = infer(sensor, scene, frames, settings.model_copy(update={"seed": number}))
    low, high, truth = found.range_m.q05[free], found.range_m.q95[free], made.range_m[free]
    statuses = {each.parameter: each.status for each in found.identifiability}
    row: dict[str, str | int | float] = {
        "commit": code_version(),
        "sensor": kind,
        "told": told,
        "converged": int(found.verdict.converged),
        "misfit": int(bool(found.fit.misfit)),
        "ranges_held": int(np.count_nonzero((low <= truth) & (truth <= high))),
        "ranges": int(free.sum()),
    }
    for short, name in zip(("gain", "delay"), _NAMES, strict=True):
        of = found.parameters[name]
        row[f"{short}_held"] = int(of.q05 <= made.parameters[name] <= of.q95)
        row[f"{short}_sd"], row[short] = of.sd, statuses[name]
    return row


def said(kind: str, told: str, rows: list[dict[str, str]]) -> str:
    """Return a line of what is printed."""
    every = [row for row in rows if (row["sensor"], row["told"]) == (kind, told)]
    good = [row for row in every if row["converged"] == "1"]
    cells = [kind, told, f"{len(good)} of {len(every)}"]
    for short in ("gain", "delay"):
        held = sum(int(row[f"{short}_held"]) for row in good)
        sd = np.median([float(row[f"{short}_sd"]) for row in good]) if good else np.nan
        known = sum(row[short] == "identified" for row in good)
        cells += [f"{held}", f"{sd:.2g}", f"{known}"]
    held, count = (sum(int(row[name]) for row in good) for name in ("ranges_held", "ranges"))
    cells += [f"{held / max(count, 1):.0%} of {count}", f"{sum(int(r['misfit']) for r in good)}"]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--sets", type=int, default=24)
    parser.add_argument("--table", type=Path, help="goes on in it; left out, one of its own")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each posterior")
    given = parser.parse_args()
    settings = SamplerSettings(
        method="auto", ensembles=2, target_ess=100, max_seconds=given.seconds
    )
    table = given.table or Path(tempfile.mkdtemp()) / "temperature.csv"
    resume(table, COLUMNS, range(given.sets), lambda number: row_of(number, settings))
    rows = rows_of(table)
    print("| sensor | told | converged | gain held | sd [1/K] | identified | delay held | sd [s/K] "
          "| identified | ranges held | misfit |")  # fmt: skip
    print("|---" * 11 + "|")
    for told in TOLD:
        for kind in KINDS:
            print(said(kind, told, rows))
    good = [row for row in rows if row["converged"] == "1"]
    for short in ("gain", "delay"):
        held = sum(int(row[f"{short}_held"]) for row in good)
        error = (0.9 * 0.1 / max(len(good), 1)) ** 0.5
        print(f"{short}: {held} of {len(good)} held, 90 % +- {error:.0%} expected")


if __name__ == "__main__":
    main()
