"""An object at rest before unknown crosstalk: drawn from the prior, and crosstalk to fit it.

Frames that all read the same tell two numbers, and a scene has several unknowns. Whatever object
there is, wherever it stands, crosstalk takes up what its light leaves of the readings. Given the
crosstalk, the ranges that explain the frames are points of a curve, for a sine wave one with
several turns, and the posterior is a sheet with as many folds, which no map of weighted draws
followed. With the range among what is drawn there is no sheet: object and range come from the
prior, which such frames narrow little, and crosstalk from around what is left (docs/model.md,
from-the-prior).
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, special

from inference.density.collapsed import CollapsedDensity
from inference.frame.blocks import GAIN, RANGE
from inference.frame.gaussian import log_top
from inference.frame.light_of_vectors import light_of_vectors
from inference.frame.noise import covariances, whiteners
from inference.posterior.sampling.by_weight import systematic
from inference.posterior.sampling.importance import (
    MAX_K_HAT,
    WeightedDraws,
    log_ratio,
    pareto_k_hat,
)
from simulator.priors import Distribution

__all__ = ["AtRest", "at_rest", "drawn_from_the_prior"]

Array = NDArray[np.float64]

_FIRST = 20_000  # tried at once: they tell how many more it takes
_MOST = 500_000  # tried: a second
# times the effective size wanted, of what is tried: at least, and where that is to be had
_LEAST, _SPARE = 2.0, 10.0
_KEPT = 5.0  # times it, that are kept: each costs as much as a hundred that are tried
_WIDER = 1.3  # than the noise of the frames' mean: readings may err together
_SHARES = (0.1, 0.9)  # of crosstalk that is drawn around what is left, the rest from its prior


@dataclasses.dataclass(frozen=True, eq=False)
class AtRest:
    """Frames of an object at one unknown range before unknown crosstalk.

    Attributes
    ----------
    density : CollapsedDensity
        With the range integrated out.
    columns : ndarray of int, shape (2,)
        Of the crosstalks among the unknowns.
    laws : tuple of Distribution
        Their priors.
    range_law : Distribution
        That of the range.
    gain : float
        Factor on the light, the same for all frames.
    mean : ndarray, shape (2,)
        Of the readings.
    scatter : ndarray, shape (2, 2)
        Rows whose squares add up as those of the readings about their mean.
    """

    density: CollapsedDensity
    columns: NDArray[np.int64]
    laws: tuple[Distribution, Distribution]
    range_law: Distribution
    gain: float
    mean: Array
    scatter: Array

    def log_likelihood(self, whole: Array, light: Array) -> Array:
        """Return log p(frames | their mean readings, of which ``light`` is the object's part).

        Parameters
        ----------
        whole, light : ndarray, shape (n, 2)
            [reading units].

        Returns
        -------
        ndarray, shape (n,)
        """
        instrument, n = self.density.instrument, len(self.density.frames)
        white = whiteners(instrument, whole, light)
        rows = [math.sqrt(n) * (self.mean - whole), *self.scatter[:, None]]
        square = sum(
            (white[:, 0, 0] * row[:, 0]) ** 2
            + (white[:, 1, 0] * row[:, 0] + white[:, 1, 1] * row[:, 1]) ** 2
            for row in rows
        )
        size = np.log(white[:, 0, 0] * instrument.read[0])
        size += np.log(white[:, 1, 1] * instrument.read[1])
        return np.asarray(n * (log_top(instrument.read) + size) - 0.5 * square)

    def tried(self, rng: np.random.Generator, count: int) -> tuple[Array, Array]:
        """Draw unknowns and a range, and weight them.

        Returns
        -------
        (ndarray, ndarray)
            z, shape (m, d), m of them no more than ``count``, and the log of target over law,
            shape (m,): others have no weight.
        """
        parameters, instrument = self.density.parameters, self.density.instrument
        z = rng.standard_normal((count, len(parameters)))
        log_weight = parameters.log_prior(z) + 0.5 * np.einsum("ij,ij->i", z, z)
        r = self.range_law.from_normal(rng.standard_normal(count))
        terms = parameters.terms(z)
        light = light_of_vectors(self.density.rows(terms), r, self.gain, instrument)
        assert terms.crosstalk is not None  # noqa: S101  # both are unknown
        left, crosstalk = self.mean - light, terms.crosstalk.copy()
        good = np.isfinite(log_weight) & np.isfinite(left).all(axis=1)
        z, log_weight, light, left, crosstalk = (
            one[good] for one in (z, log_weight, light, left, crosstalk)
        )
        noise = covariances(instrument, np.broadcast_to(self.mean, light.shape), light)
        for j, (column, law) in enumerate(zip(self.columns, self.laws, strict=True)):
            sd = _WIDER * np.sqrt(noise[:, j, j] / len(self.density.frames))
            low, high = law.from_normal(np.array([-1.0, 1.0]))
            share = np.clip((high - low) / (high - low + sd), *_SHARES)
            around = rng.uniform(size=len(z)) < share
            x = np.where(around, left[:, j] + sd * rng.standard_normal(len(z)), crosstalk[:, j])
            by_prior = law.log_density(x)
            by_left = -0.5 * ((x - left[:, j]) / sd) ** 2 - np.log(sd) - 0.5 * math.log(2 * math.pi)
            by_both = np.logaddexp(np.log1p(-share) + by_prior, np.log(share) + by_left)
            log_weight += log_ratio(by_prior, by_both)
            crosstalk[:, j], z[:, column] = x, law.to_normal(x)
        good = np.isfinite(log_weight) & np.isfinite(z).all(axis=1)
        whole = crosstalk[good] + light[good]
        return z[good], log_weight[good] + self.log_likelihood(whole, light[good])


def at_rest(density: CollapsedDensity) -> AtRest | None:
    """Return the frames of an object at one unknown range before unknown crosstalk.

    Parameters
    ----------
    density : CollapsedDensity
        Its unknowns, its frames and the sensor.

    Returns
    -------
    AtRest or None
        None where frames tell more than two numbers: they have several ranges, or one of which
        something is known, several gains, or some hold no object; where crosstalk is known, or its
        prior not its own; and before a background.
    """
    parameters, frames = density.parameters, density.frames
    names, law = list(parameters.names), parameters.range_prior
    columns = [names.index(name) for name in parameters.crosstalk or () if name in names]
    if len(columns) != 2 or parameters.has_background or parameters.law is not None:
        return None
    if density.data.blocks != 1 or not density.holds.all() or frames.shape[1] != RANGE:
        return None
    gains, laws = frames[:, GAIN], [parameters.unknowns[column].law for column in columns]
    own = [one for one in laws if one is not None]
    if np.ptp(gains) > 0 or len(own) != 2 or not isinstance(law, Distribution):
        return None
    readings = frames[:, :GAIN]
    mean = readings.mean(axis=0)
    scatter: Array = linalg.qr(readings - mean, mode="r")[0][:2]
    gain = float(gains[0])
    return AtRest(density, np.array(columns), (own[0], own[1]), law, gain, mean, scatter)


def drawn_from_the_prior(
    rest: AtRest, rng: np.random.Generator, wanted: float
) -> tuple[WeightedDraws | None, int]:
    """Draw by importance until so many effective draws are reached, if that is in sight.

    Parameters
    ----------
    rest : AtRest
        From `at_rest`.
    wanted : float
        Effective size.

    Returns
    -------
    (WeightedDraws or None, int)
        None where the prior is so much wider than the posterior that it takes too long, or weights
        cannot be trusted; with the density evaluations that it took. What is kept of small weights
        has an equal one, so that few draws are carried on; k-hat is that of all.
    """
    z, log_weights = rest.tried(rng, _FIRST)
    size = _effective(log_weights)
    if not _LEAST * wanted * _FIRST < size * _MOST:
        return None, 0
    tried = min(math.ceil(_SPARE * wanted / size), _MOST // _FIRST) * _FIRST
    found = [(z, log_weights), *(rest.tried(rng, _FIRST) for _ in range(tried // _FIRST - 1))]
    z, log_weights = (np.concatenate(part) for part in zip(*found, strict=True))
    every = np.full(tried, -np.inf)
    every[: len(z)] = log_weights
    k_hat = pareto_k_hat(every)
    if not k_hat < MAX_K_HAT:
        return None, 0
    total = float(special.logsumexp(log_weights))
    kept, weights = _evened(np.exp(log_weights - total), math.ceil(_KEPT * wanted), rng)
    z = z[kept]
    # the target leaves out the norm of the standard normal
    evidence = total - math.log(tried) + 0.5 * z.shape[1] * math.log(2 * math.pi)
    draws = WeightedDraws(z, rest.density(z), weights, k_hat, evidence)
    return (draws if draws.worth >= wanted else None), len(z)


def _effective(log_weights: Array) -> float:
    """Return an effective sample size; 0 of none."""
    return 1.0 / float(np.sum(special.softmax(log_weights) ** 2)) if log_weights.size else 0.0


def _evened(weights: Array, count: int, rng: np.random.Generator) -> tuple[NDArray[np.intp], Array]:
    """Return which draws are kept, about so many, and their new weights, which add up to one.

    Draws below a weight stay with a probability in proportion to theirs and get that one, the
    others stay as they are: so every weight is what it was in the mean (Fearnhead and Clifford
    2003).
    """
    order = np.argsort(weights)[::-1]
    ordered = weights[order]
    rest = np.cumsum(ordered[::-1])[::-1]  # weight of each and all below
    room = count - np.arange(len(ordered))
    fits = (room > 0) & (ordered * room <= rest)
    if len(ordered) <= count or not fits.any():
        return order, ordered / ordered.sum()
    first = int(np.argmax(fits))
    chosen = first + systematic(ordered[first:], int(room[first]), rng)
    kept = np.concatenate([np.arange(first), chosen])
    evened = np.concatenate([ordered[:first], np.full(room[first], rest[first] / room[first])])
    return order[kept], evened / evened.sum()
