"""The law of ranges that a frame does not tell apart: together they are one state.

Readings of an object that is far enough away are those of an empty scene, wherever it is. Where
readings tell ranges apart a reference prior has the mass of one standard deviation of the readings
along every standard deviation of their curve; where they do not, only the law says how much room
there is. Had it more than readings know of it, a scene whose crosstalk alone explains some frames
would be the more probable by a factor for each of them (docs/model.md, reference-prior).
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import FrameScene, RangePrior
from inference.frame.range_prior import LEAST_INFORMATION, log_range_density
from inference.frame.table import LOG_PRIOR, LOG_RANGE
from simulator.compiled import compiled

__all__ = ["DARK_MASS", "with_dark_mass"]

Array = NDArray[np.float64]

DARK_MASS = math.sqrt(2.0 * math.pi * math.e)
"""Mass of all ranges in the dark together, where that of a standard deviation is one.

The expected log density of a reading is then the same whether its object is in the dark or on the
straight curve: exp(-1/2) / sqrt(2 pi) times this is one.
"""

_NONE = 1e-9  # of the law: what is less of it does not move a mode


@compiled
def _darken(table: Array, flat: float) -> float:
    """Return the law in the dark, and give it to a table where the law there is one."""
    n = table.shape[1]
    share = np.empty(n)
    mass = 0.0
    for k in range(n):
        share[k] = math.exp(flat - table[LOG_PRIOR, k])
        if k > 0:
            width = table[LOG_RANGE, k] - table[LOG_RANGE, k - 1]
            mass += 0.5 * width * (share[k] + share[k - 1])
    mass *= math.sqrt(LEAST_INFORMATION)
    if not mass > DARK_MASS:
        return 1.0
    dark = DARK_MASS / mass
    for k in range(n):
        if share[k] > _NONE:
            table[LOG_PRIOR, k] += math.log1p((dark - 1.0) * share[k] * share[k])
    return dark


@compiled
def with_dark_mass(table: Array, scene: FrameScene) -> FrameScene:
    """Return a scene whose law of the ranges holds no more in the dark than one state has.

    Parameters
    ----------
    table : ndarray, shape (6, knots)
        From `inference.frame.table.tabulate`; its log prior is changed likewise.
    scene : FrameScene
        The parameters it was made of; without a reference prior they come back as they are.

    Returns
    -------
    FrameScene

    Notes
    -----
    With x = I / I0, `LEAST_INFORMATION`, the law is (x + k) / sqrt(1 + x): the root of the
    information where that is large, k in the dark. Of sqrt(1 + x) = x / sqrt(1 + x)
    + 1 / sqrt(1 + x) the second part is the dark's; k is one, or what leaves it `DARK_MASS`.
    """
    constant, power, mean, inverse_sd, log_mean, log_inverse_sd, low, high, resolves, _ = (
        scene.range_prior
    )
    dark = 1.0
    if resolves:
        dark = _darken(table, log_range_density(1.0, 0.0, scene.range_prior))
    return FrameScene(
        scene.shape,
        scene.crosstalk,
        scene.background,
        RangePrior(
            constant,
            power,
            mean,
            inverse_sd,
            log_mean,
            log_inverse_sd,
            low,
            high,
            resolves,
            dark,
        ),
        scene.instrument,
        scene.flux_error,
        scene.offset,
    )
