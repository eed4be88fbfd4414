"""How far the data narrow the prior of each unknown."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.posterior.posterior import Identifiability
from simulator.priors import Distribution
from simulator.scene import Stroke

__all__ = ["contractions"]

Array = NDArray[np.float64]


def _status(spread: float, limits: tuple[float, float]) -> str:
    if spread < limits[0]:
        return "identified"
    return "weak" if spread < limits[1] else "not_identified"


def contractions(
    names: tuple[str, ...], z: Array, log_r: Array, range_law: Distribution | Stroke
) -> tuple[Identifiability, ...]:
    """Judge every unknown by its spread in z, where the prior's is one, and the ranges' scale.

    Parameters
    ----------
    names : tuple of str
        Unknowns.
    z : ndarray, shape (n, d)
        Their draws.
    log_r : ndarray, shape (m, frames)
        Draws of log r; nan for a frame without object.
    range_law : Distribution or Stroke
        Prior of a range.

    Returns
    -------
    tuple of Identifiability
        One for every unknown and, where a frame may hold an object, one for ``range_m``.
    """
    rows = []
    for j, name in enumerate(names):
        spread = float(z[:, j].std())
        status = _status(spread, (0.2, 0.7))
        reason = {
            "identified": f"the data narrow the prior to {spread:.2g} of its width",
            "weak": f"the data narrow the prior only to {spread:.0%} of its width",
            "not_identified": "the answer is little more than the prior: more frames, a wider "
            "span of ranges or less noise would be needed",
        }[status]
        rows.append(Identifiability(name, status, 1 - spread**2, reason))
    present = np.isfinite(log_r[0])
    if present.any():
        scale = log_r[:, present].mean(axis=1)
        spread = float(scale.std())
        wide = _log_spread(range_law)
        status = _status(spread, (0.05, 0.3))
        reason = {
            "identified": f"the common scale of the ranges is known to {spread:.2g} of itself",
            "weak": f"the common scale of the ranges is known only to {spread:.0%} of itself",
            "not_identified": "the data leave the common scale of the ranges open: a wider stroke, "
            "or known crosstalk or object, would fix it",
        }[status]
        rows.append(Identifiability("range_m", status, 1 - (spread / wide) ** 2, reason))
    return tuple(rows)


def _log_spread(law: Distribution | Stroke) -> float:
    """Return the prior's standard deviation of log r, from its quantiles."""
    if isinstance(law, Stroke):
        return math.log(law.high / law.low) / math.sqrt(12)
    low, high = law.from_normal(np.array([-1.0, 1.0]))
    return 0.5 * math.log(high / low)
