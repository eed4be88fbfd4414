"""Kernels against mpmath over the whole domain; limits at which curves stop being monotone."""

import math
from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from simulator.background import shadow, shadow_slope
from simulator.object_arrays import object_fluxes, quadratics, shadows
from simulator.object_model import (
    C1_LIMIT_DIFFERENTIAL,
    C1_LIMIT_INTENSITY,
    C1_LIMIT_INTENSITY_W1,
    distortion,
    log_slope,
    object_flux,
    object_flux_slope,
    quadratic,
    quadratic_minimum,
)
from simulator.parameters import Terms
from simulator.readings import (
    background_readings,
    background_slopes,
    covariance,
    noise_parts,
    object_readings,
    object_slopes,
)
from simulator.sensor import parse_sensor
from simulator.simulate import mean_readings

EPS = float(np.finfo(float).eps)
Pair = tuple[float, float]


def powers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(math.log10(low), math.log10(high)).map(lambda x: 10.0**x)


@st.composite
def shapes(draw: st.DrawFn) -> Pair:
    """Draw c0 and c1 > -2 sqrt(c0), often only a few roundings above it."""
    c0 = draw(powers(1e-4, 1e3))
    limit = -2.0 * math.sqrt(c0)
    near = powers(1e-16, 1.0).map(lambda gap: limit * (1.0 - gap))
    c1 = draw(near | st.floats(-2.0, 100.0).map(lambda s: s * math.sqrt(c0)))
    return c0, max(c1, math.nextafter(limit, 0.0))


ranges = powers(1e-2, 20.0)
waves = st.tuples(powers(0.04, 4.2), st.floats(-7.0, 7.0))
strengths = powers(1e-12, 1e12)


def exact_quadratic(r: Any, c0: float, c1: float) -> Any:
    return r * r + mp.mpf(c1) * r + mp.mpf(c0)


@settings(max_examples=300, deadline=None)
@given(shapes(), ranges | st.none())
def test_the_quadratic_and_the_flux_to_a_few_roundings(shape: Pair, r: float | None) -> None:
    c0, c1 = shape
    # None: the very minimum of Q, where everything but the last digits cancels
    r = max(-c1 / 2, 1e-3) if r is None else r
    with mp.workdps(60):
        q = exact_quadratic(mp.mpf(r), c0, c1)
        flux = 3 / (mp.mpf(r) ** 2 * q)
        least = float(mp.mpf(c0) - mp.mpf(c1) ** 2 / 4)
    assert q > 0
    assert abs(quadratic(r, c0, c1) / float(q) - 1) <= 4 * EPS
    assert abs(object_flux(r, 3.0, c0, c1) / float(flux) - 1) <= 7 * EPS
    assert abs(quadratic_minimum(c0, c1) - least) <= 2 * EPS * abs(least)


@settings(deadline=None)
@given(shapes(), ranges)
def test_slopes_and_distortion(shape: Pair, r: float) -> None:
    """Each within a few roundings of its largest term."""
    c0, c1 = shape
    with mp.workdps(60):
        x = mp.mpf(r)
        q = exact_quadratic(x, c0, c1)
        part = x * (2 * x + mp.mpf(c1)) / q
        flux = 3 / (x**2 * q)
        slope = -2 - part
        top, bottom = 3 * x**2 + 2 * mp.mpf(c1) * x + c0, 4 * x**2 + 3 * mp.mpf(c1) * x + 2 * c0
        large = 4 * x**2 + 3 * abs(c1) * x + 2 * c0
        zeta = top / bottom
        # the relative error of each sum is a rounding of its largest term over the sum
        loss = float(large / abs(top) + large / abs(bottom))
    # 2 r + c1 is rounded once, which counts for as much as its terms
    rounding = 12 * EPS * (2 + float(abs(part) + r * (2 * r + abs(c1)) * EPS / q))
    assert abs(log_slope(r, c0, c1) - float(slope)) <= rounding
    found = object_flux_slope(r, 3.0, c0, c1)
    assert abs(found - float(flux * slope / x)) <= 2 * rounding * float(flux / x)
    if loss < 1e12:
        assert abs(distortion(r, c0, c1) / float(zeta) - 1) <= 8 * EPS * loss


