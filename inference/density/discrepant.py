"""The collapsed density where the object's flux may differ smoothly from the model's."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity, FluxBasis
from inference.density.discrepancy_integral import integrate_flux_error
from inference.density.flux_expansion import FluxFunctions
from inference.density.joint_maximum import fill_joint_maxima
from inference.density.pieces import pieces
from inference.frame.arguments import FluxError, Rows
from inference.frame.blocks import Data
from simulator.discrepancy import DiscrepancyBasis, discrepancy_basis

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
    def knots(self) -> Array:
        """Knots of the basis functions of an error of this size."""
        return self.discrepancy * self.basis.knots

    @property
    def functions(self) -> FluxFunctions:
        """What the error is made of, as the kernels take it, with work space of its own."""
        knots = self.knots
        curve = np.empty(knots.shape[:2])
        return FluxFunctions(knots, FluxError(curve, self.basis.first, 1.0 / self.basis.spacing))

    def _of_rows(self, rows: Rows, data: Data) -> Array:
        out = np.empty((len(rows.shapes), len(self.frames)))
        work = np.empty((1, self.basis.size)), np.empty((1, self.basis.size, self.basis.size))
        integrate_flux_error(out, *work, rows, data, self.instrument, self.functions)
        return out

    def expansions(self, z: Array) -> tuple[Array, Array, Array]:
        """Return the error's coefficients given each z: what of them is known.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Parameter vectors of positive density.

        Returns
        -------
        (ndarray, ndarray, ndarray)
            Means, shape (n, functions), upper triangular factors R of the precisions R^T R, shape
            (n, functions, functions), and `frame_log_likelihoods`, found on the way.
        """
        n, size = len(z), self.basis.size
        # a single row would be taken as work space by all vectors
        centres, factors = np.empty((max(n, 2), size)), np.empty((max(n, 2), size, size))
        out = np.empty((n, len(self.frames)))
        terms = self.parameters.terms(z)
        for k, rows, data in pieces(self, terms, self.integral_rows(terms)):
            integrate_flux_error(
                out[k], centres[k], factors[k], rows, data, self.instrument, self.functions
            )
        return centres[:n], factors[:n], out

    def _with_flux_errors(
        self, rows: Rows, z: Array, rng: np.random.Generator
    ) -> tuple[Rows, Array | None]:
        """Draw the error's curve given each z; of equal ones what is known of it is found once."""
        each, which = np.unique(z, axis=0, return_inverse=True)
        centres, factors, values = (found[which] for found in self.expansions(each))
        noise = rng.standard_normal(centres.shape)
        coefficients = centres + np.linalg.solve(factors, noise[:, :, None])[:, :, 0]
        erring = rows._replace(
            flux_errors=np.ascontiguousarray(np.einsum("gpk,nk->ngp", self.knots, coefficients)),
            flux_grid=(self.basis.first, 1.0 / self.basis.spacing),
        )
        return erring, values

    def flux_errors(self, log_r: Array, rng: np.random.Generator) -> Array:
        """Draw errors of the log flux at given log ranges from their prior; nan at nan."""
        coefficients = self.discrepancy * rng.standard_normal((len(log_r), self.basis.size))
        present = np.isfinite(log_r)
        values = self.basis.sums(np.where(present, log_r, self.basis.first), coefficients)
        return np.where(present, values, np.nan)

    def flux_basis(self, z: Array, log_r: Array) -> FluxBasis:
        """Return what the error is made of at given ranges (`FluxBasis`)."""
        return FluxBasis(self.joint_maxima(z[None])[1][0], *self.functions_at(log_r))

    def functions_at(self, log_r: Array) -> tuple[Array, Array]:
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
        present = np.isfinite(log_r)
        u = np.where(present, log_r, self.basis.first)
        scale = np.where(present[:, None], self.discrepancy, 0.0)
        return scale * self.basis.values(u), scale * self.basis.slopes(u)

    def joint_maxima(self, z: Array) -> tuple[Array, Array]:
        """Find the joint maximum over ranges and coefficients for each z.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Parameter vectors.

        Returns
        -------
        (ndarray, ndarray)
            What `CollapsedDensity.best_ranges` returns, shape (n, frames, 3), and the
            coefficients, shape (n, functions).
        """
        out = np.empty((len(z), len(self.frames), 3))
        centres = np.empty((len(z), self.basis.size))
        terms = self.parameters.terms(z)
        for k, rows, data in pieces(self, terms, self.rows(terms)):
            fill_joint_maxima(out[k], centres[k], rows, data, self.instrument, self.functions)
        return out, centres

    def best_ranges(self, z: Array) -> Array:
        """Find each frame's best range (`CollapsedDensity.best_ranges`)."""
        return self.joint_maxima(z)[0]


def with_discrepancy(density: CollapsedDensity, discrepancy: float) -> DiscrepantDensity:
    """Give a density a smooth relative error of the object's flux.

    Parameters
    ----------
    density : CollapsedDensity
        The density without.
    discrepancy : float
        Standard deviation of the error.
    """
    basis = discrepancy_basis(*density.parameters.reach_m)
    fields = {f.name: getattr(density, f.name) for f in dataclasses.fields(CollapsedDensity)}
    return DiscrepantDensity(**fields, discrepancy=discrepancy, basis=basis)
