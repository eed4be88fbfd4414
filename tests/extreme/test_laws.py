"""What must hold to the last bit: units of readings, order, batches; and nothing is silent."""

import dataclasses
import itertools

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import TechniqueResult
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.extreme.certified import FAMILIES, Extreme, extremes

COLUMNS = ("status", "roots_m", "roots_sd_m", "root_count", "near_fold", "reason")


def answers(e: Extreme, readings: np.ndarray, unit: float = 1.0) -> TechniqueResult:
    noise = {"read": [1e-6 * unit * e.strength] * 2}
    kind = {"kind": "pulsed", "pulse_width_s": e.pulse_width_s, "gain": e.gain * unit}
    scaled = dataclasses.replace(e, strength=e.strength * unit)
    document = {**scaled.document, "discrepancy": "default"}
    frames = Frames(readings * unit)
    if "differential" in e.technique:
        noise["derivative"] = noise["read"]
        time_s = np.arange(float(len(readings)))
        frames = Frames(np.ones_like(readings), time_s=time_s, derivatives=readings * unit)
    sensor = parse_sensor(kind | {"noise": noise})
    scene = parse_scene(document)
    (result,) = estimate(sensor, scene, frames, [e.technique]).results
    return result


def same(a: TechniqueResult, b: TechniqueResult, rows: object = slice(None)) -> None:
    for name in COLUMNS:
        x, y = getattr(a, name)[rows], getattr(b, name)
        lost = np.full(len(y), np.nan)
        if x.ndim == 2:  # as many columns as the batch needs
            width = max(x.shape[1], y.shape[1])
            x, y = (np.column_stack([z, *[lost] * (width - z.shape[1])]) for z in (x, y))
        assert np.array_equal(x, y, equal_nan=x.dtype.kind == "f"), name


def cases(technique: str, n: int) -> list[tuple[Extreme, np.ndarray]]:
    rng = np.random.default_rng(4)
    found = []
    for e in itertools.islice(extremes(technique, rng), n):
        high = e.distance if technique.startswith("background") else e.sensor.r0
        ranges = high * 10.0 ** rng.uniform(-3, -0.01, 9)
        readings = np.concatenate([e.readings(ranges), np.zeros((1, 2)), [[-1.0, 5e-324]]])
        found.append((e, readings))
    return found


@pytest.mark.parametrize("technique", FAMILIES)
def test_a_batch_is_a_loop_in_any_order(technique: str) -> None:
    for e, readings in cases(technique, 12):
        whole = answers(e, readings)
        order = np.random.default_rng(1).permutation(len(readings))
        same(whole, answers(e, readings[order]), order)
        for n in (0, 4, len(readings) - 1):
            same(whole, answers(e, readings[n : n + 1]), slice(n, n + 1))


@pytest.mark.parametrize("technique", FAMILIES)
def test_no_bit_depends_on_the_unit_of_the_readings(technique: str) -> None:
    """Powers of two: nothing is rounded differently."""
    for e, readings in cases(technique, 12):
        readings[-1] = [-1.0, 1.0]  # what is subnormal is rounded by a change of its unit
        found = answers(e, readings)
        for unit in (2.0**-60, 2.0**40):
            same(found, answers(e, readings, unit))


@pytest.mark.parametrize("technique", FAMILIES)
def test_nothing_without_a_number_is_silent(technique: str) -> None:
    """Whatever a frame has not, it has a reason: no nan alone, no warning (warnings are errors)."""
    for e, readings in cases(technique, 12):
        result = answers(e, readings)
        assert np.isfinite(result.roots_m[:, 0])[result.root_count > 0].all()
        assert (result.reason[result.status != 0] > 0).all()
        unknown = (result.status == 0) & ~np.isfinite(result.roots_sd_m[:, 0])
        assert (result.near_fold | (result.reason > 0))[unknown].all()
