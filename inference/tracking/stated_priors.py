"""Priors of object and gain that a tracker takes: light that is known to a factor of two.

A tracker carries along what is not known of a scene as an error that all frames share, to first
order. That holds for priors that leave the light open by little; of wide ones, which leave it open
by an order of magnitude, nothing would be right but by chance.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.nuisance import Nuisance
from inference.tracking.remedies import remedy
from simulator.errors import RefusedError, listed
from simulator.object_arrays import object_fluxes
from simulator.parameters import Terms
from simulator.scene import Scene

__all__ = ["check_carried"]

Array = NDArray[np.float64]

_FACTOR = 2.0  # by which light may be unknown at any range, a standard deviation up or down
_PLACES = 65


def check_carried(scene: Scene, known: Nuisance, positions: Array) -> None:
    """Refuse priors that leave the light open by more than first order carries.

    The light of an object is the gain times c0 c2 / (r^2 (r^2 + c1 r + c0)); half the difference of
    its logarithms a standard deviation up and down is how far each direction leaves it open, and
    their squares add up.

    Parameters
    ----------
    scene : Scene
        The scene.
    known : Nuisance
        What is carried along.
    positions : ndarray, shape (n,)
        log r, ascending, where objects may be.

    Raises
    ------
    RefusedError
        Then.
    """
    count = len(known.carried)
    if count == 0:
        return
    r = np.exp(np.linspace(positions[0], positions[-1], _PLACES))
    ends = zip(known.plus[-count:], known.minus[-count:], strict=True)
    with np.errstate(all="ignore"):
        half = [0.5 * (_log_light(plus, r) - _log_light(minus, r)) for plus, minus in ends]
        open_by = np.sqrt(np.sum(np.square(half), axis=0))
        at = int(np.argmax(np.where(np.isnan(open_by), np.inf, open_by)))
    if open_by[at] <= math.log(_FACTOR):
        return
    with np.errstate(over="ignore"):
        factor = float(np.exp(open_by[at]))
    by = f"a factor of {factor:.3g}" if factor < 1e3 else "orders of magnitude"
    raise RefusedError(
        f"{listed(known.carried)} unknown, by {by} of the light at {r[at]:.3g} m, one standard "
        f"deviation: a tracker takes narrower priors, to {_FACTOR:g}; "
        f"{remedy(scene, known.carried)}"
    )


def _log_light(terms: Terms, r: Array) -> Array:
    c0, c1, c2 = terms.object[0].tolist()
    gain = 1.0 if terms.gain is None else float(terms.gain[0])
    return np.asarray(np.log(object_fluxes(r, c0, c0, c1)) + np.log(c2) + np.log(gain))
