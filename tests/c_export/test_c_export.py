"""Exported C, compiled with all warnings as errors, against the techniques themselves."""

import ctypes
import json
import math
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status
from inference.realtime.registry import TECHNIQUES
from service.c_export import GENERATORS, c_text, export_c
from service.c_export.flux_curve import FluxCurve, table
from service.c_export.source import Exported
from service.cli import main
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import SineWaveSensor, parse_sensor

Array = NDArray[np.float64]
Answers = Callable[[Array], list[tuple[int, float, float, int]]]
CC = shutil.which("cc")
pytestmark = pytest.mark.skipif(CC is None, reason="no C compiler: install cc")

PULSE = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [2e-5, 1e-3], "shot": 1e-6}}
WAVE = {
    "kind": "sine_wave", "frequency_hz": 2e7, "phase_offset_rad": 0.7,
    "noise": {"read": [3e-3, 2e-3]},
}  # fmt: skip
OBJECT = {"c0": 0.08, "c1": -0.1, "c2": 0.1}
FAR = {"strength": {"prior": "lognormal", "median": 0.01, "sigma": 0.3}, "distance_m": 5.0}
CROSSTALK = [0.004, 0.02]
BEYOND = {"prior": "uniform", "low": 1.0, "high": 7.4}

# technique, sensor, scene; ranges of each lie in what the scene states
CASES: dict[str, tuple[str, Any, Any]] = {
    "pulse": ("conventional", PULSE | {"full_scale": [3.0, 3.0]}, {"crosstalk": CROSSTALK}),
    "wave": ("conventional", WAVE, {"crosstalk": CROSSTALK}),
    # photons of the crosstalk make more noise in q than in i
    "wave behind a bright glass": ("conventional",
                                   WAVE | {"noise": {"read": [1e-3, 1e-3], "shot": 2e-3}},
                                   {"crosstalk": CROSSTALK}),
    "wave beyond 1 m": ("conventional", WAVE, {"crosstalk": CROSSTALK, "range_m": BEYOND}),
    "light": ("intensity", PULSE | {"noise": {"read": [2e-5, 1e-3], "relative": 0.01}},
              {"object": OBJECT, "crosstalk": CROSSTALK}),
    "modulus": ("intensity", WAVE, {"object": OBJECT, "crosstalk": CROSSTALK}),
    "late light": ("intensity_w1", PULSE, {"object": OBJECT, "crosstalk": CROSSTALK}),
    "before a wall": ("background_cancelling", PULSE,
                      {"object": OBJECT, "crosstalk": CROSSTALK, "background": FAR}),
}  # fmt: skip


def compiled(text: str, kind: str, folder: Path) -> Answers:
    """Compile, and return a function of readings, shape (n, 2)."""
    real = {"double": ctypes.c_double, "float": ctypes.c_float}[kind]

    class Answer(ctypes.Structure):
        _fields_ = (
            ("status", ctypes.c_int), ("range_m", real), ("sd_m", real), ("near_fold", ctypes.c_int)
        )  # fmt: skip

    source, library = folder / "range.c", folder / f"range_{kind}.so"
    source.write_text(text)
    flags = ["-DHYBRIDTOF_FLOAT"] if kind == "float" else []
    assert CC is not None
    subprocess.run(
        [CC, "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-ffp-contract=off",
         *flags, "-shared", "-fPIC", "-o", str(library), str(source), "-lm"],
        check=True,
    )  # fmt: skip
    call = ctypes.CDLL(str(library)).hybridtof_range
    call.argtypes = [real, real, ctypes.POINTER(Answer)]

    def answers(readings: Array) -> list[tuple[int, float, float, int]]:
        found, out = [], Answer()
        for first, second in readings.tolist():
            status = call(first, second, ctypes.byref(out))
            assert status == out.status
            found.append((out.status, out.range_m, out.sd_m, out.near_fold))
        return found

    return answers


