"""Fits over frames whose ranges lie in several turns of phase: which turn each frame is of."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from benchmarks.fit_turns import random_scene
from inference.estimate import estimate
from inference.estimates import Estimates, TechniqueResult
from inference.fits.likelihood import multistart
from inference.fits.likelihood.problem import FitProblem, fit_problem
from inference.fits.likelihood.turns import windows_of
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

Array = NDArray[np.float64]
Numbers = dict[str, Any]

TURN = 299792458.0 / 2 / 2e7  # 7.49 m
SHAPE = (0.5, -0.2, 0.1)
OBJECT = dict(zip(("c0", "c1", "c2"), SHAPE, strict=True))
TO_14 = {"range_m": {"prior": "uniform", "low": 0.3, "high": 14.0}}
WALL = {"distance_m": 15.0, "shadow": {"c0": 0.4, "c1": 0.1}}
CROSSING = np.geomspace(2.0, 13.0, 14)
BEYOND = np.linspace(8.0, 13.5, 14)
FALSE_ALARM = 5.0  # standard deviations: of 200 ranges one in 10,000 times


def light_at(r: Array | float, shape: Sequence[float] = SHAPE) -> Any:
    c0, c1, c2 = shape
    return c0 * c2 / (r * r * (r * r + c1 * r + c0))


def asked(
    truth: Numbers, told: Numbers, r: Array, snr: float, seed: int, errors: object = 0
) -> tuple[Estimates, Frames, float]:
    """Ask for a joint fit; the noise is that of the light in the middle of the path over snr."""
    read = float(light_at(math.sqrt(r.min() * r.max()))) / snr
    sensor = parse_sensor(
        {"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [read, read]}}
    )
    scene = parse_scene({"discrepancy": 0} | truth)
    frames = simulate(sensor, scene, SampledTrajectory(range_m=r.tolist()), seed).frames
    told = TO_14 | {"discrepancy": errors} | told
    return estimate(sensor, parse_scene(told), frames, ["joint_fit"]), frames, read


def result_of(found: Estimates) -> TechniqueResult:
    (result,) = found.results
    assert result.fit is not None
    assert not result.fit["misfit"]
    return result


def roots_off(result: TechniqueResult, r: Array) -> Array:
    """How far the nearest root of each frame is off, in standard deviations."""
    off = np.abs(result.roots_m - r[:, None])
    sd = np.where(np.isnan(result.roots_sd_m), np.inf, result.roots_sd_m)
    return np.asarray(np.nanmin(np.where(np.isnan(result.roots_m), np.nan, off / sd), axis=1))


def scenes(name: str, r: Array) -> tuple[Numbers, Numbers]:
    """Return a truth, and what a fit is told of it."""
    truth: Numbers = {"object": OBJECT}
    told: Numbers = {} if name == "object" else {"object": OBJECT}
    middle = float(light_at(math.sqrt(r.min() * r.max())))
    if name == "crosstalk":
        truth["crosstalk"] = [middle, -0.5 * middle]
        told["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": 3 * middle}] * 2
    if name == "wall":
        strength = {"prior": "lognormal", "median": middle, "sigma": 1.0}
        truth["background"] = WALL | {"strength": 1.5 * middle}
        told["background"] = WALL | {"strength": strength}
    return truth, told


@pytest.mark.parametrize("path", [CROSSING, BEYOND], ids=["crossing", "beyond"])
@pytest.mark.parametrize("name", ["object", "crosstalk", "wall"])
def test_light_tells_the_turn(name: str, path: Array) -> None:
    """Each frame has its range, and one, though its phase is of two: such fits were refused."""
    result = result_of(asked(*scenes(name, path), path, 1e3, 3)[0])
    assert (result.root_count == 1).all()
    assert (roots_off(result, path) < FALSE_ALARM).all()


def test_errors_of_the_model_leave_the_turn_told() -> None:
    """By default the light errs by percents, and two turns differ by twice as much and more."""
    result = result_of(asked(*scenes("object", CROSSING), CROSSING, 1e3, 4, "default")[0])
    assert (result.root_count == 1).all()
    assert (roots_off(result, CROSSING) < FALSE_ALARM).all()


def test_what_light_does_not_tell_stays_open() -> None:
    """The last frame holds as much noise as light: both of its turns explain it."""
    r = np.array([1.0, 1.2, 1.5, 1.9, 2.4, 3.0, 6.5])
    snr = float(light_at(math.sqrt(6.5))) / float(light_at(6.5))
    many = [result_of(asked(*scenes("crosstalk", r), r, snr, seed)[0]) for seed in range(6)]
    assert max(result.root_count[-1] for result in many) > 1
    for result in many:
        assert (result.root_count[:-1] == 1).all()
        assert not roots_off(result, r)[result.root_count > 0].max() > FALSE_ALARM


def _least(frames: Frames, read: float, turns: Sequence[int], r: Array) -> tuple[float, Array]:
    """Fit an object and ranges, each in its own turn, by scipy: deviance and ranges."""
    seen = frames.readings @ np.array([1.0, 1j])
    low = np.maximum(0.3, TURN * np.array(turns))
    high = np.minimum(14.0, TURN * (np.array(turns) + 1.0))
    begin = np.clip(r % TURN + TURN * np.array(turns), low * 1.0001, high * 0.9999)

    def residual(v: Array) -> Array:
        c0, c2, at = math.exp(v[0]), math.exp(v[2]), v[3:]
        shape = (c0, 2 * math.sqrt(c0) * math.expm1(v[1]), c2)
        off = (seen - light_at(at, shape) * np.exp(2j * math.pi * at / TURN)) / read
        return np.concatenate([off.real, off.imag])

    # light that falls with range: c1 >= -1.886 sqrt(c0)
    ends = ([-12.0, -2.8, -12.0, *low], [12.0, 6.0, 12.0, *high])
    best = math.inf, begin
    for size in (0.03, 0.5, 8.0):
        start = [math.log(size), 0.0, math.log(0.1), *begin]
        found = optimize.least_squares(residual, start, bounds=ends, x_scale="jac", max_nfev=100)
        best = min(best, (2 * float(found.cost), found.x[3:]), key=lambda one: one[0])
    return best


@pytest.mark.parametrize(
    ("r", "snr", "seed"),
    [
        (np.array([3.0, 5.0, 8.0, 12.0]), 300.0, 11),
        (np.array([8.5, 9.5, 11.0, 13.0]), 1000.0, 12),
        (np.array([4.0, 9.0, 10.0, 13.0]), 50.0, 13),
    ],
)
def test_all_turns_that_explain_few_frames(r: Array, snr: float, seed: int) -> None:
    """Against a reference that tries all 16 assignments of four frames to turns.

    What explains the frames within two standard deviations of the best is among the answers.
    """
    found, frames, read = asked(*scenes("object", r), r, snr, seed)
    each = [_least(frames, read, turns, r) for turns in itertools.product((0, 1), repeat=4)]
    least = min(deviance for deviance, _ in each)
    if not found.results:  # too open: nothing is told
        return
    result = result_of(found)
    assert result.fit is not None
    assert result.fit["deviance"] < least + 0.1
    for deviance, ranges in each:
        if deviance < least + 4.0:
            off = np.where(result.root_count > 0, roots_off(result, ranges), 0.0)
            assert (off < FALSE_ALARM).all()


def test_an_unknown_object_beyond_the_first_turn_behind_crosstalk() -> None:
    """None of it is known, and no frame is empty."""
    truth, told = scenes("crosstalk", BEYOND)
    del told["object"]
    for seed in range(4):
        result = result_of(asked(truth, told, BEYOND, 3e3, seed)[0])
        assert (roots_off(result, BEYOND) < FALSE_ALARM).all()


@pytest.mark.parametrize("turns", [1.3, 2.0, 3.2, 3.999])
def test_windows_hold_all_ranges(turns: float) -> None:
    """Each is as wide as its turns, none leaves out an end, and neighbours overlap by half."""
    assert windows_of((8.0, 15.0), 7.5) == []
    assert windows_of((8.0, 15.5), 7.5) == []
    low, high = 0.3, 0.3 + 7.5 * turns
    found = windows_of((low, high), 7.5)
    for width in (7.5, 15.0):
        ends = [(a, b) for a, b in found if b - a == pytest.approx(width)]
        if width > high - low - 1e-6:
            assert not ends
            continue
        assert ends[0][0] == low
        assert ends[-1][1] == high
        steps = [b[0] - a[0] for a, b in itertools.pairwise(ends)]
        assert all(0.0 < step < 0.5 * width + 1e-9 for step in steps)
    assert all(a >= low - 1e-9 for a, _ in found)
    assert all(b - a < 15.0 + 1e-9 for a, b in found)


def test_an_object_wholly_beyond_is_found_from_the_last_window() -> None:
    """Its path of 8.4 to 12.5 m is in no window but one that ends where the ranges end.

    The last one began half a turn behind the one before and was less than a turn: a misfit.
    """
    sensor, scene, simulation = random_scene("object+crosstalk", 66, True, True)
    result = result_of(estimate(sensor, scene, simulation.frames, ["joint_fit"]))
    at = simulation.frames.present
    assert np.nanmax(roots_off(result, simulation.range_m)[at]) < FALSE_ALARM


def test_frames_at_the_seam_have_one_range() -> None:
    """Where phases begin anew a range is as any other: their neighbours tell light, not phase."""
    r = TURN * np.array([0.3, 0.6, 0.9, 0.999, 1.0, 1.001, 1.1, 1.4, 1.7])
    for name in ("object", "crosstalk"):
        result = result_of(asked(*scenes(name, r), r, 3e3, 5)[0])
        assert (result.root_count == 1).all()
        assert (roots_off(result, r) < FALSE_ALARM).all()


def test_ranges_that_end_within_a_turn_end_there() -> None:
    """4 m and 11.5 m have one phase; beyond the stated 10 m nothing is looked for."""
    r = np.array([1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 7.8, 9.0, 9.8])
    to_10 = {"range_m": {"prior": "uniform", "low": 0.3, "high": 10.0}}
    truth, told = scenes("crosstalk", r)
    for snr in (1.0, 3e3):  # in the first no light tells the turn of the last frames
        result = result_of(asked(truth, told | to_10, r, snr, 6)[0])
        assert np.nanmax(result.roots_m) < 10.0 + 1e-9
        off = roots_off(result, r)[result.root_count > 0]
        assert np.nanmax(off) < FALSE_ALARM
    assert (result.root_count == 1).all()


@pytest.mark.parametrize(("end", "searches"), [(TURN, 1), (7.0, 1), (14.0, 4)])
def test_ranges_within_a_turn_are_searched_once(
    end: float, searches: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They cost nothing more: no window, and the support that they had."""
    sensor = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": {"read": [1e-5] * 2}})
    scene = parse_scene(
        {"discrepancy": 0, "range_m": {"prior": "uniform", "low": 0.3, "high": end}}
    )
    path = SampledTrajectory(range_m=[1.0, 1.5, 2.0, 3.0, 4.0, 5.0])
    frames = simulate(sensor, parse_scene({"discrepancy": 0, "object": OBJECT}), path, 7).frames
    problem = fit_problem(sensor, scene, frames)
    assert problem.support == pytest.approx((0.3, end))
    asked_for: list[tuple[float, float]] = []
    screened = multistart._screened

    def counted(part: FitProblem) -> Any:
        asked_for.append(part.support)
        return screened(part)

    monkeypatch.setattr(multistart, "_screened", counted)
    multistart.find_maxima(problem)
    assert asked_for == [problem.support, *problem.windows]
    assert len(asked_for) == searches


@pytest.mark.parametrize(
    ("told", "reason"),
    [
        ({"range_m": {"prior": "uniform", "low": 0.3, "high": 40.0}}, "5.3 turns of phase"),
        (
            {"background": {"strength": 1e-3, "distance_m": TO_14["range_m"]}},
            "so does background.distance_m",
        ),
    ],
)
def test_what_no_joint_fit_decides(told: Numbers, reason: str) -> None:
    found, _, _ = asked({"object": OBJECT}, told, CROSSING, 1e3, 1)
    (left,) = [out.reason for out in found.left_out if out.name == "joint_fit"]
    assert reason in left


def test_a_wall_within_the_first_turn_ends_the_ranges() -> None:
    """Whatever else the scene states of them."""
    r = np.geomspace(1.0, 4.5, 12)
    wall = WALL | {"distance_m": 5.0, "strength": 1e-4}
    found, _, _ = asked({"object": OBJECT, "background": wall}, {"background": wall}, r, 1e3, 2)
    result = result_of(found)
    assert (result.root_count == 1).all()
    assert (roots_off(result, r) < FALSE_ALARM).all()
