"""Aliases of a sine wave's wall: distances that differ by whole turns of its phase.

Readings know a wall by its strength and its phase. A distance R and R + n c / (2 f) give the same
readings to the last digit; they differ by their prior, and by which ranges lie before the wall. So
one mode is as many as its prior has turns, of any weight, each as narrow as the first and farther
from it than any search or step reaches. Known one, the others follow (docs/model.md, aliases).
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.start import Optimum, refine
from simulator.parameters import Parameters
from simulator.priors import Distribution

__all__ = ["Aliases", "aliases_of", "with_aliases"]

Array = NDArray[np.float64]

_REACH = 6.0  # standard deviations of a prior: beyond, it has a billionth
_BULK = 3.0  # standard deviations that hold all but a few thousandths
_TURNS = 1000  # either way, among which the likeliest are chosen
_MOST = 128  # of one optimum
_RAREST = 1e-5  # of the likeliest alias's prior density: those of less are left to the move


@dataclasses.dataclass(frozen=True, eq=False)
class Aliases:
    """What takes a point to another alias of its wall.

    Attributes
    ----------
    column : int
        Of the wall's distance.
    law : Distribution
        Its prior, by itself.
    turn_m : float
        Distance of a whole turn of phase, c / (2 f).
    """

    parameters: Parameters
    column: int
    law: Distribution
    turn_m: float

    @property
    def are_too_many(self) -> bool:
        """Whether a mixture of them leaves out aliases that hold a share of the posterior."""
        low, high = self.law.from_normal(np.array([-_BULK, _BULK]))
        return bool(high - low > _MOST * self.turn_m)

    def distances(self, z: Array) -> Array:
        """Return the wall's distances at z of shape (n, d) [m], shape (n,)."""
        return np.asarray(self.parameters.natural(z)[:, self.column])

    def moved(self, z: Array, to_m: Array) -> tuple[Array, Array]:
        """Return z with other distances, and by how much that stretches z.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Points.
        to_m : ndarray, shape (n,)
            Other distances of their walls.

        Returns
        -------
        ndarray, shape (n, d)
            Not finite where the prior has no such distance.
        ndarray, shape (n,)
            Log of the determinant of the new z by the old, at a fixed number of turns.
        """
        t = self.parameters.marginal(z).copy()
        t[:, self.column] = self.parameters.unknowns[self.column].to_normal(to_m, {})
        law = self.parameters.law
        stretch = self._log_rate(to_m) - self._log_rate(self.distances(z))
        return (t if law is None else law.joint(t)), stretch

    def _log_rate(self, distance_m: Array) -> Array:
        """Return log dt/dx of the coordinate t in which the prior of x is standard normal."""
        with np.errstate(invalid="ignore", over="ignore"):
            normal = -0.5 * self.law.to_normal(distance_m) ** 2
            return np.asarray(self.law.log_density(distance_m) - normal)

    def _log_share(self, distance_m: Array) -> Array:
        """Return the log of the prior mass to which a distance is the nearest of its aliases."""
        half = self.turn_m / 2
        return self.law.log_mass(distance_m - half, distance_m + half)

    def propose(
        self, z: Array, random: np.random.Generator | np.random.RandomState
    ) -> tuple[Array, Array]:
        """Propose for every point the alias that is nearest to a draw of the wall's prior.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Points of positive density.
        random : numpy.random.Generator or numpy.random.RandomState
            Source of randomness; emcee brings a RandomState.

        Returns
        -------
        ndarray, shape (n, d)
            Finite.
        ndarray, shape (n,)
            Log of the ratio of the proposal's densities, old to new; minus infinity where there is
            no such alias, or it is that of the point.
        """
        old = self.distances(z)
        drawn = self.law.from_normal(random.standard_normal(len(z)))
        with np.errstate(invalid="ignore", over="ignore"):
            turns = np.round((drawn - old) / self.turn_m)
            new = old + turns * self.turn_m
            proposed, stretch = self.moved(z, new)
            ratio = self._log_share(old) - self._log_share(new) + stretch
        real = (turns != 0) & np.isfinite(proposed).all(axis=1) & np.isfinite(ratio)
        return np.where(real[:, None], proposed, z), np.where(real, ratio, -np.inf)

    def of_optimum(self, density: CollapsedDensity, optimum: Optimum) -> list[Optimum]:
        """Return the aliases of an optimum that its wall's prior allows, itself left out.

        Parameters
        ----------
        optimum : Optimum
            One of its maxima.

        Returns
        -------
        list of Optimum
            Those of less than a hundred thousandth of the likeliest one's prior density are left
            out.
        """
        found = self._copies(density, optimum)
        if not found:
            return []
        # an optimum at an end of the prior, or before ranges, is narrower than its aliases
        best = max(found, key=lambda alias: alias.log_mass)
        climbed = refine(density, best.z)
        if climbed is None or self._apart(climbed, best) > self.turn_m / 2:
            return found
        copies = self._copies(density, climbed)
        others = [copy for copy in copies if self._apart(copy, optimum) > self.turn_m / 2]
        return [climbed, *others]

    def _apart(self, one: Optimum, other: Optimum) -> float:
        """Return how far the walls of two optima are apart [m]."""
        return float(abs(np.diff(self.distances(np.array([one.z, other.z])))[0]))

    def _copies(self, density: CollapsedDensity, optimum: Optimum) -> list[Optimum]:
        """Return an optimum in all other turns, as wide in metres as it is."""
        here = float(self.distances(optimum.z[None])[0])
        low, high = (float(x) for x in self.law.from_normal(np.array([-_REACH, _REACH])))
        first = max(math.ceil((low - here) / self.turn_m), -_TURNS)
        last = math.floor(min((high - here) / self.turn_m, _TURNS))
        places = here + self.turn_m * np.arange(first, last + 1)
        prior = self.law.log_density(places)
        best = np.argsort(-prior, kind="stable")[: _MOST + 1]
        places = places[best[prior[best] > prior[best[0]] + math.log(_RAREST)]]
        places = places[places != here]
        if not places.size:
            return []
        z, stretch = self.moved(np.tile(optimum.z, (len(places), 1)), places)
        heights = density(np.where(np.isfinite(z), z, 0.0))
        found = []
        for place, scale, height in zip(z, np.exp(stretch), heights, strict=True):
            if np.isfinite(place).all() and np.isfinite(height):
                found.append(Optimum(place, float(height), self._scaled(optimum.factor, scale)))
        return found

    def _scaled(self, factor: Array, scale: float) -> Array:
        """Return a triangular factor after the distance's coordinate alone was stretched."""
        d, law = len(factor), self.parameters.law
        stretch = np.ones(d)
        stretch[self.column] = scale
        if law is None:
            return stretch[:, None] * factor
        t = stretch[:, None] * (law.mixing @ factor)  # all three are lower triangular
        return np.asarray(np.tril(law.joint(t.T).T))


