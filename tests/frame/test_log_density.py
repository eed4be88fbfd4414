"""The density of a frame along its range, held to 50 digits."""

import dataclasses
import math
from typing import Any

import mpmath
import numpy as np
import pytest

from inference.frame.arguments import (
    Background,
    FrameScene,
    Instrument,
    RangePrior,
    Shape,
)
from inference.frame.blocks import Block, Frame
from inference.frame.gaussian import gaussian, precision_times
from inference.frame.log_density import log_density, slope_and_curvature

EPS = float(np.finfo(float).eps)
CASES = 60


@dataclasses.dataclass(frozen=True)
class Case:
    """A frame, and what `log_density` takes."""

    u: float
    frame: tuple[float, float, float]
    shape: tuple[float, float, float]
    crosstalk: tuple[float, float] | None
    background: tuple[float, float, float, float] | None
    law: tuple[float, float, float, float, float, float, float, float]
    r0: float
    wave: tuple[float, float] | None
    read: tuple[float, float]
    shot: float | None
    relative: float | None

    @property
    def instrument(self) -> Instrument:
        return Instrument(self.r0, self.wave, self.read, self.shot, self.relative)

    @property
    def block(self) -> Block:
        return Block(Frame(*self.frame), None)

    @property
    def scene(self) -> FrameScene:
        return FrameScene(
            Shape(*self.shape),
            self.crosstalk,
            None if self.background is None else Background(*self.background),
            RangePrior(*self.law, resolves=False),
            self.instrument,
            None,
        )


@dataclasses.dataclass(frozen=True)
class Moments:
    """Mean readings, the object's part, covariance: mpmath numbers."""

    mean: Any
    signal: Any
    covariance: Any


def moments(case: Case, u: Any) -> Moments:
    """What docs/model.md, conventions, says of a frame, and docs/model.md, noise, of its noise."""
    mp = mpmath.mp
    r = mp.exp(u)
    strength, c0, c1 = (mp.mpf(x) for x in case.shape)
    gain = mp.mpf(case.frame[2])
    flux = gain * strength / (r**2 * (r**2 + c1 * r + c0))
    if case.wave is None:
        signal = [flux * r / mp.mpf(case.r0), flux]
    else:
        phase = mp.mpf(case.wave[0]) * r + mp.mpf(case.wave[1])
        signal = [flux * mp.cos(phase), flux * mp.sin(phase)]
    mean = list(signal)
    if case.background is not None:
        bright, distance, s0, s1 = (mp.mpf(x) for x in case.background)
        visible = gain * bright * (r**2 + s1 * r) / (r**2 + s1 * r + s0)
        if case.wave is None:
            mean[0] += visible * distance / mp.mpf(case.r0)
            mean[1] += visible
        else:
            phase = mp.mpf(case.wave[0]) * distance + mp.mpf(case.wave[1])
            mean[0] += visible * mp.cos(phase)
            mean[1] += visible * mp.sin(phase)
    if case.crosstalk is not None:
        mean = [m + mp.mpf(x) for m, x in zip(mean, case.crosstalk, strict=True)]
    return Moments(mean, signal, covariance_of(case, mean, signal))


def covariance_of(case: Case, mean: Any, signal: Any) -> Any:
    mp = mpmath.mp
    shot, relative = mp.mpf(case.shot or 0), mp.mpf(case.relative or 0)
    variance = [mp.mpf(s) ** 2 + shot * abs(m) for s, m in zip(case.read, mean, strict=True)]
    # of a pulse the late photons are part of the whole
    common = shot * min(abs(mean[0]), abs(mean[1])) if case.wave is None else mp.mpf(0)
    matrix = mp.matrix([[variance[0], common], [common, variance[1]]])
    for i in range(2):
        for j in range(2):
            matrix[i, j] += relative**2 * signal[i] * signal[j]
    return matrix


def log_normal(residual: Any, matrix: Any, read: tuple[float, float]) -> Any:
    """Log density less that of a zero residual under read noise alone."""
    mp = mpmath.mp
    e = mp.matrix(residual)
    square = (e.T * mp.inverse(matrix) * e)[0]
    top = (mp.mpf(read[0]) * mp.mpf(read[1])) ** 2
    return -square / 2 - mp.log(mp.det(matrix) / top) / 2


def exact(case: Case, u: Any) -> Any:
    mp = mpmath.mp
    at = moments(case, u)
    residual = [mp.mpf(y) - m for y, m in zip(case.frame[:2], at.mean, strict=True)]
    a0, a1, a2, a3, a4, a5 = (mp.mpf(x) for x in case.law[:6])
    r = mp.exp(u)
    prior = a0 + (a1 + 1) * u - ((r - a2) * a3) ** 2 / 2 - ((u - a4) * a5) ** 2 / 2
    return log_normal(residual, at.covariance, case.read) + prior


