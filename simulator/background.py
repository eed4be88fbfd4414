"""A uniform background and the shadow that the object casts on it.

Phi_bg = B S(r), S = (r^2 + c1' r) / (r^2 + c1' r + c0'); docs/model.md, 3.30.
"""

from simulator.compiled import compiled
from simulator.object_model import quadratic

__all__ = ["shadow", "shadow_slope"]


@compiled
def shadow(r: float, c0: float, c1: float) -> float:
    """Return the share S of the background that an object at range r leaves visible.

    Negative for c1' < 0 and r < -c1': such ranges are not physical, and S is never clamped.

    Parameters
    ----------
    r : float
        Range of the object [m].
    c0, c1 : float
        Shadow parameters c0' [m^2], c1' [m].
    """
    return r * (r + c1) / quadratic(r, c0, c1)


@compiled
def shadow_slope(r: float, c0: float, c1: float) -> float:
    """Return dS/dr = c0' (2 r + c1') / Q'^2 [1/m] (docs/model.md, 4.83)."""
    q = quadratic(r, c0, c1)
    return c0 * (2.0 * r + c1) / q / q
