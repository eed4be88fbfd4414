"""What errors of the model do to roots, by linear response (docs/model.md, model-error)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.curves import dispatch
from inference.realtime.solving.curves.curve import CurveParameters
from inference.technique import Task
from simulator.compiled import compiled
from simulator.discrepancy import SLOPE_SD
from simulator.model_error import ModelError

__all__ = ["PointError", "model_error_of", "point_error", "sd_of_roots"]

Array = NDArray[np.float64]


class PointError(NamedTuple):
    """Standard deviations of the model's errors at a point, in one unit of length.

    Attributes
    ----------
    flux, flux_slope : float
        Of the flux's relative error and of its slope along log r.
    late, late_slope : float
        Of the error of the effective distance and of its slope along log r [length].
    """

    flux: float
    flux_slope: float
    late: float
    late_slope: float


def model_error_of(task: Task) -> ModelError:
    """Return the model's error that a task answers for: none where its model is exact."""
    if task.exact:
        return ModelError(0.0, 0.0, integrated=False)
    return task.scene.allowed_error


def point_error(task: Task, unit: float) -> PointError:
    """Return the errors of a task at a point, with lengths in a unit [m].

    Value and slope of a stationary process are uncorrelated at one point. A fit takes up most of
    the values, but not of the slopes.
    """
    error = model_error_of(task)
    slope = 0.0 if task.exact else task.scene.model_error.flux * SLOPE_SD
    late = error.range_m / unit
    return PointError(error.flux, slope, late, late * SLOPE_SD)


@compiled
def sd_of_roots(
    kind: int, p: CurveParameters, roots: Array, slopes: Array, error: PointError
) -> Array:
    """Return how far errors of the model move the roots of a curve.

    Parameters
    ----------
    kind : int
        The curve.
    p : CurveParameters
        Its parameters.
    roots, slopes : ndarray, shape (n, m)
        Its roots, nan where there is none, and the slopes of its value there.
    error : PointError
        Sizes of the errors.

    Returns
    -------
    ndarray, shape (n, m)
        Standard deviations in the unit of the roots; nan where there is none.
    """
    n, m = roots.shape
    out = np.full((n, m), np.nan)
    for i in range(n):
        for j in range(m):
            u = roots[i, j]
            if u > 0.0:
                r = dispatch.response(kind, u, p)
                a, b = r.flux * error.flux, r.flux_slope * error.flux_slope
                c, d = r.late * error.late, r.late_slope * error.late_slope
                out[i, j] = math.sqrt(a * a + b * b + c * c + d * d) / abs(slopes[i, j])
    return out
