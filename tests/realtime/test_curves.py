"""The curves against mpmath: values, slopes, turning points, and the roots of polynomials."""

import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inference.realtime.solving import curves
from inference.realtime.solving.exact import cycles_phase, difference_of_products
from inference.realtime.solving.monotone_intervals import pieces_of
from inference.realtime.solving.polynomials import real_roots

# c0, c1, R, k, c0', c1', contrast
P = np.array([0.9, -1.1, 4.0, 0.7, 0.6, 0.2, 0.15])
NAMES = {
    curves.INTENSITY: "intensity",
    curves.INTENSITY_W1: "intensity_w1",
    curves.DIFFERENTIAL_RATIO: "differential_ratio",
    curves.DIFFERENTIAL_PHASE: "differential_phase",
    curves.CANCELLING_RATIO: "cancelling_ratio",
    curves.CANCELLING_QUADRATURE: "cancelling_quadrature",
    curves.BOTH_RATIO: "both_ratio",
    curves.BOTH_PHASE: "both_phase",
}


def plain(kind: int, u: mp.mpf) -> mp.mpf:
    """Write the curve as its definition, derivatives by mpmath."""
    c0, c1, far, k, c0s, c1s, contrast = (mp.mpf(x) for x in P.tolist())

    def phi(r: mp.mpf) -> mp.mpf:
        return c0 / (r**2 * (r**2 + c1 * r + c0))

    def back(r: mp.mpf) -> mp.mpf:
        if kind in (curves.DIFFERENTIAL_RATIO, curves.DIFFERENTIAL_PHASE):
            return mp.mpf(0)
        return contrast * (r**2 + c1s * r) / (r**2 + c1s * r + c0s)

    match kind:
        case curves.INTENSITY:
            return phi(u)
        case curves.INTENSITY_W1:
            return u * phi(u)
        case curves.CANCELLING_RATIO:
            return (1 - u / far) * phi(u)
        case curves.CANCELLING_QUADRATURE:
            return mp.sin(k * (far - u)) * phi(u)
        case curves.DIFFERENTIAL_RATIO | curves.BOTH_RATIO:
            top = mp.diff(lambda r: r * phi(r) + far * back(r), u)
            return top / mp.diff(lambda r: phi(r) + back(r), u)
        case _:
            real = mp.diff(lambda r: phi(r) * mp.cos(k * r) + back(r) * mp.cos(k * far), u)
            imag = mp.diff(lambda r: phi(r) * mp.sin(k * r) + back(r) * mp.sin(k * far), u)
            return mp.atan2(imag, real)


@pytest.mark.parametrize("kind", list(NAMES), ids=list(NAMES.values()))
@pytest.mark.parametrize("u", [1e-3, 0.31, 0.77, 1.3, 3.1])
def test_values_and_slopes(kind: int, u: float) -> None:
    with mp.workdps(50):
        value = plain(kind, mp.mpf(u))
        slope = mp.diff(lambda x: plain(kind, x), mp.mpf(u), h=mp.mpf(10) ** -15)
        ours = curves.value(kind, u, P)
        if kind in (curves.DIFFERENTIAL_PHASE, curves.BOTH_PHASE):  # known modulo pi
            assert abs(math.remainder(ours - float(value), math.pi)) < 1e-14
        else:
            assert ours == pytest.approx(float(value), rel=1e-13)
        assert curves.slope(kind, u, P) == pytest.approx(float(slope), rel=1e-10)


@pytest.mark.parametrize("kind", list(NAMES), ids=list(NAMES.values()))
@pytest.mark.parametrize("shape", [-1.95, -1.2, 0.0, 3.0])
def test_pieces_are_monotone(kind: int, shape: float) -> None:
    p = P.copy()
    p[curves.C1] = shape * math.sqrt(p[curves.C0])
    p[curves.WAVE] = 2.9
    pieces = pieces_of(kind, p, 0.0, math.pi / 2.9 if kind == curves.BOTH_PHASE else 4.0)
    for (left, right), values in zip(pieces.ends.tolist(), pieces.values.tolist(), strict=True):
        low = max(left, 1e-4)
        if low >= right:
            continue
        inner = low + (right - low) * np.linspace(0.0, 1.0, 2000)[1:-1]
        along = np.array([curves.value(kind, float(u), p) for u in inner])
        if kind == curves.BOTH_PHASE:
            along = np.unwrap(along)
        steps = np.diff(along) * (1.0 if values[1] > values[0] else -1.0)
        assert (steps >= -1e-12 * np.abs(along).max()).all()
    # the pieces join
    np.testing.assert_array_equal(pieces.ends[1:, 0], pieces.ends[:-1, 1])


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