def aliases_of(density: CollapsedDensity) -> Aliases | None:
    """Return what takes a point of a density to its aliases.

    Parameters
    ----------
    density : CollapsedDensity
        Of any scene.

    Returns
    -------
    Aliases or None
        None of a pulse, without a wall of unknown distance, and where its prior lies within a turn.
    """
    parameters = density.parameters
    if "background.distance_m" not in parameters.names:
        return None
    wave = density.instrument.wave
    if wave is None:
        return None
    column = parameters.names.index("background.distance_m")
    law = parameters.unknowns[column].law
    if law is None:
        raise ValueError("the distance of a wall has a prior of its own")
    turn_m = 2 * math.pi / wave[0]
    low, high = law.from_normal(np.array([-_REACH, _REACH]))
    return Aliases(parameters, column, law, turn_m) if high - low > turn_m else None


def with_aliases(
    aliases: Aliases, density: CollapsedDensity, optima: list[Optimum]
) -> list[Optimum]:
    """Add the aliases of optima to them.

    Parameters
    ----------
    aliases : Aliases
        Of the density.
    optima : list of Optimum
        Maxima of it.

    Returns
    -------
    list of Optimum
        The best first; aliases that hold less than a hundred thousandth of the best are left out.
    """
    most = max(optimum.log_mass for optimum in optima)
    found = list(optima)
    for optimum in optima:
        for alias in aliases.of_optimum(density, optimum):
            rare = alias.log_mass < most + math.log(_RAREST)
            if not rare and not any(other.is_near(alias.z) for other in found):
                found.append(alias)
    return sorted(found, key=lambda optimum: -optimum.log_density)
