"""Sensors that are not calibrated: what a posterior learns of their offset, and if it is right.

    python -m benchmarks.uncalibrated [--sets 8] [--seconds 60] [--told "two distances"]

Readings are exactly the model's. Object and the sensor's offset are drawn from the priors that
inference has: a phase of 0.1 rad of a sine wave of 20 MHz, a timing of 0.3 ns of a pulse of 20 ns.
Told is in turn nothing more than the readings; the nearest and the farthest distance, by a ruler
of a millimetre; and these with five frames without the object, where crosstalk is unknown as well.
Only ranges that were told by nothing are counted.
"""

import argparse
import dataclasses
import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["KINDS", "TOLD", "Outcome", "outcome_of"]

Flags = NDArray[np.bool_]

RULER_M = 1e-3
FRAMES, EMPTY = 12, 5
NEAR_M, FAR_M = 0.3, 1.5
_NOISE = {"read": [1e-4, 1e-4]}  # of the median object's 0.01 at 1 m
SENSORS: dict[str, dict[str, Any]] = {
    "pulsed": {
        "kind": "pulsed",
        "pulse_width_s": 2e-8,
        "timing_offset_s": {"prior": "normal", "mean": 0.0, "sd": 3e-10},
        "noise": _NOISE,
    },
    "sine wave": {
        "kind": "sine_wave",
        "frequency_hz": 2e7,
        "phase_offset_rad": {"prior": "normal", "mean": 0.0, "sd": 0.1},
        "noise": _NOISE,
    },
}
KINDS = tuple(SENSORS)
TOLD = ("nothing", "two distances", "two distances, empty frames, crosstalk unknown")
_CROSSTALK = [{"prior": "normal", "mean": 0.0, "sd": 0.01}] * 2


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What came of one set of frames.

    Attributes
    ----------
    converged, misfit : bool
        The verdicts.
    offset : str
        Status of the sensor's offset.
    parameters, ranges : ndarray of bool
        Which 90 % intervals hold the truth: of all unknowns, and of the ranges that nothing told.
    width_m : float
        Median width of those of the ranges.
    """

    converged: bool
    misfit: bool
    offset: str
    parameters: Flags
    ranges: Flags
    width_m: float


def outcome_of(kind: str, told: str, seed: int, settings: SamplerSettings) -> Outcome:
    """Draw a scene and a sensor, simulate frames, infer both back."""
    crosstalk = "crosstalk" in told
    document: dict[str, Any] = {"discrepancy": 0}
    if crosstalk:
        document["crosstalk"] = _CROSSTALK
    sensor, scene = parse_sensor(SENSORS[kind]), parse_scene(document)
    ranges = np.geomspace(NEAR_M, FAR_M, FRAMES)
    empty = EMPTY if crosstalk else 0
    path = SampledTrajectory(
        range_m=[*ranges.tolist(), *[1.0] * empty],
        time_s=[0.1 * k for k in range(FRAMES + empty)],
        object_present=[True] * FRAMES + [False] * empty,
    )
    made = simulate(sensor, scene, path, seed)
    frames, free = made.frames, np.isfinite(made.range_m)
    if told != "nothing":
        known = np.full(FRAMES + empty, np.nan)
        ends = [0, FRAMES - 1]
        known[ends] = ranges[ends] + RULER_M * np.random.default_rng(seed).standard_normal(2)
        free[ends] = False
        sd = np.full(known.size, RULER_M)
        frames = dataclasses.replace(frames, known_range_m=known, known_range_sd_m=sd)
    found = infer(sensor, scene, frames, settings.model_copy(update={"seed": seed}))
    low, high = found.range_m.q05[free], found.range_m.q95[free]
    truth = made.range_m[free]
    return Outcome(
        found.verdict.converged,
        bool(found.fit.misfit),
        _status(found),
        np.array([row.q05 <= made.parameters[n] <= row.q95 for n, row in found.parameters.items()]),
        (low <= truth) & (truth <= high),
        float(np.median(high - low)),
    )


def _status(found: Posterior) -> str:
    (status,) = (r.status for r in found.identifiability if r.parameter.startswith("sensor."))
    return status


def _row(kind: str, told: str, outcomes: list[Outcome]) -> str:
    """Return a row of the table."""
    good = [each for each in outcomes if each.converged]
    parameters = np.concatenate([each.parameters for each in good] or [np.empty(0, dtype=bool)])
    ranges = np.concatenate([each.ranges for each in good] or [np.empty(0, dtype=bool)])
    statuses = [each.offset for each in good]
    said = ", ".join(f"{statuses.count(s)} {s.replace('_', ' ')}" for s in sorted(set(statuses)))
    width = np.median([each.width_m for each in good]) if good else np.nan
    return (
        f"| {kind} | {told} | {len(good)} of {len(outcomes)} | {parameters.mean():.0%} of "
        f"{parameters.size} | {ranges.mean():.0%} of {ranges.size} | {1e3 * width:.2g} mm | {said} "
        f"| {sum(each.misfit for each in good)} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sets", type=int, default=8, help="of each row")
    parser.add_argument("--first", type=int, default=0, help="seed of the first set")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each posterior")
    parser.add_argument("--told", choices=TOLD, help="only these rows; left out, all")
    parser.add_argument("--kind", choices=KINDS, help="only this sensor; left out, both")
    given = parser.parse_args()
    settings = SamplerSettings(
        method="auto", ensembles=2, target_ess=100, max_seconds=given.seconds
    )
    print("| sensor | told | converged | parameters held | ranges held | width | offset | misfit |")
    print("|---|---|---|---|---|---|---|---|")
    rows = itertools.product(
        [given.told] if given.told else TOLD, [given.kind] if given.kind else KINDS
    )
    for told, kind in rows:
        seeds = range(given.first, given.first + given.sets)
        print(_row(kind, told, [outcome_of(kind, told, s, settings) for s in seeds]), flush=True)


if __name__ == "__main__":
    main()
