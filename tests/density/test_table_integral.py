"""The integral by a table's knots: right where it answers, and silent where it cannot know."""

import itertools
import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest
from scipy import integrate, special

from inference.density import frame_integrals, range_integral, table_integral
from inference.density.collapsed import collapsed_density
from inference.density.table_integral import integrate_table, table_step, value_at_end
from inference.frame.arguments import FrameScene, scene_of
from inference.frame.blocks import Block, block_of
from inference.frame.dark_mass import with_dark_mass
from inference.frame.gaussian import log_top
from inference.frame.log_density import log_density
from inference.frame.modes import SD, TOP, find_modes, room_for_modes
from inference.frame.range_prior import integration_bounds
from inference.frame.table import KNOT_SPACING, tabulate
from simulator import uncompiled
from simulator.compiled import Kernel
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.counting import counted_calls
from tests.density.reference import Case, mean_readings, reference

Density = Callable[[Any], Any]
FIRST, LAST = 0.0, 191 * KNOT_SPACING
KNOTS = np.linspace(FIRST, LAST, 192)
# what the rule lets pass by its notes: 4e-7 in the middle, 3e-7 times a little at the far end
ALLOWED = 1e-6


def _found(log_density: Density) -> float:
    """Integrate by the knots, given the modes also between them."""
    fine = np.linspace(FIRST, LAST, 191 * 200 + 1)
    values = log_density(fine)
    tops = np.flatnonzero((values[1:-1] > values[:-2]) & (values[1:-1] >= values[2:])) + 1
    bend = (2 * values[tops] - values[tops - 1] - values[tops + 1]) / (fine[1] - fine[0]) ** 2
    modes = np.zeros((len(tops), 7))
    modes[:, TOP], modes[:, SD] = values[tops], 1.0 / np.sqrt(np.maximum(bend, 1e-12))
    shares = np.empty(192)
    return float(integrate_table(modes, len(tops), values[::200].copy(), shares, KNOT_SPACING))


def _of_knots(values: np.ndarray) -> float:
    """Integrate by the knots alone: as if no mode had been found between them."""
    answer, _ = uncompiled.run(
        cast(Kernel, integrate_table)._function,
        (np.empty((0, 7)), 0, values, np.empty(192), KNOT_SPACING),
        math.inf,
    )
    return float(answer)


def _exact(log_density: Density, breaks: list[float]) -> float:
    """Log of the integral, cut where the density bends."""
    ends = sorted({FIRST, LAST, *(b for b in breaks if FIRST < b < LAST)})
    parts = [
        integrate.quad(lambda u: math.exp(log_density(u)), a, b, limit=400, epsabs=0)[0]
        for a, b in itertools.pairwise(ends)
    ]
    return math.log(sum(parts))


def _change(monkeypatch: pytest.MonkeyPatch, **constants: object) -> None:
    """Change constants of the rule, also for the interpreter."""
    for name, value in constants.items():
        monkeypatch.setattr(table_integral, name, value)
    for name in ("_names", "_twins"):
        monkeypatch.setattr(uncompiled, name, {})


def _peak(centre: float, sd: float, lean: float = 0.0) -> Density:
    return lambda u: -0.5 * ((u - centre) / sd) ** 2 + lean * (u - centre)


def _either(one: Density, other: Density, height: float) -> Density:
    return lambda u: np.logaddexp(one(u), other(u) + height)


