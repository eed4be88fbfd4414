"""The curves against mpmath: values, slopes, turning points, and the roots of polynomials."""

import importlib
import itertools
import math
from collections.abc import Sequence
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inference.realtime.solving import curves
from inference.realtime.solving.curves import (
    both_phase,
    both_ratio,
    cancelling_quadrature,
    cancelling_ratio,
    differential_phase,
    differential_ratio,
    dispatch,
    intensity,
    intensity_w1,
)
from inference.realtime.solving.curves.curve import Curve, CurveParameters, Search
from inference.realtime.solving.curves.registry import CURVES
from inference.realtime.solving.exact import cycles_phase, difference_of_products
from inference.realtime.solving.monotone_intervals import monotone_intervals
from inference.realtime.solving.polynomials import real_roots

P = CurveParameters(
    c0=0.9, c1=-1.1, distance=4.0, wave=0.7, c0_shadow=0.6, c1_shadow=0.2, contrast=0.15
)
EVERY = pytest.mark.parametrize("curve", CURVES, ids=[curve.name for curve in CURVES])


NO_ERRORS = (0.0, 0.0, 0.0, 0.0)


def plain(kind: int, u: mp.mpf, errors: Sequence[mp.mpf] = NO_ERRORS) -> mp.mpf:
    """Write the curve as its definition, derivatives by mpmath.

    The errors are those of the flux and of the effective distance, each with its slope along log r.
    """
    c0, c1, far, k, c0s, c1s, contrast = (mp.mpf(x) for x in P)
    flux, flux_slope, late, late_slope = (mp.mpf(x) for x in errors)

    def phi(r: mp.mpf) -> mp.mpf:
        exact = c0 / (r**2 * (r**2 + c1 * r + c0))
        return exact * mp.exp(flux + flux_slope * mp.log(r / u))

    def seen(r: mp.mpf) -> mp.mpf:
        return r + late + late_slope * mp.log(r / u)

    def back(r: mp.mpf) -> mp.mpf:
        if kind in (differential_ratio.KIND, differential_phase.KIND):
            return mp.mpf(0)
        return contrast * (r**2 + c1s * r) / (r**2 + c1s * r + c0s)

    match kind:
        case intensity.KIND:
            return phi(u)
        case intensity_w1.KIND:
            return seen(u) * phi(u)
        case cancelling_ratio.KIND:
            return (1 - seen(u) / far) * phi(u)
        case cancelling_quadrature.KIND:
            return mp.sin(k * (far - seen(u))) * phi(u)
        case differential_ratio.KIND | both_ratio.KIND:
            top = mp.diff(lambda r: seen(r) * phi(r) + far * back(r), u)
            return top / mp.diff(lambda r: phi(r) + back(r), u)
        case differential_phase.KIND | both_phase.KIND:
            real = mp.diff(lambda r: phi(r) * mp.cos(k * seen(r)) + back(r) * mp.cos(k * far), u)
            imag = mp.diff(lambda r: phi(r) * mp.sin(k * seen(r)) + back(r) * mp.sin(k * far), u)
            return mp.atan2(imag, real)
        case _:
            raise AssertionError(f"write the definition of curve {kind} here")


@EVERY
@pytest.mark.parametrize("u", [1e-3, 0.31, 0.77, 1.3, 3.1])
def test_values_and_slopes(curve: Curve, u: float) -> None:
    with mp.workdps(50):
        value = plain(curve.kind, mp.mpf(u))
        slope = mp.diff(lambda x: plain(curve.kind, x), mp.mpf(u), h=mp.mpf(10) ** -15)
        ours = dispatch.value(curve.kind, u, P)
        if curve.period:
            assert abs(math.remainder(ours - float(value), curve.period)) < 1e-14
        else:
            assert ours == pytest.approx(float(value), rel=1e-13)
        assert dispatch.slope(curve.kind, u, P) == pytest.approx(float(slope), rel=1e-10)


