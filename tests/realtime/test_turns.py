"""Ranges that a scene states beyond a whole turn of phase: all of them that explain a frame."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from inference.estimate import estimate
from inference.estimates import Status, TechniqueResult
from inference.known import known_of
from inference.realtime.registry import TECHNIQUES
from service.c_export import export_c
from service.messages.measured import limits_of
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import SineWaveSensor, parse_sensor

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Numbers = dict[str, Any]

TURN = 299792458.0 / 2 / 2e7  # 7.49 m
WAVE = 2 * math.pi / TURN
C0, C1, C2 = 0.5, -0.3, 0.1
OBJECT = {"c0": C0, "c1": C1, "c2": C2}
CROSSTALK = [0.01, -0.02]
WALL = {"strength": 0.02, "distance_m": 15.0, "shadow": {"c0": 0.4, "c1": 0.1}}


def uniform(low: float, high: float) -> Numbers:
    return {"range_m": {"prior": "uniform", "low": low, "high": high}}


def light(r: Array) -> tuple[Complex, Complex]:
    """The object's signal and its derivative along the range, as complex numbers."""
    q = r * r * (r * r + C1 * r + C0)
    steep = 4 * r**3 + 3 * C1 * r**2 + 2 * C0 * r
    flux = C0 * C2 / q
    turned = np.exp(1j * WAVE * r)
    return flux * turned, (-flux * steep / q + 1j * WAVE * flux) * turned


def of_wall(r: Array) -> tuple[Complex, Complex]:
    """The same of the wall behind it."""
    c0, c1 = WALL["shadow"].values()  # type: ignore[attr-defined]
    q = r * r + c1 * r + c0
    turned = WALL["strength"] * np.exp(1j * WAVE * WALL["distance_m"])  # type: ignore[operator]
    return turned * (1 - c0 / q), turned * c0 * (2 * r + c1) / q**2


def sensor_of(read: float, derivative: float | None = None) -> SineWaveSensor:
    noise: Numbers = {"read": [read, read]}
    if derivative is not None:
        noise["derivative"] = [derivative, derivative]
    parsed = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": noise})
    assert isinstance(parsed, SineWaveSensor)
    return parsed


def columns(values: Complex) -> Array:
    return np.column_stack([values.real, values.imag])


def answer(
    technique: str | None, scene: Numbers, r: Array, noise: float, seed: int | None = None
) -> TechniqueResult:
    """Frames of an object at ranges r, whose light is at least 1 / noise of its noise."""
    signal, change = light(r)
    if "background" in scene:
        signal, change = signal + of_wall(r)[0], change + of_wall(r)[1]
    if scene.get("motion") == "tangential":
        change = -signal
    signal = signal + complex(*CROSSTALK) if "crosstalk" in scene else signal
    read, derivative = noise * np.abs(signal).min(), noise * np.abs(change).min()
    rng = np.random.default_rng(seed)
    size = 0.0 if seed is None else 1.0
    readings = columns(signal) + size * read * rng.standard_normal((r.size, 2))
    slopes = columns(change) + size * derivative * rng.standard_normal((r.size, 2))
    frames = Frames(readings, derivatives=slopes)
    asked = None if technique is None else [technique]
    found = estimate(sensor_of(read, derivative), parse_scene(scene), frames, asked)
    return found.results[0]


def test_a_stated_range_beyond_a_turn_has_its_alias() -> None:
    """Both lie in the stated ranges, c/2f apart; only one where nothing is stated, as ever."""
    r = np.array([9.0])
    both = answer(None, uniform(0.1, 14.0), r, 1e-2)
    assert (both.technique, both.status[0]) == ("conventional", Status.AMBIGUOUS)
    np.testing.assert_allclose(both.roots_m[0], [9.0 - TURN, 9.0], rtol=1e-12)
    assert both.roots_sd_m[0, 0] == both.roots_sd_m[0, 1] > 0
    one = answer(None, {}, r, 1e-2)
    assert (one.status[0], one.roots_m.shape) == (Status.UNIQUE, (1, 1))
    np.testing.assert_allclose(one.roots_m[0], 9.0 - TURN, rtol=1e-12)
    # the second turn alone
    np.testing.assert_allclose(answer(None, uniform(8.0, 14.0), r, 1e-2).range_m, 9.0, rtol=1e-12)