def readings_at(case: str, ranges: Array, rng: np.random.Generator) -> Array:
    """Readings of an object at these ranges, with crosstalk, a wall's light and noise."""
    technique, sensor, scene = CASES[case]
    world = scene.get("object", OBJECT)
    light = (
        world["c0"] * world["c2"] / (ranges**2 * (ranges**2 + world["c1"] * ranges + world["c0"]))
    )
    if sensor["kind"] == "pulsed":
        r0 = parse_sensor(sensor).max_range_m
        readings = np.column_stack([light * ranges / r0, light])
        if technique == "background_cancelling":
            wall = rng.uniform(0.0, 0.02, ranges.size)
            readings += np.column_stack([wall * 5.0 / r0, wall])
    else:
        angle = 4 * math.pi * 2e7 / 299792458.0 * ranges + 0.7
        readings = np.column_stack([light * np.cos(angle), light * np.sin(angle)])
    noisy = readings + rng.normal(size=readings.shape) * sensor["noise"]["read"] * 0.3
    return np.asarray(noisy + CROSSTALK)


def exported_of(case: str) -> tuple[Exported, str]:
    technique, sensor, scene = CASES[case]
    s, w = parse_sensor(sensor), parse_scene(scene)
    exported = export_c(technique, s, w)
    return exported, c_text(exported, technique, s, w)


@pytest.mark.parametrize("kind", ["double", "float"])
@pytest.mark.parametrize("case", CASES)
def test_ranges_are_within_the_proven_error(case: str, kind: str, tmp_path: Path) -> None:
    technique, sensor, scene = CASES[case]
    exported, text = exported_of(case)
    low, high = exported.limits_m
    rng = np.random.default_rng(3)
    ranges = np.geomspace(max(low, 0.03), min(high, 7.0) * 0.999, 1500)
    junk = rng.normal(size=(300, 2)) * [1e-3, 1e-2]
    odd = [[0.0, 0.0], [5.0, 1.0], [1.0, -5.0], [1e30, 1e30], [-1.0, -1.0]]
    readings = np.concatenate([readings_at(case, ranges, rng), junk, odd])
    if kind == "double":  # where nothing at all is left of a reading
        readings = np.concatenate([readings, [CROSSTALK]])
    else:  # both are given the same readings
        readings = readings.astype(np.float32).astype(np.float64)
    s, w = parse_sensor(sensor), parse_scene(scene)
    (expected,) = estimate(s, w, Frames(readings), [technique]).results
    assert expected.sd_parts_m is not None
    close, answered, compared = 0, 0, 0
    for n, answer in enumerate(compiled(text, kind, tmp_path)(readings)):
        status, range_m, sd_m, near = answer
        root = expected.range_m[n]
        # the export looks between its ends alone, and at them a status may be either
        outside = math.isnan(root) or not low <= root <= high
        if status != (Status.NONE if outside and expected.status[n] != 3 else expected.status[n]):
            edges = [low, high] if not math.isnan(root) else []
            at_an_end = any(abs(root - edge) <= 1e-5 * edge for edge in edges)
            assert at_an_end, (readings[n], root, status, range_m)
            close += 1
            continue
        if outside:
            assert (range_m, sd_m, near) == (0.0, 0.0, 0)
            continue
        answered += 1
        if technique in ("conventional", "background_cancelling"):
            close += bool(near) != expected.near_fold[n]  # within roundings of the band's end
        noise = expected.sd_parts_m.noise[n, 0]
        first, second = readings[n]
        x, y = first - CROSSTALK[0], second - CROSSTALK[1]
        read = sensor["noise"]["read"]
        if math.isnan(noise):  # so faint that the technique states none
            assert sd_m == -1
            noise = root * max(read) / min(abs(x), abs(y))  # of first order it is less
        if technique == "conventional":
            # of first order, as the bound wants it: that of the answer is of the curve
            if isinstance(s, SineWaveSensor):
                noise = math.hypot(y * read[0], x * read[1]) / (x * x + y * y) / s.wave_number
            else:
                noise = min(noise, s.max_range_m / y * math.hypot(read[0], x / y * read[1]))
        allowed = exported.bound.of(kind, root, noise, (first, second))
        # the technique itself is right to roundings of its own
        own = exported.bound.of("double", root, noise, (first, second)) - exported.bound.method
        own += 64 * np.finfo(float).eps * root
        assert abs(range_m - root) <= allowed + own, (readings[n], root, range_m, allowed)
        if math.isfinite(expected.sd_m[n]) and not expected.near_fold[n]:
            # a smooth function of the range, which it moves with; of its ends, where these are far
            # enough, either of which is as wrong as a range is
            end = root + 3.0 * noise < high and root - 3.0 * noise > low
            if sd_m == -1:  # the technique's ranges go on beyond those of the export
                assert root + 3.0 * noise > high
            elif technique == "conventional" or end:
                assert sd_m == pytest.approx(expected.sd_m[n], rel=1e-3, abs=allowed)
                compared += 1
    assert answered > 800
    assert compared > 400
    assert close <= 4


