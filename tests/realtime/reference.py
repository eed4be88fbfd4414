"""A slow, obvious reference: the techniques' equations as docs/model.md has them, in mpmath.

Polynomials go through `mpmath.polyroots` at 80 digits; equations of a sine wave through a dense
scan of their sign (and of their dips) in float64, each crossing bisected at 40 digits.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
from numpy.typing import NDArray

__all__ = ["Case", "forward", "random_case", "reference_roots", "sensitivity"]

LIGHT = mp.mpf(299792458)


@dataclasses.dataclass(frozen=True)
class Case:
    """One random scene in front of one random sensor."""

    technique: str
    pulsed: bool
    r: float
    c0: float
    c1: float
    c2: float
    gain: float
    timing: float  # pulse width [s] or frequency [Hz]
    offset: float
    speed: float
    distance: float = 0.0
    strength: float = 0.0
    c0s: float = 0.0
    c1s: float = 0.0

    @property
    def r0(self) -> Any:
        return LIGHT * mp.mpf(self.timing) / 2

    @property
    def k(self) -> Any:
        return 4 * mp.pi * mp.mpf(self.timing) / LIGHT

    @property
    def has_background(self) -> bool:
        return self.technique.startswith("background")

    @property
    def differential(self) -> bool:
        return self.technique.endswith("differential")

    @property
    def high(self) -> float:
        """Upper end of the technique's interval (docs/http.md, estimates)."""
        limit = math.inf
        if self.has_background:
            limit = self.distance
        if self.pulsed and self.technique not in ("intensity",):
            limit = min(limit, float(self.r0))
        if not self.pulsed and self.technique == "conventional":
            limit = float(2 * mp.pi / self.k)
        if not self.pulsed and self.differential:
            limit = min(limit, float(mp.pi / self.k))
        return limit


