"""How the law of ranges in the dark follows an error of the flux.

A brighter curve leaves less room in the dark, where the law grows (`inference.frame.dark_mass`).
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.flux_expansion import (
    FluxFunctions,
    add_row,
    add_slopes,
    information_slopes,
)
from inference.frame.arguments import FrameScene, Instrument
from inference.frame.dark_mass import DARK_MASS
from inference.frame.gaussian import precision_product
from inference.frame.mean_readings import readings_along
from inference.frame.range_prior import LEAST_INFORMATION
from inference.frame.table import LOG_RANGE
from simulator.compiled import compiled

__all__ = ["add_dark_slope"]

Array = NDArray[np.float64]


@compiled
def add_dark_slope(
    gradient: Array,
    weight: float,
    table: Array,
    strongest: float,
    scene: FrameScene,
    functions: FluxFunctions,
) -> None:
    """Add what frames in the dark say of the coefficients of the flux error.

    Parameters
    ----------
    gradient : ndarray, shape (functions,)
        Added to.
    weight : float
        Slope of the log likelihood of all frames along the log of the law in the dark.
    table : ndarray, shape (6, knots)
        From `inference.frame.table.tabulate`.
    strongest : float
        Gain factor of the strongest frame, of which the law is made.
    scene : FrameScene
        From `inference.frame.dark_mass.with_dark_mass`; where its law in the dark has no bound
        nothing is added.
    functions : FluxFunctions
        Of which the scene's flux error is made.

    Notes
    -----
    With x = I / I0 the law is inverse to the integral of (1 + x)^(-1/2) over log r.
    """
    dark = scene.range_prior.dark
    if not (weight > 0.0 and dark < 1.0):
        return
    r0, wave, read, shot, _, _ = scene.instrument
    instrument = Instrument(r0, wave, read, shot, None, False)  # that of the table's law
    n = table.shape[1]
    whole = weight * dark / (DARK_MASS * math.sqrt(LEAST_INFORMATION))
    for k in range(n):
        u = table[LOG_RANGE, k]
        width = 0.5 * (table[LOG_RANGE, min(k + 1, n - 1)] - table[LOG_RANGE, max(k - 1, 0)])
        along = readings_along(u, math.exp(u), strongest, scene)
        told = precision_product(along.slope, along.slope, along.mean, along.signal, instrument)
        pushed, turned = information_slopes(along, instrument)
        share = whole * width * (1.0 + told / LEAST_INFORMATION) ** -1.5
        add_row(gradient, functions, u, share * pushed)
        add_slopes(gradient, functions, u, share * turned)
