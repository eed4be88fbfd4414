"""The joint law of unknowns as coordinates: independent, of mean zero and variance one."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from simulator.joint import Joint
from simulator.scipy_later import scipy
from simulator.unknowns import Unknown, Values

__all__ = ["JointLaw", "joint_law"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class JointLaw:
    """From coordinates z to t, one an unknown, of mean 0 and variance 1 each under their prior.

    t = mixing z. Where the law has one mode, z is standard normal.

    Attributes
    ----------
    names : tuple of str
        The unknowns that it names.
    mean, sd : ndarray, shape (d,)
        Of the unknowns in the coordinates of their independent priors; 0 and 1 of those that the
        law does not name.
    mixing : ndarray, shape (d, d)
        Lower triangular, its rows of length one.
    weights : ndarray, shape (modes,)
        Of the modes; empty where there is one.
    centres, factors : ndarray, shape (modes, d) and (modes, d, d)
        Mean of each mode in z, and the Cholesky factor of its covariance.
    """

    names: tuple[str, ...]
    mean: Array
    sd: Array
    mixing: Array
    weights: Array
    centres: Array
    factors: Array

    def marginal(self, z: Array) -> Array:
        """Return t, shape (n, d)."""
        return np.asarray(z @ self.mixing.T)

    def joint(self, t: Array) -> Array:
        """Inverse of `marginal`; what is at the end of a support, or beyond, has no finite z."""
        solved = scipy.linalg.solve_triangular(self.mixing, t.T, lower=True, check_finite=False)
        return np.asarray(solved.T)

    def unknown(self, j: int, of: Unknown) -> Unknown:
        """Return unknown number j as a function of its t: the law is inside its support anyway."""
        mean, sd = float(self.mean[j]), float(self.sd[j])

        def from_normal(t: Array, values: Values) -> Array:
            return of.from_normal(mean + sd * t, values)

        def to_normal(x: Array, values: Values) -> Array:
            return (of.to_normal(x, values) - mean) / sd

        return Unknown(of.name, from_normal, to_normal, law=of.law)

    def with_another(self) -> "JointLaw":
        """Return the law with one more unknown, independent of all others, as the last."""
        d, modes = self.mean.size + 1, self.weights.size
        mixing, factors = np.eye(d), np.tile(np.eye(d), (modes, 1, 1))
        mixing[:-1, :-1], factors[:, :-1, :-1] = self.mixing, self.factors
        mean, sd = np.append(self.mean, 0.0), np.append(self.sd, 1.0)
        centres = np.concatenate([self.centres, np.zeros((modes, 1))], axis=1)
        return dataclasses.replace(
            self, mean=mean, sd=sd, mixing=mixing, centres=centres, factors=factors
        )

    def log_density(self, z: Array) -> Array:
        """Return the log density, shape (n,), up to that of a standard normal at its centre."""
        if self.weights.size == 0:
            return np.asarray(-0.5 * np.einsum("ij,ij->i", z, z))
        terms = []
        for weight, centre, factor in zip(self.weights, self.centres, self.factors, strict=True):
            off = scipy.linalg.solve_triangular(
                factor, (z - centre).T, lower=True, check_finite=False
            )
            size = np.log(weight) - np.log(np.diagonal(factor)).sum()
            terms.append(size - 0.5 * np.einsum("ji,ji->i", off, off))
        return np.asarray(scipy.special.logsumexp(terms, axis=0))

    def sample(self, rng: "np.random.Generator", n: int) -> Array:
        """Draw n vectors z."""
        normal = rng.standard_normal((n, self.mean.size))
        if self.weights.size == 0:
            return normal
        mode = rng.choice(self.weights.size, size=n, p=self.weights / self.weights.sum())
        drawn = np.einsum("nij,nj->ni", self.factors[mode], normal)
        return np.asarray(self.centres[mode] + drawn)


def joint_law(joint: Joint, names: tuple[str, ...]) -> JointLaw:
    """Put a joint law into the order of all unknowns of a scene.

    Parameters
    ----------
    joint : Joint
        The law; the scene's check has found its unknowns among ``names``.
    names : tuple of str
        All unknowns; those that the law does not name stay independent.
    """
    d, index = len(names), [names.index(name) for name in joint.unknowns]
    within = np.ix_(index, index)
    weights = np.array([mode.weight for mode in joint.modes])
    weights = weights / weights.sum()
    means, covariances = np.zeros((len(weights), d)), np.tile(np.eye(d), (len(weights), 1, 1))
    for k, mode in enumerate(joint.modes):
        means[k, index] = mode.mean
        matrix = np.array(mode.covariance)
        covariances[k][within] = 0.5 * (matrix + matrix.T)
    mean = weights @ means
    off = means - mean
    whole = np.einsum("k,kij->ij", weights, covariances + off[:, :, None] * off[:, None, :])
    sd = np.sqrt(np.diagonal(whole))
    mixing = scipy.linalg.cholesky(whole / sd[:, None] / sd, lower=True)
    mixing /= np.linalg.norm(mixing, axis=1)[:, None]
    if len(weights) == 1:
        return JointLaw(
            joint.unknowns, mean, sd, mixing, np.empty(0), np.empty((0, d)), np.empty((0, d, d))
        )
    centres = scipy.linalg.solve_triangular(mixing, (off / sd).T, lower=True).T
    factors = [
        scipy.linalg.solve_triangular(
            mixing,
            sd_k[:, None]
            * scipy.linalg.cholesky(c / sd_k[:, None] / sd_k, lower=True)
            / sd[:, None],
            lower=True,
        )
        for c in covariances
        for sd_k in [np.sqrt(np.diagonal(c))]
    ]
    return JointLaw(joint.unknowns, mean, sd, mixing, weights, centres, np.array(factors))
