"""A mixture that follows a curved posterior: a local piece at each of many draws."""

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, spatial

from inference.posterior.proposal import Mixture

__all__ = ["adapted"]

Array = NDArray[np.float64]

_COMPONENTS = 96
_LAPLACE_SHARE = 0.15  # that stays with the optima


def adapted(optima: Mixture, draws: Array, rng: np.random.Generator) -> Mixture:
    """Make a mixture that follows a curved posterior: a local piece at each of many draws.

    Parameters
    ----------
    optima : Mixture
        Laplace approximations, which keep a share.
    draws : ndarray, shape (n, d)
        Pilot draws of all ensembles together, none of which may be kept as a result.
    rng : numpy.random.Generator
        Chooses the draws that become centres.

    Returns
    -------
    Mixture
        Each piece has the covariance of the draws nearest to its centre.
    """
    n, d = draws.shape
    spread = linalg.cholesky(np.cov(draws.T).reshape(d, d) + 1e-12 * np.eye(d), lower=True)
    white = linalg.solve_triangular(spread, draws.T, lower=True).T
    chosen = rng.choice(n, size=min(_COMPONENTS, n), replace=False)
    near = spatial.cKDTree(white).query(white[chosen], k=min(10 * d + 10, n))[1]
    factors = []
    for neighbours in np.atleast_2d(near):
        local = np.cov(white[neighbours].T).reshape(d, d)
        # nearest neighbours have less spread than the piece of the law that they stand for
        local = local + 0.02 * np.trace(local) / d * np.eye(d)
        factors.append(spread @ linalg.cholesky(local, lower=True))
    pieces = np.full(chosen.size, (1 - _LAPLACE_SHARE) / chosen.size)
    return Mixture(
        np.concatenate([optima.centres, draws[chosen]]),
        np.concatenate([optima.factors, np.array(factors)]),
        np.concatenate([_LAPLACE_SHARE * optima.weights, pieces]),
    )
