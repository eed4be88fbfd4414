"""Fits over many frames at the ends: order, units, lengths, repetition, noise over 14 decades."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from tests.fits.scenes import KINDS, OBJECT, SIGNAL_AT_1M, VAGUE, WALL, data, path, sensor_of

CROSSTALK = {"object": OBJECT, "crosstalk": [0.002, 0.01]}
STRENGTH = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}
COUNT = 12
TOP = 0.05  # standard deviations: climbs stop at 1e-3 of deviance


class Fit(NamedTuple):
    """A technique, a kind of sensor, what its scene states and what is true."""

    technique: str
    kind: str
    scene: dict[str, Any]
    truth: dict[str, Any]


FITS = [
    Fit("object_fit", "pulsed", {}, {"object": OBJECT}),
    Fit("object_fit", "sine_wave", {"background": WALL}, {"object": OBJECT, "background": WALL}),
    Fit("crosstalk_fit", "pulsed", {"object": OBJECT, "crosstalk": [VAGUE, VAGUE]}, CROSSTALK),
    Fit(
        "shadow_fit",
        "sine_wave",
        {"object": OBJECT, "background": {"strength": 0.0177, "distance_m": 3.0}},
        {"object": OBJECT, "background": WALL},
    ),
    Fit(
        "joint_fit",
        "sine_wave",
        {
            "object": {"c0": OBJECT["c0"], "c1": OBJECT["c1"]},
            "background": {**WALL, "strength": STRENGTH},
        },
        {"object": OBJECT, "background": WALL},
    ),
    Fit("iterative_differential", "pulsed", {"crosstalk": [VAGUE, VAGUE]}, CROSSTALK),
    Fit(
        "iterative_background_cancelling",
        "pulsed",
        {"background": {"strength": STRENGTH, "distance_m": 3.0, "shadow": "object"}},
        {
            "object": {**OBJECT, "c1": 0.05},
            "background": {**WALL, "shadow": "object"},
        },
    ),
]
NAMES = [f"{fit.technique}, {fit.kind}" for fit in FITS]


def frames_of(fit: Fit, sensor: Sensor) -> Frames:
    found = data(sensor, fit.truth, path(COUNT))
    if fit.technique != "crosstalk_fit":
        return found
    return dataclasses.replace(found, time_s=0.05 * np.arange(float(COUNT)))


def answered(fit: Fit, sensor: Sensor, frames: Frames, **scene: Any) -> TechniqueResult | str:
    """Return the result, or the reason of the refusal."""
    document = {"discrepancy": 0, **fit.scene, **scene}
    found = estimate(sensor, parse_scene(document), frames, [fit.technique])
    if found.results:
        return found.results[0]
    return next(item.reason for item in found.left_out if item.name == fit.technique)


def answer(fit: Fit, sensor: Sensor, frames: Frames, **scene: Any) -> TechniqueResult:
    result = answered(fit, sensor, frames, **scene)
    assert not isinstance(result, str), result
    return result


def assert_alike(
    a: TechniqueResult, b: TechniqueResult, rows: NDArray[np.intp], unit: float = 1.0
) -> None:
    assert a.parameters is not None
    assert b.parameters is not None
    for name, item in a.parameters.items():
        in_readings = name.startswith("crosstalk") or name == "background.strength"
        factor = unit if in_readings else 1.0
        other = b.parameters[name]
        assert abs(other["value"] / factor - item["value"]) < TOP * item["sd"], name
        assert other["sd"] / factor == pytest.approx(item["sd"], rel=1e-3), name
    assert (np.abs(a.range_m[rows] - b.range_m) < TOP * a.sd_m[rows]).all()
    np.testing.assert_allclose(a.sd_m[rows], b.sd_m, rtol=1e-3)


@pytest.mark.parametrize("fit", FITS, ids=NAMES)
def test_the_order_of_frames_is_nothing(fit: Fit) -> None:
    sensor = sensor_of(fit.kind, 1e4)
    frames = frames_of(fit, sensor)
    order = np.random.default_rng(0).permutation(COUNT)
    if frames.time_s is not None:  # an object that goes the other way
        order = np.arange(COUNT)[::-1]
    moved = dataclasses.replace(frames.select(order), time_s=frames.time_s)
    assert_alike(answer(fit, sensor, frames), answer(fit, sensor, moved), order)


@pytest.mark.parametrize("fit", [fit for fit in FITS if fit.technique != "crosstalk_fit"])
def test_every_frame_twice_halves_the_variance(fit: Fit) -> None:
    sensor = sensor_of(fit.kind, 1e4)
    frames = frames_of(fit, sensor)
    rows = np.repeat(np.arange(COUNT), 2)
    one, two = answer(fit, sensor, frames), answer(fit, sensor, frames.select(rows))
    assert one.parameters is not None
    assert two.parameters is not None
    for name, item in one.parameters.items():
        assert abs(two.parameters[name]["value"] - item["value"]) < TOP * item["sd"]
        # the sd of a size reaches to the farther end of its interval, which is at z beyond that of
        # its logarithm by a share of z/2 of it: more where it is wider
        bend = 0.5 * 1.645 * item["sd"] / abs(item["value"]) * (1.0 - math.sqrt(0.5))
        assert two.parameters[name]["sd"] * math.sqrt(2) == pytest.approx(
            item["sd"], rel=1e-3 + bend
        )


@pytest.mark.parametrize("fit", FITS, ids=NAMES)
def test_frames_that_tell_nothing_are_refused(fit: Fit) -> None:
    sensor = sensor_of(fit.kind, 1e4)
    frames = frames_of(fit, sensor)
    for rows in (np.zeros(1, np.intp), np.arange(2), np.zeros(COUNT, np.intp)):
        some = frames.select(rows)
        if frames.time_s is not None:
            some = dataclasses.replace(some, time_s=frames.time_s[: len(rows)])
        reason = answered(fit, sensor, some)
        assert isinstance(reason, str)
        assert "need" in reason or "move" in reason


@pytest.mark.parametrize("snr", [1e3, 1e4])
@pytest.mark.parametrize("unit", [3.0, 1e30, 1e-30])
def test_how_far_a_valley_is_walked_does_not_depend_on_the_unit(unit: float, snr: float) -> None:
    """Crosstalk was walked in strides of a power of two: widths changed by up to 1.7."""
    fit = next(fit for fit in FITS if fit.technique == "iterative_differential")
    read = SIGNAL_AT_1M / snr
    frames = frames_of(fit, sensor_of(fit.kind, snr))
    shown = dataclasses.replace(frames, readings=unit * frames.readings)
    sensor = {**KINDS[fit.kind], "gain": unit, "noise": {"read": [unit * read] * 2}}
    vague = {**VAGUE, "sd": VAGUE["sd"] * unit}
    one = answer(fit, sensor_of(fit.kind, snr), frames)
    other = answer(fit, parse_sensor(sensor), shown, crosstalk=[vague, vague])
    assert_alike(one, other, np.arange(COUNT), unit)


@pytest.mark.parametrize("fit", FITS, ids=NAMES)
def test_whatever_the_noise_there_is_a_finite_answer_or_a_reason(fit: Fit) -> None:
    answers = 0
    for snr in (1e-2, 1.0, 1e2, 1e6, 1e9, 1e12):
        sensor = sensor_of(fit.kind, snr)
        result = answered(fit, sensor, frames_of(fit, sensor))
        if isinstance(result, str):
            assert result
            assert snr < 1e6, result
            continue
        answers += 1
        assert result.parameters is not None
        for item in result.parameters.values():
            if item["value"] is None:
                assert item["reason"]
            else:
                assert math.isfinite(item["value"])
                assert item["sd"] > 0
        known = np.isfinite(result.range_m) & np.isfinite(result.sd_m)
        assert (known | (result.reason > 0) | result.near_fold).all()
        assert (result.status[~np.isfinite(result.range_m)] != Status.UNIQUE).all()
        # 12 ranges of 7 fits at 3 noises: six standard deviations, false alarm 5e-7
        if snr >= 1e6:
            truth = np.asarray(path(COUNT).range_m)
            assert (np.abs(result.range_m - truth) < 6 * result.sd_m).all()
    assert answers >= 3