@EVERY
@pytest.mark.parametrize("u", [0.31, 1.3, 3.1])
def test_responses_to_errors_of_the_model(curve: Curve, u: float) -> None:
    with mp.workdps(50):
        step = mp.mpf(10) ** -12
        for place, ours in enumerate(dispatch.response(curve.kind, u, P)):
            ends = [
                plain(curve.kind, mp.mpf(u), [sign * step if i == place else 0 for i in range(4)])
                for sign in (1, -1)
            ]
            slope = float((ends[0] - ends[1]) / (2 * step))
            assert ours == pytest.approx(slope, rel=1e-10, abs=1e-12)


@EVERY
@pytest.mark.parametrize("u", [1e-3, 0.31, 0.77, 1.3, 3.1])
def test_a_curve_is_dispatched_to_its_own_file(curve: Curve, u: float) -> None:
    """No case forgotten, which would give nan, and none that gives another curve's formula."""
    own = importlib.import_module(f"{curves.__name__}.{curve.name}")
    assert own.CURVE is curve
    assert curve.kind == own.KIND
    kind, target = curve.kind, own.value(u, P)
    calls: dict[str, tuple[float, ...]] = {
        "value": (u,),
        "slope": (u,),
        "guess": (target, 1.0),
        "residual": (u, 1.1 * target, 1.0),
        "response": (u,),
    }
    if hasattr(own, "power_law"):
        calls["power_law"] = (u,)
    if curve.poles is not None or isinstance(curve.turns, Search):
        calls["direction"] = (u,)
    if isinstance(curve.turns, Search):
        calls["turning"] = (u,)
    for name, arguments in calls.items():
        found = getattr(dispatch, name)(kind, *arguments, P)
        np.testing.assert_array_equal(found, getattr(own, name)(*arguments, P), err_msg=name)
        assert np.isfinite(found).all(), name


@EVERY
@pytest.mark.parametrize("u", [0.31, 0.77, 1.3, 3.1])
def test_what_the_solver_uses_of_a_curve_agrees_with_its_value(curve: Curve, u: float) -> None:
    kind = curve.kind
    value, slope = dispatch.value(kind, u, P), dispatch.slope(kind, u, P)
    height, power = dispatch.power_law(kind, u, P)
    if not math.isnan(power):
        assert height == pytest.approx(value, rel=1e-14)
        assert power == pytest.approx(u * slope / value, rel=1e-12)
    # a residual changes its sign where the value crosses the target, and nowhere near
    sides = []
    for shift in (-0.01, 0.01):
        target = value + shift * abs(slope)
        assert dispatch.residual(kind, u, target, 1.0, P) != 0.0
        sides.append(dispatch.residual(kind, u, target, 1.0, P) > 0.0)
    assert sides[0] != sides[1]
    assert abs(dispatch.residual(kind, u, value, 1.0, P)) < 1e-12
    # far and near, where a curve is a power law, the guess is the root
    for near in (1e-6, 1e6):
        at = dispatch.value(kind, near, P)
        _, power = dispatch.power_law(kind, near, P)
        if not curve.period and at > 0.0 and not math.isnan(power) and near < P.distance:
            assert 0.5 < dispatch.guess(kind, at, 1.0, P) / near < 2.0
    if isinstance(curve.turns, Search):
        assert (dispatch.turning(kind, u, P) > 0.0) == (slope > 0.0)


def test_every_file_of_a_curve_is_registered_once() -> None:
    helpers = {"curve", "dispatch", "registry", "terms", "__init__"}
    files = {path.stem for path in Path(next(iter(curves.__path__))).glob("*.py")} - helpers
    assert {curve.name for curve in CURVES} == files
    assert len({curve.kind for curve in CURVES}) == len(CURVES)