def random_case(rng: np.random.Generator) -> Case:
    """A frame; half of those with relative noise have it a thousand times above the read noise."""
    c0 = 10 ** rng.uniform(-2, 1)
    c1 = math.sqrt(c0) * rng.uniform(-1.9, 2.0)
    r = 10 ** rng.uniform(-1.5, 0.8)
    flux = 10 ** rng.uniform(-12, 12)
    noise = flux * 10 ** rng.uniform(-5, 0)
    some = rng.random(4) < 0.5
    case = Case(
        u=math.log(r),
        frame=(0.0, 0.0, rng.uniform(0.5, 2.0)),
        shape=(flux * r**2 * (r**2 + c1 * r + c0), c0, c1),
        crosstalk=(flux * rng.normal(), flux * rng.normal()) if some[0] else None,
        background=(
            flux * 10 ** rng.uniform(-1, 1),
            rng.uniform(7.0, 15.0),
            c0 * rng.uniform(0.5, 1.5),
            math.sqrt(c0) * rng.uniform(0.0, 1.0),
        )
        if some[1]
        else None,
        law=(
            rng.normal(),
            rng.choice([-1.0, 0.0]),
            rng.uniform(0.0, 2.0),
            rng.choice([0.0, 3.0]),
            rng.normal(),
            rng.choice([0.0, 2.0]),
            0.0,
            math.inf,
        ),
        r0=15.0,
        wave=None if rng.random() < 0.5 else (rng.uniform(0.05, 5.0), rng.uniform(-3, 3)),
        read=(noise * rng.uniform(0.3, 3.0), noise),
        shot=noise**2 / flux * 10 ** rng.uniform(-1, 2) if some[2] else None,
        relative=noise / flux * 10 ** rng.choice([0.0, 3.0]) if some[3] else None,
    )
    at = moments(case, case.u)
    common = (case.relative or 0.0) * rng.normal()
    first, second = (
        float(m + common * o + size * rng.normal())
        for m, o, size in zip(at.mean, at.signal, case.read, strict=True)
    )
    return dataclasses.replace(case, frame=(first, second, case.frame[2]))


@pytest.fixture
def cases() -> list[Case]:
    rng = np.random.default_rng(20)
    return [random_case(rng) for _ in range(CASES)]


def doubles(at: Moments) -> tuple[Any, Any]:
    return tuple(float(m) for m in at.mean), tuple(float(s) for s in at.signal)


def parts_of(case: Case) -> tuple[Case, Any, Any, Any, Any]:
    """A case's mean, signal and residual in doubles, and the exact covariance of those doubles."""
    mean, signal = doubles(moments(case, case.u))
    residual = (case.frame[0] - mean[0], case.frame[1] - mean[1])
    matrix = covariance_of(case, [mpmath.mpf(m) for m in mean], [mpmath.mpf(s) for s in signal])
    return case, mean, signal, residual, matrix


def condition(matrix: Any) -> float:
    """Condition number of a covariance matrix in units of its own diagonal."""
    correlation = float(matrix[0, 1] ** 2 / (matrix[0, 0] * matrix[1, 1]))
    exact_rest = float(mpmath.det(matrix) / (matrix[0, 0] * matrix[1, 1]))
    return (1 + math.sqrt(correlation)) ** 2 / exact_rest


def test_gaussian(cases: list[Case]) -> None:
    """Residuals have rounding errors of their own: what may be lost is eps times the condition."""
    with mpmath.workdps(50):
        for case in cases:
            _, mean, signal, residual, matrix = parts_of(case)
            found = gaussian(residual, mean, signal, case.instrument)
            wanted = float(log_normal([mpmath.mpf(e) for e in residual], matrix, case.read))
            scaled = [
                abs(e) / math.sqrt(float(matrix[k, k])) for k, e in enumerate(residual)
            ]  # of the size of the residual, in the noise of each reading by itself
            lost = math.hypot(*scaled) * math.sqrt(condition(matrix) * (abs(wanted) + 1))
            assert found == pytest.approx(wanted, abs=64 * EPS * (1 + abs(wanted) + lost))


def test_precision_times(cases: list[Case]) -> None:
    with mpmath.workdps(50):
        for case in cases:
            _, mean, signal, residual, matrix = parts_of(case)
            found = precision_times(residual, mean, signal, case.instrument)
            wanted = mpmath.inverse(matrix) * mpmath.matrix([mpmath.mpf(e) for e in residual])
            # errors measured in the matrix's own units, like the residual
            sizes = [math.sqrt(float(matrix[k, k])) for k in range(2)]
            length = math.hypot(*(e / size for e, size in zip(residual, sizes, strict=True)))
            for k in range(2):
                bound = 32 * EPS * condition(matrix) * length / sizes[k]
                assert found[k] == pytest.approx(float(wanted[k]), abs=bound)


def amplification(case: Case) -> tuple[float, float]:
    """Relative rounding of the mean in noise units, and the distance of the reading in them."""
    at = moments(case, case.u)
    r = math.exp(case.u)
    _, c0, c1 = case.shape
    turn = case.wave[0] * r if case.wave is not None else 0.0
    if case.wave is not None and case.background is not None:
        turn += case.wave[0] * case.background[1]
    steep = 4 + abs(r * (2 * r + c1) / (r * (r + c1) + c0)) + turn + abs(case.u)
    sizes = [math.sqrt(float(at.covariance[k, k])) for k in range(2)]
    share = [abs(c) for c in case.crosstalk] if case.crosstalk else [0.0, 0.0]
    extra = case.background[0] * case.frame[2] if case.background else 0.0
    flux = math.hypot(*(float(s) for s in at.signal))
    mean = max((flux + extra + x) / size for x, size in zip(share, sizes, strict=True))
    return EPS * steep * mean * math.sqrt(condition(at.covariance)), math.sqrt(
        condition(at.covariance)
    )