def test_the_light_of_a_known_object_tells_the_turn() -> None:
    """`intensity` goes before `conventional` there, and only there."""
    r = np.array([1.0, 5.0, 9.0, 13.0])
    sure = answer(None, {"object": OBJECT} | uniform(0.1, 14.0), r, 1e-3)
    assert sure.technique == "intensity"
    np.testing.assert_allclose(sure.range_m, r, rtol=1e-9)
    for scene in ({"object": OBJECT}, {"object": OBJECT} | uniform(0.1, 7.4)):
        assert answer(None, scene, r[:2], 1e-3).technique == "conventional"
    # its light may be of three ranges
    odd = {"object": {"c0": C0, "c1": -1.9 * math.sqrt(C0), "c2": C2}}
    assert answer(None, odd | uniform(0.1, 14.0), r, 1e-3).technique == "conventional"


@pytest.mark.parametrize("noise", [0.01, 0.3])
@pytest.mark.parametrize("ends", [(0.1, 14.0), (3.0, 12.0), (0.05, 8.0)])
@pytest.mark.parametrize(
    ("technique", "scene"),
    [
        ("conventional", {}),
        ("differential", {"object": OBJECT, "crosstalk": CROSSTALK}),
        ("differential", {"crosstalk": CROSSTALK, "motion": "tangential"}),
    ],
)
def test_no_frame_is_sure_of_an_alias(
    technique: str, scene: Numbers, ends: tuple[float, float], noise: float
) -> None:
    """A root is within 5 sd in every frame, however near the ends of the stated ranges it is.

    At an end noise of 4.5 sd is allowed for: one frame of 300,000, and here are 5,000 at each.
    """
    low, high = ends
    rng = np.random.default_rng(7)
    r = np.concatenate(
        [rng.uniform(low, high, 5000), np.full(5000, low * 1.001), np.full(5000, high * 0.9999)]
    )
    told = answer(technique, scene | uniform(*ends), r, noise, seed=8)
    assert (told.root_count > 0).all()
    away = np.abs(told.roots_m - r[:, None])
    sd = np.where(np.isnan(told.roots_sd_m), np.inf, told.roots_sd_m)  # beside an end
    assert (np.nanmin(np.where(np.isnan(told.roots_m), np.nan, away / sd), axis=1) < 5).all()


def _turned(r: Array, wall: bool) -> Array:
    """The phase of the derivative along the range, unwound."""
    change = light(r)[1] + (of_wall(r)[1] if wall else 0.0)
    return np.unwrap(np.angle(change))


@pytest.mark.parametrize("wall", [False, True])
def test_all_roots_of_derivatives(wall: bool) -> None:
    """As many as a fine grid has ranges of the same phase modulo pi, and at the same places."""
    technique = "background_cancelling_differential" if wall else "differential"
    scene: Numbers = {"object": OBJECT, "crosstalk": CROSSTALK} | uniform(0.1, 14.0)
    scene |= {"background": WALL} if wall else {}
    r = np.array([0.7, 2.2, 3.6, 4.4, 6.9, 8.5, 11.1, 13.3])
    told = answer(technique, scene, r, 1e-9)
    grid = np.linspace(0.1, 14.0, 400_001)
    phases = _turned(grid, wall)
    for n, one in enumerate(r):
        off = (phases - np.interp(one, grid, phases)) / math.pi
        crossed = np.flatnonzero(np.diff(np.floor(off + 1e-9)) != 0)
        assert told.root_count[n] == crossed.size >= (1 if wall else 3)
        np.testing.assert_allclose(told.roots_m[n, : crossed.size], grid[crossed], atol=1e-4)
    assert (told.root_count > 1).sum() > 4


def test_bounds_go_from_the_first_turn_to_the_last() -> None:
    """They held half of the ranges where they were those of the first turn."""
    r = np.random.default_rng(9).uniform(0.1, 14.0, 2000)
    told = answer("differential", {"crosstalk": CROSSTALK} | uniform(0.1, 14.0), r, 0.01, seed=10)
    assert told.range_bounds_m is not None
    near, far = told.range_bounds_m.T
    assert ((near <= r) & (r <= far)).mean() > 0.95
    assert (near >= 0.1).all()
    assert (far <= 14.0).all()
    # a stated end just beyond the first turn leaves those out that lie beyond it
    some = r[(r > 1) & (r < 2.5)]
    few = answer(
        "differential", {"crosstalk": CROSSTALK} | uniform(0.1, 3.8), some, 0.01, seed=10
    ).range_bounds_m
    assert few is not None
    assert np.median(few[:, 1]) < 3.5