def test_a_number_without_a_case_gives_nan() -> None:
    kind = max(curve.kind for curve in CURVES) + 1
    assert math.isnan(dispatch.value(kind, 1.0, P))
    assert math.isnan(dispatch.slope(kind, 1.0, P))
    assert math.isnan(dispatch.guess(kind, 1.0, 1.0, P))
    assert math.isnan(dispatch.residual(kind, 1.0, 1.0, 1.0, P))
    assert math.isnan(dispatch.turning(kind, 1.0, P))
    assert np.isnan(dispatch.response(kind, 1.0, P)).all()
    assert np.isnan(dispatch.power_law(kind, 1.0, P)).all()
    assert np.isnan(dispatch.direction(kind, 1.0, P)).all()


@EVERY
@pytest.mark.parametrize("shape", [-1.95, -1.2, 0.0, 3.0])
def test_intervals_are_monotone(curve: Curve, shape: float) -> None:
    p = P._replace(c1=shape * math.sqrt(P.c0), wave=2.9)
    intervals = monotone_intervals(curve, p, 0.0, math.pi / 2.9 if curve.winds else 4.0)
    for left, right, at_low, at_high in zip(
        intervals.low, intervals.high, intervals.at_low, intervals.at_high, strict=True
    ):
        low = max(float(left), 1e-4)
        if low >= right:
            continue
        inner = low + (right - low) * np.linspace(0.0, 1.0, 2000)[1:-1]
        along = np.array([dispatch.value(curve.kind, float(u), p) for u in inner])
        if curve.winds:
            along = np.unwrap(along)
        steps = np.diff(along) * (1.0 if at_high > at_low else -1.0)
        assert (steps >= -1e-12 * np.abs(along).max()).all()
    # they join
    np.testing.assert_array_equal(intervals.low[1:], intervals.high[:-1])


@given(
    st.lists(st.floats(0.01, 0.99), min_size=1, max_size=4, unique=True),
    st.booleans(),
)
@settings(max_examples=200, deadline=None)
def test_real_roots_finds_every_simple_root(roots: list[float], complex_pair: bool) -> None:
    roots = sorted(roots)
    if any(b - a < 1e-3 for a, b in itertools.pairwise(roots)):
        return
    coefficients = np.asarray(np.poly(roots), dtype=np.float64)
    if complex_pair and len(roots) <= 2:
        coefficients = np.convolve(coefficients, [1.0, -1.0, 5.0])
    out = np.empty(8)
    count = real_roots(coefficients, 0.0, 1.0, out)
    assert count == len(roots)
    # conditioned by the nearest other root, 1e-3 away, to the power of three
    np.testing.assert_allclose(out[:count], roots, rtol=1e-5)


@pytest.mark.parametrize("apart", [1e3, 1e9, 1e15])
def test_a_small_root_beside_a_large_one_keeps_its_digits(apart: float) -> None:
    """(x - 1/a)(x - a): the small one is a difference of two numbers of the large one's size."""
    out = np.empty(3)
    coefficients = np.array([1.0, -(apart + 1 / apart), 1.0])
    assert real_roots(coefficients, 0.0, 2 * apart, out) == 2
    np.testing.assert_allclose(out[:2], [1 / apart, apart], rtol=4 * np.finfo(float).eps)


@given(*[st.floats(-1e6, 1e6)] * 2)
def test_difference_of_products_is_exact(a: float, b: float) -> None:
    from fractions import Fraction

    c, d = a * (1 + 2.0**-50), b * (1 - 2.0**-50)
    exact = Fraction(a) * Fraction(b) - Fraction(c) * Fraction(d)
    ours = difference_of_products(a, b, c, d)
    if abs(exact) > 1e-250:  # below it the errors of products underflow
        assert abs(Fraction(ours) / exact - 1) < Fraction(1, 2**49) if exact else ours == 0


def test_the_phase_of_a_distance_is_reduced_exactly() -> None:
    with mp.workdps(50):
        for frequency, distance in ((1e8, 49.9), (3.3e7, 0.1), (1e8, 1234.5678)):
            phase = 4 * mp.pi * mp.mpf(frequency) * mp.mpf(distance) / 299792458
            exact = phase - 2 * mp.pi * mp.floor(phase / (2 * mp.pi))
            assert cycles_phase(frequency, distance) == pytest.approx(float(exact), rel=4e-16)
