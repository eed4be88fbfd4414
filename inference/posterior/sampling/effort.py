"""What a population may take: its size, and the moves of its members.

A posterior takes maps that follow its shape, and jumps through them. A few members moved by
differential evolution alone, in straight coordinates, cost a tenth: scouts, which find optima that
a search has missed, and say nothing of how much each of them holds.
"""

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.proposal import log_student, student
from inference.posterior.sampling.reparametrisation import reparametrisation_of

__all__ = ["Effort", "Move", "effort_of", "halfway", "scouts"]

Array = NDArray[np.float64]

_FEWEST = 192  # members of a population that stops on its way

Move = Callable[[Array, Array, np.random.Generator], tuple[Array, Array]]


def _jump(x: Array, _: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Propose coordinates anew, and the log of the proposal's densities' ratio (old to new)."""
    new = student(rng, *x.shape)
    return new, log_student(x) - log_student(new)


def _evolve(
    x: Array,
    others: Array,
    rng: np.random.Generator,
    spread: float = 0.5,
    noise: float = 1e-4,
    hops: float = 0.2,
) -> tuple[Array, Array]:
    """Propose steps along differences of other members (ter Braak 2006), some from mode to mode."""
    n, d = x.shape
    first, second = rng.integers(len(others), size=n), rng.integers(len(others), size=n)
    scale = 2.38 / math.sqrt(2 * d) * np.exp(spread * rng.standard_normal((n, 1)))
    if rng.random() < hops:
        scale = np.ones((n, 1))
    # a map may carry far members beyond all numbers: a step along these is none, and is not taken
    with np.errstate(invalid="ignore"):
        new = x + scale * (others[first] - others[second]) + noise * rng.standard_normal((n, d))
    return new, np.zeros(n)


@dataclasses.dataclass(frozen=True)
class Effort:
    """What a population may take.

    Attributes
    ----------
    size : int
        Members.
    wanted : float
        Accepted moves of each at a temperature, beyond the hottest.
    sweeps : float
        At most, for every accepted move that is wanted.
    moves : tuple of callable
        What is proposed in turn; then maps are fitted anew. Coordinates of the members that move
        and of others, and a source of randomness, to new ones and the log of the ratio of the
        proposal's densities (old to new).
    unbends : bool
        Whether the maps follow a curved shape.
    turned : int
        Temperatures from one at which members are given an alias anew to the next such.
    """

    size: int
    wanted: float
    sweeps: float
    moves: tuple[Move, ...]
    unbends: bool
    turned: int = 1


def effort_of(density: CollapsedDensity) -> Effort:
    """Return what it takes that a population stands for the posterior.

    Where crosstalk and background are confounded, the ends of the sheet that hold a quarter of the
    posterior are a hundredth of it at higher temperatures: a small population loses them, and one
    that hardly moves does not find them again. Half of it is enough for a whole quadratic map.
    """
    d = len(density.parameters)
    easy = reparametrisation_of(density) is None
    size, wanted = (384, 1.0) if easy else (12 * d * (d + 1), 3.0)
    return Effort(size, wanted, 20.0, (_jump, _jump, _jump, _evolve), True)


def halfway(density: CollapsedDensity) -> Effort:
    """Return what it takes to begin rounds of importance draws on the way to a posterior.

    A third of the members where unknowns are many, moved once at every temperature. What they lose
    of the ends of a sheet the wide laws of the rounds find again, or weights without a bound tell.
    """
    d = len(density.parameters)
    size = max(4 * d * (d + 1), min(_FEWEST, 12 * d * (d + 1)))
    return Effort(size, 1.0, 20.0, (_jump, _jump, _jump, _evolve), True)


def scouts(size: int) -> Effort:
    """Return what finds the optima that hold a share of the posterior, and no more.

    An alias anew at every temperature is a third of their evaluations, and no more of them come to
    where the posterior is than with one at every fourth.
    """
    step = functools.partial(_evolve, spread=0.3, noise=0.02, hops=0.0)
    hop = functools.partial(_evolve, noise=0.02, hops=1.0)
    return Effort(size, 1.0, 2.0, (step, step, step, hop), False, turned=4)