def random_case(technique: str, pulsed: bool, rng: np.random.Generator) -> Case:
    """Draw a case: parameters log-uniform, c1 over all of its allowed values."""

    def loguniform(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    while True:
        c0 = loguniform(1e-4, 1e3)
        shape = rng.uniform(-1.99, 2.0) if rng.random() < 0.6 else loguniform(1e-2, 100.0)
        if rng.random() < 0.2:
            shape = rng.uniform(-1.99, -1.6)  # where roots are several
        timing = loguniform(1e-9, 1e-6) if pulsed else loguniform(1e6, 1e8)
        c0s = c0 * float(np.exp(0.5 * rng.standard_normal()))
        shape_s = rng.uniform(0, 0.6) if rng.random() < 0.7 else rng.uniform(-1.9, 3.0)
        distance = loguniform(1.0, 50.0)
        case = Case(
            technique=technique,
            pulsed=pulsed,
            r=loguniform(0.01, 20.0),
            c0=c0,
            c1=shape * math.sqrt(c0),
            c2=loguniform(1e-4, 1.0),
            gain=loguniform(1e-12, 1e12),
            timing=timing,
            offset=0.0 if pulsed else rng.uniform(-3.0, 3.0),
            speed=float(rng.choice([-1, 1])) * loguniform(1e-3, 1e2),
        )
        if case.has_background:
            albedo = loguniform(1e-2, 10.0)
            case = dataclasses.replace(
                case,
                distance=distance,
                strength=case.gain * albedo / (2 * math.pi * distance**2),
                c0s=c0s,
                c1s=shape_s * math.sqrt(c0s),
            )
            if pulsed and distance > 0.999 * float(case.r0):
                continue
            if case.r + case.c1s <= 0:  # a negative background
                continue
        if case.r < 0.999 * case.high:
            return case


def _object(case: Case, r: Any) -> tuple[Any, Any]:
    """Flux times gain, and its derivative."""
    c0, c1 = mp.mpf(case.c0), mp.mpf(case.c1)
    strength = mp.mpf(case.gain) * mp.mpf(case.c2) * c0
    p = r**4 + c1 * r**3 + c0 * r**2
    return strength / p, -strength * (4 * r**3 + 3 * c1 * r**2 + 2 * c0 * r) / p**2


def _background(case: Case, r: Any) -> tuple[Any, Any]:
    if not case.has_background:
        return mp.mpf(0), mp.mpf(0)
    c0, c1, b = mp.mpf(case.c0s), mp.mpf(case.c1s), mp.mpf(case.strength)
    q = r**2 + c1 * r + c0
    return b * (r**2 + c1 * r) / q, b * c0 * (2 * r + c1) / q**2


def forward(case: Case) -> tuple[float, float]:
    """Readings, or their derivatives in time, rounded to doubles."""
    with mp.workdps(60):
        r, far = mp.mpf(case.r), mp.mpf(case.distance)
        flux, change = _object(case, r)
        back, back_change = _background(case, r)
        v = mp.mpf(case.speed)
        if case.pulsed:
            r0 = case.r0
            pair = ((flux * r + back * far) / r0, flux + back)
            if case.differential:
                pair = (
                    v * (change * r + flux + back_change * far) / r0,
                    v * (change + back_change),
                )
        else:
            k, offset = case.k, mp.mpf(case.offset)
            near = mp.expj(k * r + offset)
            away = mp.expj(k * far + offset)
            x = flux * near + back * away
            if case.differential:
                x = v * ((change + 1j * k * flux) * near + back_change * away)
            pair = (x.real, x.imag)
        return float(pair[0]), float(pair[1])


def _polynomial(case: Case, m1: Any, m2: Any) -> list[Any]:
    """Coefficients of a pulse's equation, highest power first (docs/model.md, single-frames)."""
    c0, c1, c2, gain = (mp.mpf(x) for x in (case.c0, case.c1, case.c2, case.gain))
    strength = gain * c2 * c0
    far, b, c0s, c1s = (mp.mpf(x) for x in (case.distance, case.strength, case.c0s, case.c1s))
    r0 = case.r0
    match case.technique:
        case "conventional":
            return [m2, -r0 * m1]
        case "intensity":
            return [m2, m2 * c1, m2 * c0, 0, -strength]
        case "intensity_w1":
            return [r0 * m1, r0 * m1 * c1, r0 * m1 * c0, -strength]
        case "differential":
            return [
                3 * m2,
                2 * c1 * m2 - 4 * r0 * m1,
                c0 * m2 - 3 * c1 * r0 * m1,
                -2 * c0 * r0 * m1,
            ]
        case "background_cancelling":
            d = m2 - r0 / far * m1
            return [d, d * c1, d * c0, strength / far, -strength]
        case "background_intensity":
            w = r0 * m1
            return [
                m2 - b,
                (m2 - b) * c1s - (w - b * far),
                m2 * c0s - c1s * (w - b * far),
                -w * c0s,
            ]
        case _:
            # 4.83 times dW2/dt, so that it stays finite: q -> r0 dW1, 1 -> dW2
            q, one = r0 * m1, m2
            e = (one * far - q) * b * c0s
            k = strength
            n3, n2, n1, n0 = -3 * one, 4 * q - 2 * c1 * one, 3 * c1 * q - c0 * one, 2 * c0 * q
            s = c1s**2 + 2 * c0s
            return [
                2 * e,
                e * (4 * c1 + c1s) + k * n3,
                e * (2 * c1**2 + 4 * c0 + 2 * c1 * c1s) + k * (n2 + 2 * c1s * n3),
                e * (4 * c0 * c1 + c1s * (c1**2 + 2 * c0)) + k * (n1 + 2 * c1s * n2 + s * n3),
                e * (2 * c0**2 + 2 * c0 * c1 * c1s)
                + k * (n0 + 2 * c1s * n1 + s * n2 + 2 * c0s * c1s * n3),
                e * c0**2 * c1s + k * (2 * c1s * n0 + s * n1 + 2 * c0s * c1s * n2 + c0s**2 * n3),
                k * (s * n0 + 2 * c0s * c1s * n1 + c0s**2 * n2),
                k * (2 * c0s * c1s * n0 + c0s**2 * n1),
                k * c0s**2 * n0,
            ]


def _equation(case: Case, m1: Any, m2: Any, lib: Any) -> Callable[[Any], Any]:
    """A sine wave's equation, scaled by positive factors; for mpmath or numpy alike."""
    wide: Callable[[float], Any] = mp.mpf if lib is mp else float
    k, offset = (case.k if lib is mp else float(case.k)), wide(case.offset)
    c0, c1 = wide(case.c0), wide(case.c1)
    strength = wide(case.gain) * wide(case.c2) * c0
    far, b, c0s, c1s = (wide(x) for x in (case.distance, case.strength, case.c0s, case.c1s))
    size = max(abs(m1), abs(m2))
    i, q = m1 / size, m2 / size

    def equation(r: Any) -> Any:
        quad = r * r + c1 * r + c0
        cos, sin = lib.cos(k * r + offset), lib.sin(k * r + offset)
        if case.technique == "differential":
            a = 4 * r * r + 3 * c1 * r + 2 * c0
            # x' is along (-a + j k r Q) e^j(kr + offset), forwards or backwards
            x, y = -a * cos - k * r * quad * sin, -a * sin + k * r * quad * cos
            return x * q - y * i
        if case.technique == "background_cancelling":
            fcos, fsin = lib.cos(k * far + offset), lib.sin(k * far + offset)
            y = q * fcos - i * fsin
            p = r * r * quad
            return y * p + strength / size * lib.sin(k * (far - r))
        qs = r * r + c1s * r + c0s
        if case.technique == "background_intensity":
            return (i * sin - q * cos) * qs + b / size * (r * r + c1s * r) * lib.sin(k * (far - r))
        a = 4 * r * r + 3 * c1 * r + 2 * c0
        fcos, fsin = lib.cos(k * far + offset), lib.sin(k * far + offset)
        back = b / strength * c0s * (2 * r + c1s) * r**3 * quad * quad
        x = (-a * cos - k * r * quad * sin) * qs * qs + back * fcos
        y = (-a * sin + k * r * quad * cos) * qs * qs + back * fsin
        return x * q - y * i

    return equation


def _scan(case: Case, m1: Any, m2: Any, high: float) -> list[Any]:
    wave = float(case.k)
    grid: NDArray[np.float64] = np.unique(
        np.concatenate(
            [
                np.geomspace(1e-7 * high, high, 6000),
                np.linspace(0, high, max(2000, int(80 * wave * high / math.pi)))[1:],
                *(
                    math.sqrt(c) * np.geomspace(0.3, 3.0, 1500)
                    for c in (case.c0, case.c0s)
                    if c > 0
                ),
            ]
        )
    )
    grid = grid[(grid > 0) & (grid <= high)]
    # values fall by powers of r towards zero: only signs and dips count
    fast = _equation(case, float(m1), float(m2), np)
    values = fast(grid) / _scale(case, grid)
    exact = _equation(case, m1, m2, mp)

    def sign(r: Any) -> int:
        return int(mp.sign(exact(mp.mpf(r))))

    signs = np.sign(values)
    doubtful = np.flatnonzero(np.abs(values) < 1e-9 * np.abs(values).max())
    for j in doubtful:  # float64 may have the sign wrong
        signs[j] = sign(grid[j])
    brackets = [
        (mp.mpf(grid[j]), mp.mpf(grid[j + 1])) for j in np.flatnonzero(signs[1:] != signs[:-1])
    ]
    size = np.abs(values)
    dips = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])
    dips &= (signs[1:-1] == signs[:-2]) & (signs[1:-1] == signs[2:])
    for j in np.flatnonzero(dips) + 1:
        low, high_end = mp.mpf(grid[j - 1]), mp.mpf(grid[j + 1])
        side = int(signs[j])

        def depth(r: Any, side: int = side) -> Any:
            return side * exact(r) / mp.mpf(_scale(case, float(r)))

        bottom = _least(depth, low, high_end)
        if sign(bottom) != side:
            brackets += [(low, bottom), (bottom, high_end)]
    return sorted(_bisected(exact, *bracket) for bracket in brackets)


