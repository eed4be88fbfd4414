"""What is foreseen at values drawn from the priors, beside that at their medians.

Light grows and shrinks with the unknowns: what a median lets readings tell, many other values of a
wide prior may not.
"""

import dataclasses
import math
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from inference.identifiability.expected_posterior import expected_posterior
from inference.identifiability.experiment import Experiment
from inference.identifiability.judged import Spread, judged
from inference.identifiability.status import STATUSES

__all__ = ["Elsewhere", "drawn", "elsewhere", "outside"]

Array = NDArray[np.float64]

_DRAWS = 8
_SHARE = 0.75  # of the draws that are as good as what is foreseen, or better
_SEED = 0  # of the draws: the same question has the same answer


@dataclasses.dataclass(frozen=True, eq=False)
class Elsewhere:
    """What is foreseen at n draws of the priors.

    Attributes
    ----------
    spreads : ndarray, shape (n, d + 1)
        Of all unknowns, "range_m" last.
    statuses : ndarray of int, shape (n, d + 1)
        Places in `STATUSES`, where the best is the first.
    texts : tuple of tuple of str
        What is said of each.
    """

    spreads: Array
    statuses: NDArray[np.intp]
    texts: tuple[tuple[str, ...], ...]

    def counts(self, row: int) -> dict[str, int]:
        """Return how many draws have a parameter at each status."""
        found = np.bincount(self.statuses[:, row], minlength=len(STATUSES)).tolist()
        return dict(zip(STATUSES, found, strict=True))

    def quarter(self, row: int) -> int | None:
        """Return the draw than which a quarter of the draws tell a parameter worse; None of none.

        By status, then by spread.
        """
        n = len(self.texts)
        best_first = np.lexsort((self.spreads[:, row], self.statuses[:, row]))
        return int(best_first[math.ceil(_SHARE * n) - 1]) if n else None

    def status(self, row: int) -> int:
        """Return the status that three draws of four reach; the best where there are no draws."""
        one = self.quarter(row)
        return 0 if one is None else int(self.statuses[one, row])


def drawn(z: Array, open_: Collection[int]) -> Array:
    """Return values of the unknowns drawn from their priors.

    A Latin hypercube (McKay, Beckman and Conover 1979): each unknown has one value in every eighth
    of its prior.

    Parameters
    ----------
    z : ndarray, shape (d,)
        Values of reference, where the priors are standard normal.
    open_ : collection of int
        Which of them are drawn; the others stay.

    Returns
    -------
    ndarray, shape (n, d)
        No rows where nothing is drawn.
    """
    columns = sorted(open_)
    if not columns:
        return np.zeros((0, z.size))
    rng, shape = np.random.default_rng(_SEED), (_DRAWS, len(columns))
    eighths = rng.permuted(np.broadcast_to(np.arange(_DRAWS)[:, None], shape), axis=0)
    found = np.tile(z, (_DRAWS, 1))
    found[:, columns] = ndtri((eighths + rng.random(shape)) / _DRAWS)
    return found


def outside(experiment: Experiment) -> NDArray[np.intp]:
    """Return the frames whose ranges the scene does not allow."""
    ranges, prior = np.exp(experiment.log_r), experiment.range_prior
    inside = (ranges >= prior.low * (1 - 1e-12)) & (ranges <= prior.high * (1 + 1e-12))
    return np.flatnonzero(np.isfinite(experiment.log_r) & ~inside)


def elsewhere(experiment: Experiment, draws: Array, asked: int | None = None) -> Elsewhere:
    """Foresee what the same frames tell of other unknowns.

    Parameters
    ----------
    experiment : Experiment
        At the values of reference.
    draws : ndarray, shape (n, k)
        Other values of the first k unknowns, see `drawn`: the offset of odometry, which is the
        last, stays where the ranges have it.
    asked : int, optional
        How many frames, the first, have ranges that are asked for; left out: all.

    Returns
    -------
    Elsewhere
        Without draws that do not allow the ranges, or whose numbers overflow.
    """
    spreads, statuses, texts = [], [], []
    for z in draws:
        there = dataclasses.replace(experiment, z=np.append(z, experiment.z[z.size :]))
        if outside(there).size or not there.finite:
            continue
        posterior = expected_posterior(there, asked)
        spread = Spread(posterior.sd, posterior.scale_sd)
        rows = judged(there, spread, posterior)
        spreads.append([*spread.parameters.tolist(), spread.scale])
        statuses.append([STATUSES.index(each.status) for each in rows])
        texts.append(tuple(each.text for each in rows))
    shape = (len(texts), experiment.z.size + 1)
    return Elsewhere(
        np.array(spreads, dtype=float).reshape(shape),
        np.array(statuses, dtype=np.intp).reshape(shape),
        tuple(texts),
    )