@settings(deadline=None)
@given(shapes(), ranges)
def test_the_slope_is_the_derivative_of_the_flux(shape: Pair, r: float) -> None:
    c0, c1 = shape
    with mp.workdps(80):
        slope = mp.diff(lambda x: 3 / (x**2 * exact_quadratic(x, c0, c1)), mp.mpf(r))
        late = mp.diff(lambda x: 3 / (x * exact_quadratic(x, c0, c1)), mp.mpf(r))
        flux = 3 / (mp.mpf(r) ** 2 * exact_quadratic(mp.mpf(r), c0, c1))
        power, zeta = float(slope * r / flux), late / slope / r
    # a power of b has a slope of b; what is left are roundings of terms up to |b| + 4
    assert abs(log_slope(r, c0, c1) - power) <= 32 * EPS * (4 + abs(power))
    top, bottom = 3 * r**2 + 2 * c1 * r + c0, 4 * r**2 + 3 * c1 * r + 2 * c0
    large = 4 * r**2 + 3 * abs(c1) * r + 2 * c0
    if min(abs(top), abs(bottom)) > 1e-9 * large:
        loss = large / abs(top) + large / abs(bottom)
        assert distortion(r, c0, c1) == pytest.approx(float(zeta), rel=8 * EPS * loss)


@settings(deadline=None)
@given(shapes(), ranges)
def test_the_shadow_and_its_slope(shape: Pair, r: float) -> None:
    c0, c1 = shape
    with mp.workdps(80):
        x = mp.mpf(r)

        def visible(x: Any) -> Any:
            return 1 - mp.mpf(c0) / exact_quadratic(x, c0, c1)

        share, slope = float(visible(x)), float(mp.diff(visible, x))
        scale = c0 * (2 * r + abs(c1)) / float(exact_quadratic(x, c0, c1)) ** 2
        size = r * (r + abs(c1)) / float(exact_quadratic(x, c0, c1))
    assert abs(shadow(r, c0, c1) - share) <= 8 * EPS * size
    assert abs(shadow_slope(r, c0, c1) - slope) <= 12 * EPS * scale
    # not clamped: negative exactly where r < -c1
    assert (shadow(r, c0, c1) < 0) == (r < -c1)


def exact_object(
    r0: float, wave: Pair | None, strength: float, c0: float, c1: float
) -> Callable[[Any, int], Any]:
    def reading(x: Any, which: int) -> Any:
        flux = mp.mpf(strength) / (x**2 * exact_quadratic(x, c0, c1))
        if wave is None:
            return flux * x / r0 if which == 0 else flux
        turn = mp.cos if which == 0 else mp.sin
        return flux * turn(mp.mpf(wave[0]) * x + mp.mpf(wave[1]))

    return reading


def exact_background(
    r0: float, wave: Pair | None, wall: tuple[float, float, float, float]
) -> Callable[[Any, int], Any]:
    strength, far, c0, c1 = wall

    def reading(x: Any, which: int) -> Any:
        visible = strength * (1 - mp.mpf(c0) / exact_quadratic(x, c0, c1))
        if wave is None:
            return visible * far / r0 if which == 0 else visible
        turn = mp.cos if which == 0 else mp.sin
        return visible * turn(mp.mpf(wave[0]) * far + mp.mpf(wave[1]))

    return reading


@settings(deadline=None)
@given(shapes(), ranges, strengths, waves | st.none(), powers(0.15, 150.0))
def test_readings_of_an_object(
    shape: Pair, r: float, strength: float, wave: Pair | None, r0: float
) -> None:
    c0, c1 = shape
    if wave is None and r >= r0:
        r = 0.9 * r0
    with mp.workdps(60):
        exact = exact_object(r0, wave, strength, c0, c1)
        values = [float(exact(mp.mpf(r), which)) for which in (0, 1)]
        steps = [float(r * mp.diff(lambda x, w=w: exact(x, w), mp.mpf(r))) for w in (0, 1)]
    flux = object_flux(r, strength, c0, c1)
    phase = 0.0 if wave is None else wave[0] * r + abs(wave[1])
    found = object_readings(r, r0, wave, strength, c0, c1)
    slopes = object_slopes(r, r0, wave, strength, c0, c1)
    for which in (0, 1):
        # a phase is known to an eps of its terms, the flux to a few
        assert abs(found[which] - values[which]) <= (10 + 2 * phase) * EPS * flux
        size = (4 + abs(log_slope(r, c0, c1)) + phase) * flux
        assert abs(slopes[which] - steps[which]) <= (48 + 2 * phase) * EPS * size