def test_a_law_without_an_end_has_finitely_many() -> None:
    """Up to its quantile at 4.5 standard deviations, 28.5 m: four turns, of derivatives eight."""
    law = {"range_m": {"prior": "lognormal", "median": 3.0, "sigma": 0.5}}
    r = np.array([2.0, 5.0])
    told = answer("conventional", law, r, 1e-2)
    np.testing.assert_allclose(told.roots_m[0], 2.0 + TURN * np.arange(4), rtol=1e-12)
    assert told.root_count[1] == math.floor((3.0 * math.exp(2.25) - 5.0) / TURN) + 1 == 4
    with_end = {"range_m": law["range_m"] | {"sigma": 0.15}}  # ends at 5.9 m
    assert answer("conventional", with_end, r, 1e-2).status.tolist() == [Status.UNIQUE] * 2


def test_what_several_turns_rule_out() -> None:
    """Fits on the ranges of single frames, C gives one range, and no frame has thousands."""
    sensor, scene = sensor_of(1e-6), parse_scene(uniform(0.1, 14.0))
    frames = Frames(np.full((8, 2), 0.1), time_s=np.arange(8.0))
    left = {each.name: each.reason for each in estimate(sensor, scene, frames).left_out}
    for fit in ("object_fit", "crosstalk_fit"):
        assert "goes on beyond 7.495 m" in left[fit]
        assert "take joint_fit" in left[fit]
    assert "goes on beyond" not in left["joint_fit"]
    # 0.4 % of this law's ranges are beyond, and 3 % of the other's
    for sigma, refused in ((1.0, False), (1.4, True)):
        law = parse_scene({"range_m": {"prior": "lognormal", "median": 0.5, "sigma": sigma}})
        told = {each.name: each.reason for each in estimate(sensor, law, frames).left_out}
        assert ("goes on beyond" in told["object_fit"]) == refused
    with pytest.raises(RefusedError, match=r"beyond 7\.495 m"):
        export_c("conventional", sensor, scene)
    export_c("conventional", sensor, parse_scene(uniform(0.1, 7.49)))
    wide = estimate(sensor, parse_scene(uniform(0.1, 4e3)), frames, ["conventional"])
    assert not wide.results
    assert "half turns of phase" in next(
        each.reason for each in wide.left_out if each.name == "conventional"
    )
    assert estimate(sensor, parse_scene(uniform(0.1, 3e3)), frames).results[0].roots_m.shape[1] > 99
    limits = limits_of(TECHNIQUES["conventional"], sensor, known_of(scene, sensor))
    assert limits == (0.1, 14.0)
    assert limits_of(TECHNIQUES["conventional"], sensor, known_of(parse_scene({}), sensor)) == (
        0.0,
        sensor.max_range_m,
    )


def test_a_phase_below_zero_is_at_contact_or_a_turn_away() -> None:
    """Noise has put it there; without a stated range it is at contact, as ever."""
    r = np.array([0.02])
    sensor = sensor_of(0.1)
    frames = Frames(np.array([[10.0, -0.2]]))
    told = estimate(sensor, parse_scene(uniform(0.02, 14.0)), frames).results[0]
    assert told.status[0] == Status.AMBIGUOUS
    np.testing.assert_allclose(told.roots_m[0, 0], r[0])
    assert np.isnan(told.roots_sd_m[0, 0])
    assert told.near_fold[0]
    np.testing.assert_allclose(told.roots_m[0, 1], TURN, rtol=0.01)
    assert estimate(sensor, parse_scene({}), frames).results[0].status[0] == Status.NONE
    # noise is nothing there, and the effective distance errs by 0.8 mm
    nearer = WAVE * np.array([-1e-3, -8e-3])
    bright = 1e6 * np.column_stack([np.cos(nearer), np.sin(nearer)])
    scene = parse_scene(uniform(0.0, 14.0))
    told = estimate(sensor, scene, Frames(bright)).results[0]
    assert told.status.tolist() == [Status.AMBIGUOUS, Status.UNIQUE]
