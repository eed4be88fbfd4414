"""The collapsed density where the object's flux may differ smoothly from the model's."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepancy_climb import best_under_flux_error
from inference.density.discrepancy_integral import integrate_flux_error
from inference.density.gaussian import Pair
from inference.density.rows import row_of
from simulator.discrepancy import DiscrepancyBasis, discrepancy_basis
from simulator.parameters import Terms

__all__ = ["DiscrepantDensity", "with_discrepancy"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class DiscrepantDensity(CollapsedDensity):
    """log p(z | frames), ranges and a smooth relative error of the flux integrated out.

    The error is a Gaussian process along log r (`simulator.discrepancy`). The integral over its
    coefficients is Laplace's; under every curve each frame's range is integrated adaptively.

    Attributes
    ----------
    discrepancy : float
        Standard deviation of the error.
    basis : DiscrepancyBasis
        Its functions.
    """

    discrepancy: float
    basis: DiscrepancyBasis

    @property
    def grid(self) -> tuple[float, float]:
        """First knot of the basis, and one over the knots' spacing."""
        return self.basis.first, 1.0 / self.basis.spacing

    @property
    def knots(self) -> Array:
        """Knots of the basis functions of an error of this size."""
        return self.discrepancy * self.basis.knots

    def _integrate(self, terms: Terms, readings: Array | None = None) -> Array:
        """Frames' shares of the log likelihood; readings instead of the frames' own, one a row."""
        n = terms.object.shape[0]
        size = self.basis.size
        out = np.empty((n, self.frames.shape[0]))
        work: list[Any] = [np.empty((1, size)), np.empty((1, size, size))]
        arguments = [*self.integrals(terms), self.knots, self.grid]
        if readings is None:
            integrate_flux_error(out, *work, *arguments)
            return out
        frames = self.frames.copy()
        for i in range(n):
            frames[:, :2] = readings[i]
            row = [row_of(part, i) for part in arguments[:4]]
            everything: list[Any] = [out[i : i + 1], *work, *row, frames, *arguments[5:]]
            integrate_flux_error(*everything)
        return out

    def paired_log_likelihood(self, z: Array, readings: Array) -> Array:
        """Return log p(readings_i | z_i) for readings of shape (n, frames, 2), shape (n,)."""
        return np.asarray(self._integrate(self.parameters.terms(z), readings).sum(axis=1))

    def _of_terms(self, terms: Terms) -> Array:
        return self._integrate(terms)

    def expansions(self, z: Array) -> tuple[Array, Array]:
        """Return the error's coefficients given each z: what of them is known.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Parameter vectors of positive density.

        Returns
        -------
        (ndarray, ndarray)
            Means, shape (n, functions), and upper triangular factors R of the precisions R^T R,
            shape (n, functions, functions).
        """
        n, size = len(z), self.basis.size
        # a single row would be taken as work space by all vectors
        centres, factors = np.empty((max(n, 2), size)), np.empty((max(n, 2), size, size))
        out = np.empty((n, self.frames.shape[0]))
        arguments: list[Any] = [*self.integrals(self.parameters.terms(z)), self.knots, self.grid]
        integrate_flux_error(out, centres, factors, *arguments)
        return centres[:n], factors[:n]

    def curves(self, z: Array, rng: np.random.Generator) -> tuple[Array, Pair]:
        """Draw the error's curve given each z (`CollapsedDensity.curves`)."""
        centres, factors = self.expansions(z)
        noise = rng.standard_normal(centres.shape)
        coefficients = centres + np.linalg.solve(factors, noise[:, :, None])[:, :, 0]
        return np.einsum("gpk,nk->ngp", self.knots, coefficients), self.grid

    def flux_errors(self, log_r: Array, rng: np.random.Generator) -> Array:
        """Draw errors of the log flux at given log ranges from their prior; nan at nan."""
        coefficients = self.discrepancy * rng.standard_normal((len(log_r), self.basis.size))
        rows = [
            self.basis.values(np.where(np.isfinite(u), u, self.basis.first)) @ a
            for u, a in zip(log_r, coefficients, strict=True)
        ]
        return np.where(np.isfinite(log_r), np.array(rows), np.nan)

    def functions(self, log_r: Array) -> tuple[Array, Array]:
        """Return all functions of the error and their slopes at given log ranges.

        Parameters
        ----------
        log_r : ndarray, shape (frames,)
            nan for a frame without object, where both are zero.

        Returns
        -------
        (ndarray, ndarray)
            Each of shape (frames, functions).
        """
        finite = np.isfinite(log_r)[:, None]
        u = np.where(np.isfinite(log_r), log_r, self.basis.first)
        values, slopes = self.basis.values(u), self.basis.slopes(u)
        scale = np.where(finite, self.discrepancy, 0.0)
        return scale * values, scale * slopes

    def best(self, z: Array) -> tuple[Array, Array]:
        """Find the joint maximum over ranges and coefficients for each z.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Parameter vectors.

        Returns
        -------
        (ndarray, ndarray)
            What `inference.density.profile.best_ranges` returns, shape (n, frames, 3), and the
            coefficients, shape (n, functions).
        """
        out = np.empty((len(z), self.frames.shape[0], 3))
        centres = np.empty((len(z), self.basis.size))
        arguments: list[Any] = [*self.arguments(self.parameters.terms(z)), self.knots, self.grid]
        best_under_flux_error(out, centres, *arguments)
        return out, centres


def with_discrepancy(density: CollapsedDensity, discrepancy: float) -> DiscrepantDensity:
    """Give a density a smooth relative error of the object's flux.

    Parameters
    ----------
    density : CollapsedDensity
        The density without.
    discrepancy : float
        Standard deviation of the error.

    Returns
    -------
    DiscrepantDensity
    """
    basis = discrepancy_basis(*density.parameters.reach_m)
    fields = {f.name: getattr(density, f.name) for f in dataclasses.fields(CollapsedDensity)}
    return DiscrepantDensity(**fields, discrepancy=discrepancy, basis=basis)