@pytest.mark.parametrize("seed", range(4))
def test_broad_densities_are_exact_wherever_there_is_an_answer(seed: int) -> None:
    """Peaks of 0.3 to 30 knots, leaning, two of them, some cut off by the far end."""
    rng = np.random.default_rng(seed)
    answered = {"broad": 0, "sharp": 0}
    for _ in range(300):
        sd = KNOT_SPACING * 10 ** rng.uniform(-0.5, 1.5)
        centre, lean = rng.uniform(3.5, 7.5), rng.normal() / sd
        one = _peak(centre, sd, lean)
        apart, second = rng.uniform(0, 6) * sd, KNOT_SPACING * 10 ** rng.uniform(-0.5, 1.5)
        other = _peak(centre - apart, second)
        two = rng.random() < 0.5

        density = _either(one, other, -1.0) if two else one
        found = _found(density)
        tops = [centre + lean * sd**2, centre - apart]
        around = [
            top + k * w for top, w in zip(tops, (sd, second), strict=True) for k in (-6, 0, 6)
        ]
        if not math.isnan(found):
            assert found == pytest.approx(_exact(density, around), abs=ALLOWED)
        widest = min(sd, second) if two else sd
        broad = widest > 2.0 * KNOT_SPACING and tops[0] < LAST and tops[0] - 9 * sd > FIRST
        if broad and tops[1] - 9 * second > FIRST:
            answered["broad"] += not math.isnan(found)
            answered["sharp"] += math.isnan(found)
    assert answered["broad"] > 0.6 * (answered["broad"] + answered["sharp"])
    assert answered["broad"] > 40


def _with_spike(share: float, sd: float) -> Density:
    """A broad density, and a share of it in a spike in the middle between two knots near its top.

    Even and odd knots say the same of such a spike, by symmetry, whatever they say.
    """
    wide, between = 10.0 * KNOT_SPACING, float(KNOTS[100]) + KNOT_SPACING / 2
    broad, spike = _peak(between, wide), _peak(between, sd * KNOT_SPACING)
    height = math.log(share * wide / (sd * KNOT_SPACING))
    return _either(broad, spike, height)


WHOLE = math.log(math.sqrt(2 * math.pi) * 10.0 * KNOT_SPACING)


