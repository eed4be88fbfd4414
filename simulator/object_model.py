"""The Object Parameter Model, its derivatives, and when its curves have a single root.

K = c0 c2 (times a gain), Q = r^2 + c1 r + c0, P = r^2 Q, Phi_obj = K / P (docs/model.md,
conventions).
"""

import math

from simulator.compiled import compiled

__all__ = [
    "C1_LIMIT_DIFFERENTIAL",
    "C1_LIMIT_INTENSITY",
    "C1_LIMIT_INTENSITY_W1",
    "distortion",
    "log_slope",
    "object_flux",
    "object_flux_slope",
    "quadratic",
    "quadratic_minimum",
]


# least c1 / sqrt(c0) for which a curve is monotone (docs/model.md, 4.1, 4.4 and 4.68)
C1_LIMIT_INTENSITY = -math.sqrt(32 / 9)
C1_LIMIT_INTENSITY_W1 = -math.sqrt(3)
C1_LIMIT_DIFFERENTIAL = -math.sqrt(8 / 3)

_SPLIT = 134217729.0  # 2^27 + 1, Dekker's splitting constant


@compiled
def quadratic_minimum(c0: float, c1: float) -> float:
    """Return c0 - c1^2/4, the least value of Q over all real r, without cancellation.

    Near the pole limit c1 -> -2 sqrt(c0) the difference loses every digit that the rounding of
    c1^2 leaves, so the square is taken exactly (Dekker's two-product).
    """
    half = 0.5 * c1
    big = _SPLIT * half
    high = big - (big - half)
    low = half - high
    square = half * half
    rest = ((high * high - square) + 2.0 * high * low) + low * low
    return (c0 - square) - rest


@compiled
def quadratic(r: float, c0: float, c1: float) -> float:
    """Return Q = r^2 + c1 r + c0 [m^2] without cancellation (r >= 0)."""
    if c1 >= 0.0:
        return r * (r + c1) + c0
    shifted = r + 0.5 * c1
    return shifted * shifted + quadratic_minimum(c0, c1)


@compiled
def object_flux(r: float, strength: float, c0: float, c1: float) -> float:
    """Return strength / (r^2 Q); strength = gain c0 c2 gives the reading w2 or the modulus.

    Parameters
    ----------
    r : float
        Range [m], positive.
    strength : float
        K = gain c0 c2.
    c0, c1 : float
        Object parameters [m^2], [m].
    """
    return strength / r / r / quadratic(r, c0, c1)


@compiled
def log_slope(r: float, c0: float, c1: float) -> float:
    """Return d log Phi / d log r = -(4 r^2 + 3 c1 r + 2 c0) / Q (docs/model.md, 4.13)."""
    return -2.0 - r * (2.0 * r + c1) / quadratic(r, c0, c1)


@compiled
def object_flux_slope(r: float, strength: float, c0: float, c1: float) -> float:
    """Return d Phi / d r [reading units / m]."""
    return object_flux(r, strength, c0, c1) * log_slope(r, c0, c1) / r


@compiled
def distortion(r: float, c0: float, c1: float) -> float:
    """Return zeta = (3 r^2 + 2 c1 r + c0) / (4 r^2 + 3 c1 r + 2 c0) (docs/model.md, 4.19).

    zeta r = r0 dw1 / dw2 for an object that moves radially; it is 1 + 1/b for a power law r^b.
    """
    return (r * (3.0 * r + 2.0 * c1) + c0) / (r * (4.0 * r + 3.0 * c1) + 2.0 * c0)
