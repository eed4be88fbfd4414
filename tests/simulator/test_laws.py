"""Laws far out in their tails and under every cut, against mpmath and quadrature."""

import itertools
import math
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from simulator.priors import (
    Distribution,
    HalfNormal,
    LogNormal,
    LogUniform,
    Normal,
    NormalDistribution,
    Prior,
    TruncatedNormal,
    Uniform,
)

EPS = float(np.finfo(float).eps)
LAWS: dict[str, Prior] = {
    "uniform": Uniform(low=-1.0, high=3.0),
    "loguniform": LogUniform(low=0.02, high=20.0),
    "normal": Normal(mean=1.0, sd=2.0),
    "halfnormal": HalfNormal(sd=0.5),
    "lognormal": LogNormal(median=0.1, sigma=2.0),
    "truncated_normal": TruncatedNormal(mean=0.0, sd=1.0, low=3.0, high=5.0),
}
STANDARD = NormalDistribution(log=False, loc=0.0, scale=1.0, low=-math.inf, high=math.inf)
LOWS = [-math.inf, -40.0, -8.0, -1.0, 0.0, 1.0, 8.0, 40.0, 1e4]
CUTS = [(a, a + w) for a in LOWS[1:] for w in (1e-3, 1.0, 10.0, math.inf)]
CUTS += [(-math.inf, b) for b in LOWS[1:]]


def share(a: Any, b: Any) -> Any:
    """Return Phi(b) - Phi(a), by mpmath, with all of its digits in both tails."""
    if a > 0:
        return share(-b, -a)
    return (mp.erfc(-b / mp.sqrt(2)) - mp.erfc(-a / mp.sqrt(2))) / 2


def rounding_of_log_mass(a: float, b: float) -> float:
    """Bound what rounding does to log(Phi(b) - Phi(a)).

    It is made of two logarithms of up to t^2 / 2, each known to an eps of itself, and their
    difference loses a factor 1 - exp(-gap).
    """
    near = 0.0 if a <= 0 <= b else min(abs(a), abs(b))
    with mp.workdps(40):
        whole = share(-mp.inf, b) if a < -b else share(a, mp.inf)
        kept = float(share(a, b) / whole)
    return 8 * EPS * (1 + near**2) / kept


@pytest.mark.parametrize(("low", "high"), CUTS)
def test_log_mass_in_the_tails(low: float, high: float) -> None:
    with mp.workdps(40):
        exact = float(mp.log(share(mp.mpf(low), mp.mpf(high))))
    assert abs(float(STANDARD.log_mass(low, high)) - exact) <= rounding_of_log_mass(low, high)


@pytest.mark.parametrize(("low", "high"), CUTS)
def test_quantiles_of_a_cut_normal(low: float, high: float) -> None:
    """A quantile t solves share(low, t) = Phi(z) share(low, high): its residual, as an error of t.

    Rounding moves t by its own eps, and by the error of a log probability over the hazard.
    """
    z = np.array([-30.0, -8.0, -3.0, -0.5, 0.0, 0.5, 3.0, 8.0, 30.0])
    found = STANDARD.from_normal(z, low, high)
    assert np.all((found >= low) & (found <= high) & np.isfinite(found))
    assert np.all(np.diff(found) >= 0)
    rounding = rounding_of_log_mass(low, high)
    for t, variate in zip(found.tolist(), z.tolist(), strict=True):
        with mp.workdps(60):
            whole = share(mp.mpf(low), mp.mpf(high))
            if variate < 0:
                tail = share(mp.mpf(low), mp.mpf(t))
                residual = tail - share(-mp.inf, mp.mpf(variate)) * whole
                behind = share(-mp.inf, mp.mpf(t))
            else:
                tail = share(mp.mpf(t), mp.mpf(high))
                residual = tail - share(mp.mpf(variate), mp.inf) * whole
                behind = share(mp.mpf(t), mp.inf)
            density = mp.npdf(t)
            off = abs(float(residual / density))
            hazard = float(min(behind, tail + share(-mp.inf, low) + share(high, mp.inf)) / density)
        scale = 1 + abs(t) + (0 if math.isinf(low) else abs(low))
        scale += 0 if math.isinf(high) else abs(high)
        # scipy's ndtri_exp is good to 6e-13 between 50 and 1e5 standard deviations
        library = 1e-12 * abs(t) if abs(t) > 50 else 0.0
        bound = 16 * EPS * scale + hazard * (rounding + 8 * EPS * (1 + t * t)) + library
        assert off <= bound, (t, variate)