def _scale(case: Case, r: Any) -> Any:
    """Size of the equation's terms, so that a dip is one of a smooth curve."""
    quad = r * r + abs(case.c1) * r + case.c0
    if case.technique == "background_cancelling":
        return r * r * quad
    qs = r * r + abs(case.c1s) * r + case.c0s
    if case.technique == "background_intensity":
        return qs
    plain = (4 * r * r + 2 * case.c0) + float(case.k) * r * quad
    return plain * qs * qs if case.has_background else plain


def _least(function: Callable[[Any], Any], low: Any, high: Any) -> Any:
    share = (3 - mp.sqrt(5)) / 2
    x, y = low + share * (high - low), high - share * (high - low)
    fx, fy = function(x), function(y)
    for _ in range(60):
        if fx <= 0:
            return x
        if fy <= 0:
            return y
        if fx < fy:
            high, y, fy = y, x, fx
            x = low + share * (high - low)
            fx = function(x)
        else:
            low, x, fx = x, y, fy
            y = high - share * (high - low)
            fy = function(y)
    return x if fx < fy else y


def _bisected(function: Callable[[Any], Any], low: Any, high: Any) -> Any:
    return mp.findroot(
        function, (low, high), solver="anderson", tol=mp.mpf(10) ** -50, verify=False
    )