@pytest.mark.parametrize(("share", "sd"), [(0.05, 0.2), (0.05, 0.4), (0.01, 0.2), (0.01, 0.4)])
def test_a_spike_between_knots_has_no_answer(
    share: float, sd: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    density = _with_spike(share, sd)
    assert math.isnan(_found(density))
    # the planted faults: what is sharp is taken for broad, other knots and the end for good
    _change(monkeypatch, _SHARPEST=0.0, _FOURTH=math.inf, _THIRD=math.inf)
    values = density(KNOTS)
    assert abs(_of_knots(values) - WHOLE - math.log1p(share)) > 5 * ALLOWED


def test_the_planted_fault_of_plain_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """A density that the far end cuts at its steepest, as broad as two steps and a half."""
    density = _peak(LAST + 2.0 * KNOT_SPACING, 2.5 * KNOT_SPACING)
    found, exact = _found(density), _exact(density, [LAST - 0.5])
    assert math.isnan(found) or abs(found - exact) < ALLOWED
    _change(monkeypatch, _END=np.zeros(5), _MORE=np.zeros(7), _FOURTH=math.inf, _THIRD=math.inf)
    values = density(KNOTS)
    assert abs(_of_knots(values) - exact) > 10 * ALLOWED


def test_a_mode_that_no_knot_shows_has_no_answer() -> None:
    values = _with_spike(0.05, 0.02)(KNOTS)
    assert abs(_of_knots(values) - WHOLE) < 1e-6  # as if it were not there
    modes = np.zeros((1, 7))
    modes[0, SD], modes[0, TOP] = 0.02 * KNOT_SPACING, 3.0
    assert math.isnan(integrate_table(modes, 1, values, np.empty(192), KNOT_SPACING))


@pytest.mark.parametrize(
    "values",
    [
        np.zeros(192),  # something is left at the near end
        np.full(192, -np.inf),
        np.where(np.arange(192) == 100, np.nan, -0.5 * ((KNOTS - 4.0) / 0.5) ** 2),
        np.where(KNOTS < 3.0, -np.inf, 0.0),  # a cliff between two knots
    ],
)
def test_what_knots_cannot_show_has_no_answer(values: np.ndarray) -> None:
    assert math.isnan(_of_knots(values))


SENSORS = [
    {"kind": "pulsed", "pulse_width_s": 1e-7},
    {"kind": "sine_wave", "frequency_hz": 5e6},
]


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("gain", [1.0, 3.0])
def test_frames_in_the_dark_against_the_slow_reference(
    sensor: dict[str, object], gain: float
) -> None:
    """Signal-to-noise ratios of 0.1 to 30, of which most are answered by the table.

    A frame beside a stronger one is not: the table's knots are held to the strongest.
    """
    rng = np.random.default_rng(11)
    tabled = 0
    for _ in range(40):
        c = (float(10 ** rng.uniform(-2, 0)), float(rng.uniform(-0.1, 0.3)), 0.1)
        scene = {
            "object": dict(zip(("c0", "c1", "c2"), c, strict=True)),
            "range_m": {"prior": "loguniform", "low": 0.02, "high": 12.0},
            "discrepancy": 0,
        }
        clean = parse_sensor({**sensor, "noise": {"read": [1.0, 1.0]}})
        at = math.log(rng.uniform(0.5, 4.0))
        means = Case(clean, parse_scene(scene), c, None, None, 0.02, 12.0, (0.0, 0.0))
        m1, m2, _, _ = mean_readings(means, np.array([at]))
        sd = float(np.hypot(m1, m2)[0] / 10 ** rng.uniform(-1, 1.5))
        own = parse_sensor({**sensor, "noise": {"read": [sd, sd]}})
        reading = (float(m1[0] + sd * rng.normal()), float(m2[0] + sd * rng.normal()))
        case = Case(own, parse_scene(scene), c, None, None, 0.02, 12.0, reading)
        frames = case.frames
        if gain != 1.0:
            readings = np.array([reading, (gain * reading[0], gain * reading[1])])
            frames = type(frames)(readings, gain=np.array([1.0, gain]))
        density = collapsed_density(own, parse_scene(scene), frames)
        found = density.frame_log_likelihoods(np.empty((1, 0)))[0, 0]
        assert found == pytest.approx(reference(case), abs=ALLOWED)
        terms = density.parameters.terms(np.empty((1, 0)))
        _, calls = counted_calls(
            frame_integrals.fill_log_likelihoods,
            np.empty((1, len(density.frames))),
            density.integral_rows(terms),
            density.data,
            density.instrument,
        )
        tabled += calls["range_integral.integrate_range"] == 0
    assert tabled > 15 if gain == 1.0 else tabled == 0


def _panels(low: float, high: float, block: Block, scene: FrameScene) -> float:
    """Integrate a frame's density by panels as long as a knot, of eight nodes each."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    edges = np.linspace(low, high, 193)
    half = 0.5 * np.diff(edges)[:, None]
    at = (edges[:-1, None] + half * (1.0 + nodes)).ravel()
    values = np.array([log_density(u, block, scene) for u in at])
    return float(special.logsumexp(values, b=(half * weights).ravel()))


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_law_that_goes_by_the_slope_up_to_where_an_echo_is_all_late(
    sensor: dict[str, object],
) -> None:
    """The default law, in the dark. Planted fault: the density at a pulse's r0 itself."""
    own = parse_sensor({**sensor, "noise": {"read": [0.003, 0.003]}})
    scene = parse_scene({"object": {"c0": 30.0, "c1": 0.0, "c2": 0.3}, "discrepancy": 0})
    rng = np.random.default_rng(4)
    density = collapsed_density(own, scene, Frames(rng.normal(0.0, 0.003, (12, 2))))
    rows = density.integral_rows(density.parameters.terms(np.empty((1, 0))))
    plain = scene_of(rows, density.instrument, 0)
    bounds = integration_bounds(plain.range_prior)
    table = tabulate(bounds, plain, density.data.strongest)
    dark = with_dark_mass(table, plain)
    step = table_step(table, density.data, density.instrument)
    modes, values, shares = (
        room_for_modes(table),
        np.empty(table.shape[1]),
        np.empty(table.shape[1]),
    )
    tabled, at_end = 0, []
    for b in range(12):
        block = block_of(density.data, b)
        exact = _panels(*bounds, block, dark)
        count = find_modes(modes, values, table, block, dark)
        at_end.append(integrate_table(modes, count, values, shares, step) - exact)
        values[-1] = value_at_end(table, block, dark)
        found = integrate_table(modes, count, values, shares, step)
        assert math.isnan(found) or found == pytest.approx(exact, abs=ALLOWED)
        tabled += not math.isnan(found)
        whole = density.frame_log_likelihoods(np.empty((1, 0)))[0, b]
        assert whole - log_top(density.instrument.read) == pytest.approx(exact, abs=ALLOWED)
    assert tabled > 6
    assert np.nanmax(np.abs(at_end)) > ALLOWED or own.kind != "pulsed"


@pytest.mark.parametrize(
    ("sensor", "readings"),
    [(SENSORS[0], [[0.005, 0.1], [0.004, 0.2]]), (SENSORS[1], [[0.1, 0.015], [0.2, 0.02]])],
)
def test_a_leaning_peak_is_right_or_left_to_panels(
    sensor: dict[str, object], readings: list[list[float]]
) -> None:
    """Planted fault: widths up to six times too large, as of flat tops with steep sides.

    The rule's points then lie as many times farther apart.
    """
    own = parse_sensor({**sensor, "noise": {"read": [0.01, 0.01]}})
    span = {"prior": "loguniform", "low": 0.02, "high": 12.0}
    object_ = {"c0": 0.1, "c1": 0.0, "c2": 0.3}
    scene = parse_scene({"object": object_, "range_m": span, "discrepancy": 0})
    density = collapsed_density(own, scene, Frames(np.array(readings)))
    rows = density.integral_rows(density.parameters.terms(np.empty((1, 0))))
    one = scene_of(rows, density.instrument, 0)
    table = tabulate(integration_bounds(one.range_prior), one, density.data.strongest)
    modes, values = room_for_modes(table), np.empty(table.shape[1])
    answered, refused = 0, 0
    for b in range(2):
        block = block_of(density.data, b)
        count = find_modes(modes, values, table, block, one)
        mode = modes[int(np.argmax(modes[:count, TOP]))].copy()
        width = mode[SD]
        mode[SD] = 0.5 * width
        exact = range_integral._leaning(mode, block, one)
        assert exact > 0.0
        for factor in np.linspace(0.5, 6.0, 39):
            mode[SD] = factor * width
            found = range_integral._leaning(mode, block, one)
            assert found == -1.0 or found == pytest.approx(exact, rel=ALLOWED)
            answered += found > 0.0
            refused += found == -1.0
    assert answered > 10
    assert refused > 20


@pytest.mark.parametrize(
    ("reach", "sensor", "spaced"),
    [
        (14.989, SENSORS[0], True),  # r0 is 14.990 m, from which on an echo is all late
        (14.68, {**SENSORS[0], "timing_offset_s": 2e-9}, True),  # all late from 14.690 m on
        (14.8, {**SENSORS[0], "timing_offset_s": 2e-9}, False),
        (14.0, {**SENSORS[0], "timing_offset_s": -2e-9}, False),  # none late up to 0.3 m
        (16.0, SENSORS[1], True),
        (16.0, {**SENSORS[1], "noise": {"read": [1e-3, 1e-3], "shot": 1e-6}}, False),
        (16.0, {**SENSORS[1], "noise": {"read": [1e-3, 1e-3], "relative": 0.1}}, False),
    ],
)
def test_a_density_with_kinks_is_none_of_a_table(
    reach: float, sensor: dict[str, object], spaced: bool
) -> None:
    own = parse_sensor({"noise": {"read": [1e-3, 1e-3]}, **sensor})
    scene = parse_scene(
        {
            "object": {"c0": 0.1, "c1": 0.0, "c2": 0.1},
            "range_m": {"prior": "loguniform", "low": 0.05, "high": reach},
            "discrepancy": 0,
        }
    )
    density = collapsed_density(own, scene, Frames(np.array([[1e-3, 2e-3]])))
    rows = density.integral_rows(density.parameters.terms(np.empty((1, 0))))
    one = scene_of(rows, density.instrument, 0)
    table = tabulate(integration_bounds(one.range_prior), one, 1.0)
    step = table_step(table, density.data, density.instrument)
    assert step == pytest.approx(math.log(reach / 0.05) / 191 if spaced else 0.0, rel=1e-12)