@pytest.mark.parametrize("name", LAWS)
def test_every_law_and_every_cut_of_it_integrates_to_one(name: str) -> None:
    law = LAWS[name].distribution()
    cuts = [(-math.inf, math.inf)]
    points = law.from_normal(np.array([-1.0, 0.3, 4.0])).tolist()
    cuts += [*itertools.combinations(points, 2), (-math.inf, points[0]), (points[2], math.inf)]
    for cut in cuts:
        part = law.truncated(*cut)
        knots = part.from_normal(np.linspace(-9.0, 9.0, 13))

        def density(u: float, part: Distribution = part) -> float:
            if part.log:
                return math.exp(part.log_density(math.exp(u)) + u)
            return math.exp(part.log_density(u))

        total = sum(
            integrate.quad(density, a, b, epsabs=1e-13)[0]
            for a, b in itertools.pairwise(np.log(knots) if part.log else knots)
        )
        # 1e-18 lies beyond the last knots; quad promises 1.5e-8 of each of 12 parts
        assert total == pytest.approx(1.0, abs=12 * 1.5e-8)
        inside = float(part.from_normal(0.0))
        ratio = float(part.log_density(inside) - law.log_density(inside))
        assert ratio == pytest.approx(-float(law.log_mass(*cut)), rel=1e-12, abs=1e-12)


@settings(deadline=None)
@given(
    st.sampled_from(sorted(LAWS)),
    st.floats(-6.0, 6.0),
    st.floats(-3.0, 2.5),
    st.floats(0.4, 5.0),
)
def test_coordinates_are_inverse_under_any_cut(
    name: str, z: float, start: float, width: float
) -> None:
    law = LAWS[name].distribution()
    low, high = law.from_normal(np.array([start, start + width])).tolist()
    x = law.from_normal(z, low, high)
    assert low <= x <= high
    again = float(law.to_normal(x, low, high))
    # x carries an eps of the support's largest number; its coordinate, that over dx/dz
    slope = (
        float(law.from_normal(z + 1e-4, low, high) - law.from_normal(z - 1e-4, low, high)) / 2e-4
    )
    reach = max(abs(low), abs(high)) * (
        1 + abs(getattr(law, "loc", 0.0)) + getattr(law, "scale", 1.0)
    )
    # a probability near 1/2 is known to an eps of 1 from either side, over the density at z
    other = 1e-12 * (1 + abs(z))
    assert abs(again - z) <= 64 * EPS * reach / max(slope, 1e-300) + other


@pytest.mark.parametrize("name", LAWS)
def test_ends_of_the_support(name: str) -> None:
    law = LAWS[name].distribution()
    far = law.from_normal(np.array([-np.inf, -38.0, 38.0, np.inf]))
    assert np.all((far >= law.low) & (far <= law.high))
    np.testing.assert_allclose(far[[0, -1]], [law.low, law.high], rtol=8 * EPS)
    ends = law.to_normal(np.array([law.low, law.high]))
    assert ends.tolist() == [-math.inf, math.inf]
    outside = np.array([-np.inf, -1e308, law.low - 1.0, law.high + 1.0, 1e308, np.nan])
    inside = (outside >= law.low) & (outside <= law.high)
    assert np.all(np.isneginf(law.log_density(outside)[~inside]))
    assert np.all(np.isneginf(law.log_density(np.array([-np.inf, np.inf]))))


def test_a_law_of_the_logarithm_below_zero() -> None:
    for name in ("loguniform", "lognormal"):
        law = LAWS[name].distribution()
        assert np.all(np.isneginf(law.log_density(np.array([-1.0, -0.0, 0.0]))))
        assert np.all(np.isneginf(law.log_mass(np.array([-3.0, -3.0]), np.array([-1.0, 0.0]))))
        assert float(law.log_mass(-3.0)) == pytest.approx(0.0, abs=4 * EPS)


def test_extreme_laws_overflow_without_a_warning() -> None:
    z = np.array([-3.0, 0.0, 3.0])
    wide = NormalDistribution(log=True, loc=math.log(1e300), scale=1e3, low=0.0, high=math.inf)
    assert wide.from_normal(z).tolist() == [0.0, pytest.approx(1e300, rel=1e-12), math.inf]
    far = NormalDistribution(log=False, loc=1.7e308, scale=1e308, low=-math.inf, high=math.inf)
    assert far.from_normal(3.0) == math.inf
    narrow = NormalDistribution(log=False, loc=0.0, scale=1e-320, low=-1.0, high=1.0)
    assert np.all(np.isfinite(narrow.from_normal(z)))
    assert float(narrow.log_density(0.5)) == -math.inf


def test_ends_that_are_found_once_are_each_law_s_own() -> None:
    """Asked in turn, with one pair of bounds for all values or one for each."""
    x = np.concatenate([np.linspace(-1.0, 5.0, 41), [0.0, 1e-30, 19.0, 1e30]])
    laws = [prior.distribution() for prior in LAWS.values()]
    wider = HalfNormal(sd=0.7).distribution()
    cuts = [(-math.inf, math.inf), (0.0, math.inf), (3.1, 4.9), (3.1, 4.8)]
    for law, (low, high) in [*itertools.product([*laws, wider], cuts)] * 2:
        each = law.to_normal(x, np.full(x.size, low), np.full(x.size, high))
        np.testing.assert_array_equal(law.to_normal(x, low, high), each)