def test_log_density(cases: list[Case]) -> None:
    """What may be lost: the rounding of the mean readings, seen through the noise."""
    with mpmath.workdps(50):
        for case in cases:
            found = log_density(case.u, case.block, case.scene)
            wanted = float(exact(case, mpmath.mpf(case.u)))
            loss, _ = amplification(case)
            chi = math.sqrt(2 * abs(wanted)) + 4
            assert found == pytest.approx(wanted, abs=32 * (loss * chi + EPS * (1 + abs(wanted))))


def test_most_digits_are_right_where_the_noise_is_plain(cases: list[Case]) -> None:
    with mpmath.workdps(50):
        errors = [
            abs(log_density(c.u, c.block, c.scene) - float(exact(c, mpmath.mpf(c.u))))
            for c in cases
        ]
    assert np.median(errors) < 1e-11


def has_kink_near(case: Case) -> bool:
    """Whether shot noise has a kink of its variance within the steps of a difference."""
    if case.shot is None:
        return False
    for du in (-1e-6, 1e-6):
        here, there = moments(case, case.u), moments(case, case.u + du)
        for k in range(2):
            if here.mean[k] * there.mean[k] <= 0:
                return True
        order = [abs(m.mean[0]) - abs(m.mean[1]) for m in (here, there)]
        if case.wave is None and order[0] * order[1] <= 0:
            return True
    return False


@pytest.mark.parametrize("displaced", [0.0, 1e-3])
def test_slope(cases: list[Case], displaced: float) -> None:
    """Against a 50-digit derivative of the whole density, covariance varying with the range."""
    seen = {"shot": 0, "relative": 0, "pulsed": 0, "sine wave": 0}
    errors = []
    with mpmath.workdps(50):
        for given in cases:
            case = dataclasses.replace(given, u=given.u + displaced)
            if has_kink_near(case):
                continue
            slope, curvature = slope_and_curvature(case.u, case.block, case.scene)
            wanted = float(mpmath.diff(lambda u, c=case: exact(c, u), mpmath.mpf(case.u)))
            loss, root = amplification(case)
            # the slope is a product of the residual and the curve's own slope in noise units
            chi = math.sqrt(2 * abs(float(exact(case, mpmath.mpf(case.u))))) + 4
            pace = math.sqrt(curvature) + chi * root + 4
            bound = 128 * (loss * pace * root + EPS * root * chi * pace)
            assert slope == pytest.approx(wanted, abs=bound + 1e-11 * abs(wanted))
            errors.append(abs(slope - wanted) / (chi * pace))
            seen["shot"] += case.shot is not None
            seen["relative"] += case.relative is not None
            seen["pulsed" if case.wave is None else "sine wave"] += 1
    assert min(seen.values()) > CASES / 5
    assert np.median(errors) < 1e-12


def test_curvature_is_that_of_the_mean_at_fixed_covariance(cases: list[Case]) -> None:
    """t^T V^-1 t of the derivative t of the mean, and what the prior adds."""
    with mpmath.workdps(50):
        for case in cases:
            u = mpmath.mpf(case.u)
            slope = mpmath.matrix(
                [mpmath.diff(lambda x, k=k, c=case: moments(c, x).mean[k], u) for k in range(2)]
            )
            matrix = moments(case, u).covariance
            prior = case.law[5] ** 2 + (math.exp(case.u) * case.law[3]) ** 2
            wanted = float((slope.T * mpmath.inverse(matrix) * slope)[0]) + prior
            found = slope_and_curvature(case.u, case.block, case.scene)[1]
            sizes = [math.sqrt(float(matrix[k, k])) for k in range(2)]
            length = math.hypot(*(float(s) / w for s, w in zip(slope, sizes, strict=True)))
            loss, root = amplification(case)
            bound = 64 * (loss * root + EPS * length * root * 8) * (length * root + 1)
            assert found == pytest.approx(wanted, abs=bound, rel=1e-11)
            assert found >= 0


def test_relative_noise_far_above_the_read_noise_cancels_in_the_ratio() -> None:
    """Along the object's signal a reading is free; across it the read noise decides alone."""
    signal, relative = (3.0, 4.0), 1e4
    instrument = Instrument(1.0, None, (1e-6, 1e-6), None, relative)
    along = gaussian((0.3, 0.4), signal, signal, instrument)
    none = gaussian((0.0, 0.0), signal, signal, instrument)
    across = gaussian((-4e-6, 3e-6), signal, signal, instrument)
    # (0.1 / relative)^2 / 2 along, 5^2 / 2 across
    assert none - along == pytest.approx(0.5e-10, abs=1e-11)
    assert none - across == pytest.approx(12.5, rel=1e-9)
