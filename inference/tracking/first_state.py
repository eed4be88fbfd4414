"""The state of a tracker before any frame."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.tracking.evenness import ROUGH, hides
from inference.tracking.hypotheses import (
    ANCHOR,
    CROSSTALK1,
    RESTING,
    STILL,
    TOLD22,
    Hypotheses,
)
from inference.tracking.parts import MOST_PARTS, is_open
from inference.tracking.roots import Root, add_factor
from inference.tracking.settings import TrackingSettings
from inference.tracking.state import TrackState
from inference.tracking.unsteady import first_unsteady
from inference.tracking.without_object import tell_all
from simulator.scene import Scene

__all__ = ["crosstalk_bounds", "first_state"]

Array = NDArray[np.float64]

_BEYOND = 4.0  # standard deviations, beyond which crosstalk lies once in 16,000


def first_state(
    scene: Scene,
    settings: TrackingSettings,
    directions: int,
    crosstalk: Array | None,
    crosstalk_root: Array,
    scale: Array,
    untold: tuple[bool, bool],
    steady: bool,
) -> TrackState:
    """Return the state before any frame.

    Parameters
    ----------
    scene, settings : Scene, TrackingSettings
        The scene and how objects come and go.
    directions : int
        Number of uncertain directions that are carried along.
    crosstalk : ndarray, shape (2,), or None
        Where the crosstalk begins, in units of the read noise; None where it is not learnt.
    crosstalk_root : ndarray, shape (2, k)
        Its change along every direction in which a posterior spreads, in the same units; k is 0
        where there is no posterior, and its prior holds.
    scale : ndarray, shape (2,)
        From readings to units of the read noise.
    untold : (bool, bool)
        Of which of the two readings nothing but the scene's prior tells the crosstalk.
    steady : bool
        Whether changes from frame to frame are held to the noise.
    """
    n = 2 if crosstalk is None else 4
    x, X = np.zeros((1, n)), np.zeros((1, n, n + directions))
    if crosstalk is not None:
        x = np.zeros((1, ANCHOR + 1))
        x[0, CROSSTALK1:ANCHOR] = crosstalk
        values = scene.crosstalk_values
        if crosstalk_root.size:
            # of its own, so that it can be learnt: its correlation with other unknowns is left out
            upper = np.asarray(np.linalg.qr(crosstalk_root.T, mode="r"))
            X[0, CROSSTALK1:, CROSSTALK1 : CROSSTALK1 + len(upper)] = upper.T
        if values is not None:
            for k, value in enumerate(values):
                state = CROSSTALK1 + k
                if untold[k] and not isinstance(value, float | int):
                    mean, sd = _moments(value.distribution().from_normal)
                    x[0, state], X[0, state, state] = mean * scale[k], sd * scale[k]
    # an object before crosstalk that is open comes in many parts
    parts = MOST_PARTS if crosstalk is not None and is_open(_spread(X[0])) else 0
    rows = 1 + max(settings.hypotheses, parts)
    x, X = (np.concatenate([a, np.zeros((rows - 1, *a.shape[1:]))]) for a in (x, X))
    weight = np.zeros(rows)
    there = settings.visit_s / (settings.visit_s + settings.absence_s)
    weight[0] = 1.0 - there
    numbers = [math.nan, there, 1.0, 0.0, 0.0, ROUGH, 0.0]
    numbers += [math.nan, math.nan, math.inf, math.inf, 0.0, 0.0, 0.0]
    numbers += [0.0] * (TOLD22 + 1 - STILL)
    if steady:
        numbers += first_unsteady(directions)
    first = Hypotheses(x, X, weight, np.array(numbers))
    first.numbers[RESTING] = float(crosstalk is not None and hides(first, 0))
    if crosstalk is not None:
        tell_all(first)
    return TrackState(first)


def crosstalk_bounds(
    scene: Scene, settings: TrackingSettings, untold: tuple[bool, bool]
) -> Array | None:
    """Return between what learnt crosstalk is as its prior says, but for once in 16,000.

    Of a law that is not normal, also as far as the normal law reaches by which it is learnt.

    Parameters
    ----------
    scene, settings, untold : Scene, TrackingSettings, (bool, bool)
        As for `first_state`.

    Returns
    -------
    ndarray, shape (2, 2), or None
        Least and largest of either reading [reading units], infinite where no prior tells it; None
        where none does, and where the crosstalk is stated to drift: it may then go anywhere.
    """
    values = scene.crosstalk_values
    if values is None or not any(untold) or settings.crosstalk_drift is not None:
        return None
    bounds = np.tile([-math.inf, math.inf], (2, 1))
    for k, value in enumerate(values):
        if untold[k] and not isinstance(value, float | int):
            from_normal = value.distribution().from_normal
            mean, sd = _moments(from_normal)
            low, high = from_normal(np.array([-_BEYOND, _BEYOND])).tolist()
            bounds[k] = min(low, mean - _BEYOND * sd), max(high, mean + _BEYOND * sd)
    return bounds


def _spread(X: Array) -> Root:
    """Return the root of the covariance of the crosstalk of one hypothesis."""
    root = Root(0.0, 0.0, 0.0)
    for first, second in X[CROSSTALK1:].T.tolist():
        root = add_factor(root, first, second)
    return root


def _moments(from_normal: Any) -> tuple[float, float]:
    """Return mean and standard deviation of a prior given by its map from the standard normal."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    values = from_normal(nodes)
    weights = weights / weights.sum()
    mean = float(weights @ values)
    return mean, math.sqrt(float(weights @ (values - mean) ** 2))