@settings(deadline=None)
@given(shapes(), ranges, strengths, waves | st.none(), powers(0.15, 150.0), st.floats(0.01, 1.0))
def test_readings_of_a_background(
    shape: Pair, r: float, strength: float, wave: Pair | None, r0: float, part: float
) -> None:
    c0, c1 = shape
    wall = (strength, part * r0, c0, c1)
    with mp.workdps(60):
        exact = exact_background(r0, wave, wall)
        values = [float(exact(mp.mpf(r), which)) for which in (0, 1)]
        steps = [float(r * mp.diff(lambda x, w=w: exact(x, w), mp.mpf(r))) for w in (0, 1)]
        q = float(exact_quadratic(mp.mpf(r), c0, c1))
    size = strength * r * (r + abs(c1)) / q
    change = strength * r * c0 * (2 * r + abs(c1)) / q**2
    phase = 0.0 if wave is None else wave[0] * wall[1] + abs(wave[1])
    found = background_readings(r, r0, wave, wall)
    slopes = background_slopes(r, r0, wave, wall)
    for which in (0, 1):
        assert abs(found[which] - values[which]) <= (12 + 2 * phase) * EPS * size
        assert abs(slopes[which] - steps[which]) <= (16 + 2 * phase) * EPS * change


@pytest.mark.parametrize("wave", [None, (0.21, 0.4)])
def test_a_bare_background_is_at_its_full_strength(wave: Pair | None) -> None:
    first, second = background_readings(math.inf, 15.0, wave, (0.8, 3.0, 0.05, 0.01))
    if wave is None:
        assert first == pytest.approx(0.8 * 0.2, rel=2 * EPS)
        assert second == 0.8
    else:
        assert math.hypot(first, second) == pytest.approx(0.8, rel=4 * EPS)
        assert math.atan2(second, first) == pytest.approx(0.21 * 3 + 0.4, rel=4 * EPS)


@pytest.mark.parametrize("ratio", [0.0625, 0.5, 0.999, 1.0, 1.001, 3.0])
def test_the_late_window_saturates_at_the_whole(ratio: float) -> None:
    late, whole = object_readings(2.0 * ratio, 2.0, None, 1.0, 0.1, 0.05)
    assert late / whole == pytest.approx(min(ratio, 1.0), rel=2 * EPS)
    late_slope, slope = object_slopes(2.0 * ratio, 2.0, None, 1.0, 0.1, 0.05)
    # w1 = w2 r / r0 grows by one power of r more, until it is w2 itself
    assert late_slope / late - slope / whole == pytest.approx(1.0 if ratio < 1 else 0.0, abs=1e-14)
    far_late, far = background_readings(0.3, 2.0, None, (1.0, 2.0 * ratio, 0.1, 0.05))
    assert far_late / far == pytest.approx(min(ratio, 1.0), rel=2 * EPS)


readings = st.floats(-1e3, 1e3)
pairs = st.tuples(readings, readings)
variances = st.none() | powers(1e-9, 1e3)


