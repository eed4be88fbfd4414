"""One case of the round trip: readings of a random scene through every root that comes back."""

import dataclasses
import itertools
import warnings

import numpy as np
from numpy.typing import NDArray

from inference.estimate import all_roots, estimate
from inference.estimates import TechniqueResult
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from tests.realtime import reference
from tests.realtime.reference import Case

__all__ = ["VARIANTS", "Verdict", "check", "request"]

EPSILON = float(np.finfo(float).eps)

VARIANTS = [
    (technique, pulsed)
    for technique in (
        "conventional",
        "intensity",
        "intensity_w1",
        "differential",
        "background_cancelling",
        "background_intensity",
        "background_cancelling_differential",
    )
    for pulsed in (True, False)
    if pulsed or technique != "intensity_w1"
]


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Outcome of one case."""

    count: int
    reference_count: int
    excused: bool
    error: float  # of the roots, in units of the allowance
    truth_error: float  # of the best physical root, in units of the allowance; 0 if rounded away
    filtered: bool  # the physical filter agrees with the reference's

    @property
    def good(self) -> bool:
        """Whether counts agree or may differ, and every error is within its allowance."""
        counted = self.count == self.reference_count or self.excused
        return counted and self.error <= 1 and self.truth_error <= 1 and self.filtered


def request(case: Case, m1: float, m2: float) -> tuple[Sensor, Scene, Frames]:
    """Build the request of a case; noise far below rounding, so that nothing is excused by it."""
    size = max(abs(m1), abs(m2))
    tiny = max(1e-20 * size, 1e-300)
    sensor: dict[str, object] = {
        "gain": case.gain,
        "noise": {"read": [tiny, tiny], "derivative": [tiny, tiny]},
    }
    if case.pulsed:
        sensor |= {"kind": "pulsed", "pulse_width_s": case.timing}
    else:
        sensor |= {
            "kind": "sine_wave",
            "frequency_hz": case.timing,
            "phase_offset_rad": case.offset,
        }
    # the reference filters roots as if the model were exact
    scene: dict[str, object] = {
        "object": {"c0": case.c0, "c1": case.c1, "c2": case.c2},
        "discrepancy": 0,
    }
    if case.has_background:
        scene["background"] = {
            "strength": case.strength,
            "distance_m": case.distance,
            "shadow": {"c0": case.c0s, "c1": case.c1s},
        }
    pair = np.array([[m1, m2]])
    frames = Frames(pair, derivatives=pair if case.differential else None)
    return parse_sensor(sensor), parse_scene(scene), frames


def check(case: Case) -> Verdict:
    """Run one case."""
    m1, m2 = reference.forward(case)
    sensor, scene, frames = request(case, m1, m2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        loose = all_roots(case.technique, sensor, scene, frames)
        strict = estimate(sensor, scene, frames, [case.technique]).results[0]
    expected = reference.reference_roots(case, m1, m2)
    found = loose.roots_m[0, : loose.root_count[0]]
    excused = False
    error = 0.0
    if len(found) != len(expected):
        excused = any(
            len(reference.reference_roots(case, m1 * (1 + a), m2 * (1 + b))) != len(expected)
            for a, b in itertools.product((-4 * EPSILON, 0.0, 4 * EPSILON), repeat=2)
        )
    else:
        for ours, theirs in zip(found, expected, strict=True):
            error = max(error, _units(case, theirs, m1, m2, float(abs(ours / theirs - 1))))
    truth_error = 0.0
    if any(_units(case, r, m1, m2, float(abs(r / case.r - 1))) <= 1 for r in expected):
        physical = strict.roots_m[0, : strict.root_count[0]]
        truth_error = min(
            (_units(case, case.r, m1, m2, abs(r / case.r - 1)) for r in physical),
            default=np.inf,
        )
    return Verdict(
        len(found),
        len(expected),
        excused,
        error,
        truth_error,
        _filters(case, strict, found, m1, m2),
    )


def _units(case: Case, r: object, m1: float, m2: float, error: float) -> float:
    if error <= 1e-9:
        return error / 1e-9
    return error / max(1e-9, 100 * EPSILON * reference.sensitivity(case, r, m1, m2))


def _filters(
    case: Case, strict: TechniqueResult, found: NDArray[np.float64], m1: float, m2: float
) -> bool:
    """Whether the physical filter keeps what it must and drops what it must."""
    kept = strict.roots_m[0, : strict.root_count[0]]
    for r in found:
        allowance = 1e-6 + 1e4 * EPSILON * reference.sensitivity(case, r, m1, m2)
        share = 0.5
        if case.technique == "background_cancelling":
            share = float(reference.implied_background(case, r, m1, m2)) / case.strength
            size = max(abs(m1), abs(m2)) / case.strength
            allowance *= 1 + size
        elif case.has_background:
            share = (r + case.c1s) / r if r + case.c1s < 0 else 0.5
        inside = bool(np.any(np.abs(kept / r - 1) < 1e-12))
        if -allowance < share < allowance or 1 - allowance < share < 1 + allowance:
            continue
        if inside != (0 < share < 1):
            return False
    return True