@pytest.mark.parametrize("kind", ["double", "float"])
def test_an_object_beyond_the_reach_of_a_pulse_is_near_a_fold(kind: str, tmp_path: Path) -> None:
    """Its late window holds all light, and noise leaves it a range at the reach in half of frames.

    With a hundred times its noise of light that was a range of 4.5 m with an error of millimetres.
    """
    rng = np.random.default_rng(5)
    _, sensor, scene = CASES["pulse"]
    s, read = parse_sensor(sensor), np.array(sensor["noise"]["read"])
    light = read.max() * np.geomspace(10.0, 2e3, 400)
    reach = 1.0 + 0.02 * rng.normal(size=400)  # of the late window, about all of it
    readings = np.column_stack([np.minimum(reach, 1.0) * light, light]) + CROSSTALK
    readings += rng.normal(size=readings.shape) * read
    if kind == "float":
        readings = readings.astype(np.float32).astype(np.float64)
    (expected,) = estimate(s, parse_scene(scene), Frames(readings), ["conventional"]).results
    found = compiled(exported_of("pulse")[1], kind, tmp_path)(readings)
    counted = 0
    for n, (status, range_m, _, near) in enumerate(found):
        if status == Status.UNIQUE == expected.status[n]:
            assert bool(near) == expected.near_fold[n], (range_m, readings[n])
            counted += near
    assert counted > 50


@pytest.mark.parametrize("kind", ["double", "float"])
def test_what_is_no_number_has_no_range(kind: str, tmp_path: Path) -> None:
    _, text = exported_of("pulse")
    bad = np.array([[math.nan, 1.0], [1.0, math.nan], [math.inf, 1.0], [0.1, -math.inf]])
    answers = compiled(text, kind, tmp_path)(bad)
    assert [status for status, *_ in answers] == [Status.NONE] * 2 + [Status.SATURATED] * 2
    assert all(answer[1:] == (0.0, 0.0, 0) for answer in answers)


def test_the_table_is_within_its_bound_to_30_digits() -> None:
    """Against the inverse in exact arithmetic, at points that the bound has never looked at."""
    curve = FluxCurve(0.0008, 2, 0.08, -0.1, 0.2)
    found = table(curve, 0.02, 5.0, 1e-4)
    assert found is not None
    assert found.relative <= 1e-4
    rng = np.random.default_rng(9)
    worst = 0.0
    with mp.workdps(30):
        for r in np.geomspace(0.0201, 4.99, 4000) * rng.uniform(0.999, 1.001, 4000):
            x = mpf(float(r))
            light = mpf(0.0008) * (1 - x * mpf(0.2)) / (x**2 * (x**2 - mpf(0.1) * x + mpf(0.08)))
            cell = int(np.searchsorted(-found.reading, -float(light)) - 1)
            near, far = (mpf(float(v)) for v in found.range_m[cell : cell + 2])
            top, bottom = (mpf(float(v)) for v in found.reading[cell : cell + 2])
            guess = near + (light - top) * (far - near) / (bottom - top)
            worst = max(worst, float(abs(guess - x)) / float(r))
            assert abs(guess - x) <= found.error_m
    # and it is no idle bound: what occurs comes within a factor of two
    assert 0.5 * found.relative < worst <= found.relative