def reference_roots(case: Case, m1: Any, m2: Any, high: float | None = None) -> list[Any]:
    """All roots in the technique's interval, ascending, before physical filters.

    Of `background_intensity` those with a non-negative object, which is part of its equation.
    """
    high = case.high if high is None else high
    with mp.workdps(80 if case.pulsed else 40):
        m1, m2 = mp.mpf(m1), mp.mpf(m2)
        if case.technique == "conventional" and not case.pulsed:
            return [mp.fmod(mp.atan2(m2, m1) - mp.mpf(case.offset) + 4 * mp.pi, 2 * mp.pi) / case.k]
        if case.pulsed or case.technique == "intensity":
            if not case.pulsed:
                m2 = mp.hypot(m1, m2)
            coefficients = _polynomial(case, m1, m2)
            while coefficients and coefficients[0] == 0:
                coefficients = coefficients[1:]
            # in units of a geometric mean root, so that polyroots converges
            unit = mp.mpf(max(case.r, 1e-3))
            scaled = [c * unit ** (len(coefficients) - 1 - n) for n, c in enumerate(coefficients)]
            top = max(abs(c) for c in scaled)
            every = mp.polyroots(
                [c / top for c in scaled[::-1]], maxsteps=2000, extraprec=800, asc=True
            )
            real = [z.real * unit for z in every if abs(z.imag) <= mp.mpf(10) ** -35 * abs(z)]
            roots = sorted(
                r for r in real if 0 < r < high or (r == high and not case.has_background)
            )
        else:
            roots = [r for r in _scan(case, m1, m2, high) if 0 < r < high]
        if case.technique == "background_intensity":
            roots = [r for r in roots if _left(case, r, m1, m2) >= 0]
        return roots


def _left(case: Case, r: Any, m1: Any, m2: Any) -> Any:
    """What background intensity leaves for the object."""
    back, _ = _background(case, r)
    if case.pulsed:
        # of the two readings the one that does not cancel
        return m2 - back
    k, offset = case.k, mp.mpf(case.offset)
    rest = mp.mpc(m1, m2) - back * mp.expj(k * case.distance + offset)
    return (rest * mp.expj(-(k * r + offset))).real


def implied_background(case: Case, r: Any, m1: Any, m2: Any) -> Any:
    """What background cancelling leaves for the background."""
    with mp.workdps(60):
        flux, _ = _object(case, mp.mpf(r))
        if case.pulsed:
            return mp.mpf(m2) - flux
        far = case.k * mp.mpf(case.distance)
        x = mp.mpc(m1, m2) * mp.expj(-(far + mp.mpf(case.offset)))
        return x.real - flux * mp.cos(far - case.k * mp.mpf(r))


def sensitivity(case: Case, r: Any, m1: float, m2: float) -> float:
    """Condition number: relative change of a root for relative changes of the readings."""
    with mp.workdps(60):
        r = mp.mpf(r)
        if case.pulsed or case.technique == "intensity":

            def equation(x: Any, a: Any, b: Any) -> Any:
                if not case.pulsed:
                    b = mp.hypot(a, b)
                return mp.polyval(_polynomial(case, a, b)[::-1], x, asc=True)
        elif case.technique == "conventional":
            return float(
                (abs(mp.mpf(m1) * m2) * 2 / (mp.mpf(m1) ** 2 + mp.mpf(m2) ** 2)) / (case.k * r)
            )
        else:

            def equation(x: Any, a: Any, b: Any) -> Any:
                return _fixed(case, a, b)(x)

        a, b = mp.mpf(m1), mp.mpf(m2)
        step = mp.mpf(10) ** -25
        slope = (equation(r * (1 + step), a, b) - equation(r * (1 - step), a, b)) / (2 * step)
        first = (equation(r, a * (1 + step), b) - equation(r, a * (1 - step), b)) / (2 * step)
        second = (equation(r, a, b * (1 + step)) - equation(r, a, b * (1 - step))) / (2 * step)
        if slope == 0:
            return math.inf
        return float((abs(first) + abs(second)) / abs(slope))


def _fixed(case: Case, a: Any, b: Any) -> Callable[[Any], Any]:
    """Return the sine wave's equation with readings in their own size, for differentiation."""
    size = max(abs(a), abs(b))
    scaled = _equation(case, a, b, mp)
    return lambda r: scaled(r) * size