@settings(deadline=None)
@given(st.tuples(strengths, strengths), variances, variances, st.booleans(), pairs, pairs)
@example((1.0, 1.0), 0.5, 0.1, True, (-2.0, 1.0), (1.0, 1.0))
def test_noise_is_a_covariance(
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
    mean: Pair,
    signal: Pair,
) -> None:
    """Against docs/model.md, noise, and positive semidefinite whatever the means."""
    parts = noise_parts(read, shot, relative, pulsed, mean, signal)
    assert min(parts[:3]) >= 0.0
    v1, v2, v12 = covariance(read, shot, relative, pulsed, mean, signal)
    with mp.workdps(60):
        matrix = mp.diag([mp.mpf(read[0]) ** 2, mp.mpf(read[1]) ** 2])
        s = mp.matrix([(relative or 0) * mp.mpf(m) for m in signal])
        matrix += s * s.T
        for i in (0, 1):
            matrix[i, i] += (shot or 0) * abs(mp.mpf(mean[i]))
        if pulsed:
            # the late photons are part of the whole: shared is what the smaller one has
            shared = (shot or 0) * min(abs(mp.mpf(m)) for m in mean)
            matrix[0, 1] += shared
            matrix[1, 0] += shared
        own1, own2, common, s1, s2 = (mp.mpf(part) for part in parts)
        # the parts are a sum of squares, which no rounding makes indefinite
        minor = (own1 + common + s1**2) * (own2 + common + s2**2) - (common + s1 * s2) ** 2
        assert minor >= 0
        assert abs(v1 - matrix[0, 0]) <= 4 * EPS * matrix[0, 0]
        assert abs(v2 - matrix[1, 1]) <= 4 * EPS * matrix[1, 1]
        size = mp.sqrt(matrix[0, 0] * matrix[1, 1])
        assert abs(v12 - matrix[0, 1]) <= 4 * EPS * size


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_an_absent_term_is_a_term_without_effect(kind: str) -> None:
    """To the last bit: what is pruned at compile time is what adds zero."""
    size = {"pulse_width_s": 1e-7} if kind == "pulsed" else {"frequency_hz": 5e6}
    sensor = parse_sensor({"kind": kind, "noise": {"read": [1.0, 1.0]}, **size})
    r = np.append(np.geomspace(0.01, 10.0, 50), [np.inf, np.nan])
    shape, law = np.array([[0.08, -0.1, 0.1]]), np.zeros((1, 8))
    nothing = (None, np.zeros((1, 2))), (None, np.array([[0.0, 3.0, 0.05, 0.01]]))
    found = [
        mean_readings(sensor, Terms(shape, crosstalk, wall, law), r)
        for crosstalk in nothing[0]
        for wall in nothing[1]
    ]
    for other in found[1:]:
        np.testing.assert_array_equal(found[0], other)
    assert np.all(found[0][-2:] == 0.0)
    plain = covariance((1e-3, 2e-3), None, None, kind == "pulsed", (1.0, 2.0), (1.0, 2.0))
    assert plain == covariance((1e-3, 2e-3), 0.0, 0.0, kind == "pulsed", (1.0, 2.0), (1.0, 2.0))


@pytest.mark.parametrize(
    ("limit", "polynomial"),
    [
        # numerators of d/dr of 1/Phi, r0/w1 and q = r0 dw1/dw2, over c0 = 1
        (C1_LIMIT_INTENSITY, lambda c1: [4, 3 * c1, 2]),
        (C1_LIMIT_INTENSITY_W1, lambda c1: [3, 2 * c1, 1]),
        (C1_LIMIT_DIFFERENTIAL, lambda c1: [6, 3 * c1, 1]),
    ],
)
def test_limits_are_those_of_the_discriminant(limit: float, polynomial: Any) -> None:
    for relative, folds in ((1 - 1e-9, False), (1 + 1e-9, True)):
        roots = np.roots(polynomial(limit * relative))
        assert bool(np.all(np.isreal(roots) & (roots.real > 0))) is folds


@pytest.mark.parametrize(
    ("limit", "curve", "falls"),
    [
        (C1_LIMIT_INTENSITY, lambda r, c1: object_flux(r, 1.0, 1.0, c1), True),
        (C1_LIMIT_INTENSITY_W1, lambda r, c1: r * object_flux(r, 1.0, 1.0, c1), True),
        (C1_LIMIT_DIFFERENTIAL, lambda r, c1: r * distortion(r, 1.0, c1), False),
    ],
)
def test_curves_are_monotone_down_to_the_limit_and_no_further(
    limit: float, curve: Callable[[float, float], float], falls: bool
) -> None:
    r = np.linspace(0.3, 2.0, 2001)
    for relative, monotone in ((0.99, True), (1.01, False)):
        values = np.array([curve(x, limit * relative) for x in r.tolist()])
        steps = -np.diff(values) if falls else np.diff(values)
        assert bool(np.all(steps > 0)) is monotone


@settings(deadline=None)
@given(st.lists(shapes(), min_size=1, max_size=4), st.lists(ranges, min_size=1, max_size=3))
def test_arrays_are_the_kernels_element_by_element(shape: list[Pair], r: list[float]) -> None:
    c0, c1 = np.array(shape).T[:, :, None]
    q, flux, share = quadratics(r, c0, c1), object_fluxes(r, 3.0, c0, c1), shadows(r, c0, c1)
    assert q.shape == flux.shape == share.shape == (len(shape), len(r))
    for i, (a, b) in enumerate(shape):
        for j, x in enumerate(r):
            assert q[i, j] == quadratic(x, a, b)
            assert flux[i, j] == object_flux(x, 3.0, a, b)
            assert share[i, j] == shadow(x, a, b)
