"""Frames whose light cannot be are told of in `assumptions`, and their own reason says so."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Estimates
from inference.impossible_light import impossible_light
from inference.realtime.assemble import NEGATIVE
from service.answers.encoding import encode_estimates
from service.cli import main
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

Array = NDArray[np.float64]
Numbers = dict[str, Any]

READ = (1e-4, 2e-4)
PULSE: Numbers = {"kind": "pulsed", "pulse_width_s": 1e-8, "noise": {"read": list(READ)}}
R0 = 299792458.0 * 1e-8 / 2
CROSSTALK = (0.004, 0.05)
RANGES = np.linspace(0.2, 0.6, 30)


def pulse(r: Array, share: Array | None = None) -> Array:
    """Late window and whole of an object at ranges r."""
    whole = 0.05 * 0.1 / (r * r * (r * r - 0.08 * r + 0.05))
    return np.column_stack([whole * (r / R0 if share is None else share), whole])


def drawn(rng: np.random.Generator, light: Array) -> Array:
    readings: Array = light + np.array(CROSSTALK) + READ * rng.standard_normal(light.shape)
    return readings


def asked(readings: Array, crosstalk: Any = CROSSTALK, **more: Any) -> Estimates:
    scene = parse_scene({"crosstalk": list(crosstalk)})
    return estimate(parse_sensor(PULSE), scene, Frames(readings, **more))


def said(readings: Array, scene: Numbers, sensor: Numbers = PULSE, **more: Any) -> str | None:
    return impossible_light(parse_scene(scene), parse_sensor(sensor), Frames(readings, **more))


def over(readings: Array, crosstalk: Any) -> tuple[list[int], list[int], list[int]]:
    """The frames of each kind, frame by frame, at 6 of the read noise; the model is off 0.8 mm."""
    found: tuple[list[int], list[int], list[int]] = ([], [], [])
    for n, (first, second) in enumerate(readings - np.array(crosstalk)):
        moved = 8e-4 / R0 * second
        found[0].extend([n] * bool(-first > 6 * np.hypot(READ[0], moved)))
        found[1].extend([n] * bool(-second > 6 * READ[1]))
        found[2].extend([n] * bool(first - second > 6 * np.hypot(np.hypot(*READ), moved)))
    return found


def test_windows_and_crosstalk_in_another_order() -> None:
    """Half of such frames are sure and far off: the answer begins with the others."""
    y = drawn(np.random.default_rng(8), pulse(RANGES))
    assert asked(y).assumptions == ()
    swapped = CROSSTALK[::-1]
    early = np.column_stack([y[:, 1] - y[:, 0], y[:, 1]])
    for readings, crosstalk in ((y, swapped), (early, CROSSTALK), (-y, CROSSTALK)):
        answer = asked(readings, crosstalk)
        told = answer.assumptions[0]
        kinds = over(readings, crosstalk)
        every = set().union(*kinds)
        assert f"impossible in {len(every)} of 30 frames" in told
        for kind, frames in zip(("w1 below", "w2 below", "w1 above"), kinds, strict=True):
            assert (kind in told) == bool(frames)
            if frames:
                assert f"in {len(frames)} (first frame {frames[0]}, by up to" in told
        assert "the order of the windows" in told
        assert json.loads(encode_estimates(answer))["assumptions"][0] == told
        result = answer.results[0]
        for n in every:
            reason = result.reasons[result.reason[n]]
            assert reason == NEGATIVE or "w1 is above w2 by far more than noise" in reason


def test_units_and_signs_of_crosstalk() -> None:
    """Of a tenth of a volt that was typed as a hundred millivolts nothing is left."""
    y = drawn(np.random.default_rng(9), pulse(RANGES))
    assert "in 30 of 30 frames" in asked(y, (4.0, 50.0)).assumptions[0]
    # of the other sign light is too much, and nothing is impossible that a frame could tell
    assert not asked(y, (-0.004, -0.05)).assumptions


def test_frames_without_light_are_no_mistake() -> None:
    """400 requests of 500 dark frames each: 1e-6 of each may be doubted."""
    rng = np.random.default_rng(10)
    photons = PULSE | {"noise": {"read": list(READ), "shot": 1e-5}}
    for _ in range(400):
        dark = drawn(rng, np.zeros((500, 2)))
        assert said(dark, {"crosstalk": list(CROSSTALK)}) is None
        late = np.sqrt(1e-5 * CROSSTALK[0]) * rng.standard_normal(500)
        rest = np.sqrt(1e-5 * (CROSSTALK[1] - CROSSTALK[0])) * rng.standard_normal(500)
        shot = dark + np.column_stack([late, late + rest])
        assert said(shot, {"crosstalk": list(CROSSTALK)}, photons) is None


def test_one_frame_is_counted_beyond_what_chance_gives_many() -> None:
    """Of 10 frames 6 standard deviations are impossible, of 200,000 7.2."""
    for n, limit in ((10, 6.0), (200_000, 7.25)):
        readings = np.tile([0.1, 0.3], (n, 1))
        for share, doubted in ((0.98, False), (1.02, True)):
            readings[3] = [0.1, -share * limit * READ[1]]
            # w1 is above w2 as well
            readings[3, 0] = -share * limit * READ[0]
            told = said(readings, {"discrepancy": 0})
            assert (told is not None) == doubted
            if told:
                assert f"in 1 of {n} frames" in told
                assert "w1 below zero in 1 (first frame 3, by up to " in told


def test_a_prior_of_the_crosstalk_counts_as_noise() -> None:
    """Crosstalk three standard deviations of its prior away lies within it, swapped it does not."""
    y = drawn(np.random.default_rng(11), pulse(RANGES))
    away = [{"prior": "normal", "mean": m + 3 * 0.002, "sd": 0.002} for m in CROSSTALK]
    dark = drawn(np.random.default_rng(15), np.zeros((30, 2)))
    assert said(y, {"crosstalk": away}) is said(dark, {"crosstalk": away}) is None
    assert said(dark, {"crosstalk": [law["mean"] for law in away]}) is not None
    # a joint law in its place, of a lognormal law with long tails
    long = {"prior": "lognormal", "median": 0.02, "sigma": 1.0}
    mode = {"weight": 1.0, "mean": [0.0], "covariance": [[1.0]]}
    law = {"unknowns": ["crosstalk.w2"], "modes": [mode]}
    joint = {"crosstalk": [CROSSTALK[0], long], "joint": law}
    assert said(dark + np.array([0.0, 0.02 * np.exp(-4.0) - 0.05]), joint) is None
    mode["covariance"] = [[1e-4]]
    assert "w2 below zero" in str(said(dark - np.array([0.0, 0.05]), joint))
    sharp = [{"prior": "normal", "mean": m, "sd": 0.002} for m in CROSSTALK[::-1]]
    assert "w1 below zero" in str(said(y, {"crosstalk": sharp}))
    assert said(y, {"crosstalk": {"optional": True, "values": [0.05, 0.004]}}) is None


def test_what_is_not_counted() -> None:
    """Saturated and empty frames, light that comes too early or too late, and sine waves."""
    y = drawn(np.random.default_rng(12), pulse(RANGES))
    y[4] = [-1.0, -1.0]
    assert said(y, {"crosstalk": list(CROSSTALK)}) is not None
    clipped = PULSE | {"full_scale": [1.0, 1.0]}
    assert said(np.clip(y, -1, 1), {"crosstalk": list(CROSSTALK)}, clipped) is None
    present = np.arange(30) != 4
    scene = {"crosstalk": list(CROSSTALK)}
    assert said(y, scene, object_present=present) is None
    wave = {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": list(READ)}}
    assert said(-y, scene, wave) is None
    # all of the light is late, or none: 0 <= w1 <= w2 whatever the delay
    for share in (0.0, 1.0):
        ends = drawn(np.random.default_rng(13), pulse(RANGES, np.full(30, share)))
        for offset in (-3e-9, 3e-9):
            assert said(ends, scene, PULSE | {"timing_offset_s": offset}) is None
        warm = PULSE | {"temperature": {"reference_k": 293.0, "delay_drift_s_per_k": 1e-10}}
        assert said(ends, scene, warm, temperature_k=np.linspace(263, 323, 30)) is None


def test_a_wall_only_adds_light() -> None:
    """Light of a wall is late, too, and never more than all of it."""
    r = RANGES
    wall = 0.02 * (1 - 0.04 / (r * r + 0.02 * r + 0.04))
    y = drawn(np.random.default_rng(14), pulse(r) + wall[:, None] * np.array([1.2 / R0, 1.0]))
    background = {"strength": 0.02, "distance_m": 1.2, "shadow": {"c0": 0.04, "c1": 0.02}}
    scene = {"crosstalk": list(CROSSTALK), "background": background}
    assert said(y, scene) is None
    swapped = scene | {"crosstalk": list(CROSSTALK[::-1])}
    answer = estimate(
        parse_sensor(PULSE), parse_scene(swapped), Frames(y), ["background_intensity"]
    )
    assert "impossible in" in answer.assumptions[0]
    result = answer.results[0]
    dark = y[:, 0] - CROSSTALK[1] < -50 * READ[0]
    assert dark.sum() > 5
    assert {result.reasons[k] for k in result.reason[dark]} == {NEGATIVE}


@pytest.mark.parametrize("near", [False, True])
def test_at_contact_the_error_of_the_distance_counts(near: bool) -> None:
    """Light of 3,000 noises 1.6 mm nearer than contact: two standard deviations of the model."""
    whole = 3000 * READ[1]
    late = whole * (-1.6e-3 if near else -6e-3) / R0
    y = np.tile([late, whole], (3, 1))
    assert (said(y, {}) is None) == near
    result = estimate(parse_sensor(PULSE), parse_scene({}), Frames(y)).results[0]
    reason = result.reasons[result.reason[0]]
    assert ("at or near contact" in reason) == near
    assert (reason == NEGATIVE) != near


def test_the_command_says_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    y = drawn(np.random.default_rng(8), pulse(RANGES))
    (tmp_path / "frames.json").write_text(
        json.dumps({"w1": y[:, 0].tolist(), "w2": y[:, 1].tolist()})
    )
    (tmp_path / "scene.json").write_text(
        json.dumps({"sensor": PULSE, "scene": {"crosstalk": list(CROSSTALK[::-1])}})
    )
    main(["estimate", str(tmp_path / "frames.json"), "--scene", str(tmp_path / "scene.json")])
    assert "note: light is impossible in 15 of 30 frames" in capsys.readouterr().err