@pytest.mark.parametrize("c1", [-0.48, -0.3, 0.0, 0.4, 20.0])
@pytest.mark.parametrize(("power", "nearness"), [(1, 0.0), (2, 0.0), (2, 0.2)])
def test_bounds_of_the_slope(c1: float, power: int, nearness: float) -> None:
    """On random intervals the derivative, by differences of 40 digits, lies between its bounds."""
    curve = FluxCurve(1.0, power, 0.08, c1, nearness)
    rng = np.random.default_rng(1)
    low = 10.0 ** rng.uniform(-2, 0.5, 60)
    high = np.minimum(low * (1 + 10.0 ** rng.uniform(-4, 0.3, 60)), 4.99)
    low = np.minimum(low, 0.99 * high)
    least, greatest = curve.falls(low, high)
    with mp.workdps(40):

        def light(r: Any) -> Any:
            q = r**2 + mpf(c1) * r + mpf(0.08)
            return (1 - r * mpf(nearness)) / (r**power * q)

        for k in range(low.size):
            for share in (0.0, 0.3, 0.71, 1.0):
                r = mpf(float(low[k])) + mpf(share) * mpf(float(high[k] - low[k]))
                fall = -float(mp.diff(light, r))
                slack = 1e-12 * abs(fall) + 1e-12 * abs(float(greatest[k]))
                assert least[k] - slack <= fall <= greatest[k] + slack


def test_what_is_not_exported() -> None:
    assert set(GENERATORS) <= set(TECHNIQUES)
    pulse, wave = parse_sensor(PULSE), parse_sensor(WAVE)
    known = parse_scene({"object": OBJECT})
    with pytest.raises(InvalidInputError, match="/technique"):
        export_c("differential", pulse, known)
    exported = export_c("conventional", pulse, known)
    with pytest.raises(InvalidInputError, match="/name"):
        c_text(exported, "conventional", pulse, known, "2x")
    with pytest.raises(InvalidInputError, match="/tolerance"):
        export_c("conventional", pulse, known, tolerance=0.0)
    with pytest.raises(RefusedError, match="object"):
        export_c("intensity", pulse, parse_scene({}))
    folded = parse_scene({"object": OBJECT | {"c1": -0.55}})
    with pytest.raises(RefusedError, match="does not fall everywhere"):
        export_c("intensity", pulse, folded)
    wall = parse_scene({"object": OBJECT, "background": FAR | {"strength": 0.01}})
    with pytest.raises(RefusedError, match="strength as a prior"):
        export_c("background_cancelling", pulse, wall)
    with pytest.raises(RefusedError, match="pulsed"):
        export_c("background_cancelling", wave, parse_scene({"object": OBJECT, "background": FAR}))
    with pytest.raises(RefusedError, match="65536 cells"):
        export_c("intensity_w1", pulse, known, tolerance=1e-9)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, out = tmp_path / "scene.json", tmp_path / "range.c"
    scene.write_text(json.dumps({"sensor": PULSE, "scene": {"crosstalk": CROSSTALK}}))
    arguments = ["export", "c", "--scene", str(scene), "--technique", "conventional"]
    assert main([*arguments, "--name", "lid", "--output", str(out)]) == 0
    text = out.read_text()
    assert "int lid_range(lid_real first, lid_real second, lid_answer *out);" in text
    assert "double: 0 m + 6.66e-16 r" in text
    assert main(arguments) == 0
    assert "hybridtof_range" in capsys.readouterr().out
    assert main([*arguments[:-1], "posterior"]) == 2
    assert "--technique" in capsys.readouterr().err
