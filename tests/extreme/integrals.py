"""A frame's integral over its range, enclosed in balls: no rounding and no panel can hide.

The integrand is written once more from docs/model.md for complex balls. Shot noise has kinks where
a mean reading changes its sign: there `acb.integral` halves until they do not matter.
"""

import itertools
import math

from flint import acb, arb, ctx

from simulator.sensor import PulsedSensor
from tests.density.reference import Case, tops_of
from tests.extreme.balls import exact

__all__ = ["certified_log_integral", "condition_of"]

_BITS = 192
_TOLERANCE = 1e-12  # relative
_EVALUATIONS = 20_000  # of the integrand, in one part
_ALL = 60_000  # in all of them
_GRID = 4001
_DECIDED = 1e-9


def certified_log_integral(case: Case) -> arb | None:
    """Enclose the log of a frame's integral over u = log r, with the prior's constant.

    Parameters
    ----------
    case : Case
        The frame, its scene in numbers.

    Returns
    -------
    arb or None
        None where so many evaluations do not enclose it to 1e-9.
    """
    # the interval is parted about the tops, which saves time and changes nothing
    near, heights = zip(*tops_of(case, _GRID), strict=True)
    ctx.prec = _BITS
    c0, c1, c2 = (exact(x) for x in case.c)
    noise = case.sensor.noise
    read = [exact(x) ** 2 for x in noise.read]
    shot, relative = exact(noise.shot), exact(noise.relative)
    y1, y2 = (exact(x) for x in case.reading)
    strength = exact(case.sensor.known_gain) * c0 * c2
    pulsed = isinstance(case.sensor, PulsedSensor)
    if isinstance(case.sensor, PulsedSensor):
        # the sensor's r0 is a rounded number, and it is what the density is of
        wave, offset, r0 = arb(0), arb(0), exact(case.sensor.r0)
    else:
        wave, offset = exact(case.sensor.wave_number), exact(case.sensor.known_phase_rad)
        r0 = arb(1)
    low, high = exact(case.low).log(), exact(case.high).log()
    top = exact(max(heights))
    shift = top + (2 * arb.pi()).log() + (high - low).log()

    left = _ALL

    def integrand(u: acb, analytic: bool) -> acb:
        nonlocal left
        left -= 1
        r = u.exp()
        flux = strength / (r * r * (r * (r + c1) + c0))
        if pulsed:
            o1, o2 = flux * r / r0, flux
        else:
            phase = wave * r + offset
            o1, o2 = flux * phase.cos(), flux * phase.sin()
        m1: acb = o1
        m2: acb = o2
        if case.background is not None:
            wall, distance, s0, s1 = (exact(x) for x in case.background)
            visible = wall * r * (r + s1) / (r * (r + s1) + s0)
            if pulsed:
                m1, m2 = m1 + visible * distance / r0, m2 + visible
            else:
                angle = wave * distance + offset
                m1, m2 = m1 + visible * angle.cos(), m2 + visible * angle.sin()
        if case.crosstalk is not None:
            m1, m2 = m1 + exact(case.crosstalk[0]), m2 + exact(case.crosstalk[1])
        e1, e2 = y1 - m1, y2 - m2
        a1, a2, k = acb(read[0]), acb(read[1]), acb(0)
        if noise.shot > 0:
            n1, n2 = shot * m1.real_abs(analytic), shot * m2.real_abs(analytic)
            k = n1.real_min(n2, analytic) if pulsed else acb(0)
            a1, a2 = a1 + n1 - k, a2 + n2 - k
        d1, d2 = relative * o1, relative * o2
        both = d1 - d2
        determinant = a1 * a2 + k * (a1 + a2) + a2 * d1 * d1 + a1 * d2 * d2 + k * both * both
        across = d2 * e1 - d1 * e2
        square = a2 * e1 * e1 + a1 * e2 * e2 + k * (e1 - e2) ** 2 + across * across
        return (-square / determinant / 2 - shift).exp() * determinant.rsqrt(analytic)

    cuts = {u + sign * 10.0**k for u in near for sign in (-1.0, 1.0) for k in range(-13, 1)}
    start, end = float(low.upper()) + 1e-15, float(high.lower()) - 1e-15
    inner = sorted(u for u in cuts if start < u < end)
    edges = [low, *map(exact, inner), high]
    # from the highest top outward: what counts for little need not be known well
    best = max(zip(heights, near, strict=True))[1]
    parts = sorted(itertools.pairwise(edges), key=lambda ab: abs(float(ab[0] + ab[1]) / 2 - best))
    total = acb(0)
    for a, b in parts:
        enough = max(_TOLERANCE * float(total.real.mid()), 0.0)
        if left <= 0:
            return None
        most = min(_EVALUATIONS, left)
        total += acb.integral(integrand, a, b, rel_tol=_TOLERANCE, abs_tol=enough, eval_limit=most)
    if not float(total.real.rad()) < _DECIDED * float(total.real.mid()):
        return None
    return total.real.log() + top


def condition_of(case: Case, value: float) -> float:
    """Return by how many relative roundings of its readings a log integral moves.

    Readings of D times their noise, each rounded, move e by D roundings of a standard deviation,
    and e^2 / 2, of which the logarithm of L nats is made, by that times sqrt(2 L).
    """
    digits = max(abs(y) / sd for y, sd in zip(case.reading, case.sensor.noise.read, strict=True))
    return 1.0 + abs(value) + float(digits) * (1.0 + math.sqrt(2.0 * abs(value)))
