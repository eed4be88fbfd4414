"""What an answer owes to the default priors of the object: they are those of a diffuse one.

Where a scene says nothing of the object it may as well be glossy (`simulator.glossy`): what is told
is a mixture of the draws and of what they would be then. What the readings tell by themselves stays
where it is.
"""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.posterior.criticism.prior_sensitivity import PriorSensitivity
from simulator.glossy import glossy_move
from simulator.scene import Scene

__all__ = ["GlossyObject", "glossy_object"]

Array = NDArray[np.float64]

_OPEN = 0.05  # of a probability, and of one less it
_WORDS = (
    "were the object glossy (probability {:.0%}) it would move by {{:.1f}} standard deviations of "
    "what was drawn: a stated prior of object.c0 decides"
)


@dataclasses.dataclass(frozen=True, eq=False)
class GlossyObject:
    """How an answer changes where the object may be glossy.

    Attributes
    ----------
    probability : float
        Of a glossy object, given the readings.
    moves : PriorSensitivity
        By what means move where it is.
    """

    probability: float
    moves: PriorSensitivity

    @property
    def of_z(self) -> Array:
        """By what means move, and by a standard normal error, whether it is: shape (d, 2)."""
        return self._mixed(self.moves.of_z)

    @property
    def of_log_r(self) -> Array:
        """Likewise of log r, shape (frames, 2); zero for a frame without object."""
        return self._mixed(self.moves.of_log_r)

    def _mixed(self, moved: Array) -> Array:
        p = self.probability
        return np.outer(moved, [p, math.sqrt(p * (1.0 - p))])

    @property
    def open(self) -> PriorSensitivity | None:
        """What hangs on whether it is glossy; None where that is all but certain."""
        return self.moves if _OPEN < self.probability < 1.0 - _OPEN else None


def glossy_object(
    scene: Scene, names: tuple[str, ...], z: Array, log_r: Array
) -> GlossyObject | None:
    """Mix draws with what they would be if the object were glossy, at even odds.

    The priors of both differ by their middles alone, and so densities by the factor
    ``exp(a z - a² / 2)``, a the difference [standard deviations]. Draws follow it as those of a
    normal law do: means by their covariance with a z (exponential tilting). Weights would be those
    of a few draws in the tail.

    Parameters
    ----------
    scene : Scene
        As sampled.
    names : tuple of str
        Of the unknowns.
    z : ndarray, shape (n, d)
        Draws of equal weight, in the coordinates whose prior is standard normal.
    log_r : ndarray, shape (n, frames)
        Their ranges; nan for a frame without object.

    Returns
    -------
    GlossyObject or None
        None where what is stated of it says whether it is.
    """
    move, present = glossy_move(scene, names), np.isfinite(log_r[0])
    if move is None or not present.any():
        return None
    gain = z @ move
    columns = np.concatenate([z, np.where(present, log_r, 0.0)], axis=1)
    moved = (gain - gain.mean()) @ (columns - columns.mean(axis=0)) / len(z)
    odds = gain.mean() + 0.5 * gain.var() - 0.5 * float(move @ move)
    probability = float(scipy.special.expit(odds))
    sd, sd_of_scale, d = z.std(axis=0), log_r[:, present].mean(axis=1).std(), z.shape[1]
    moves = PriorSensitivity(
        np.divide(moved[:d], sd, out=np.zeros(d), where=sd > 0),
        float(moved[d:][present].mean() / sd_of_scale) if sd_of_scale > 0 else 0.0,
        moved[:d],
        moved[d:],
        _WORDS.format(probability),
    )
    return GlossyObject(probability, moves)
