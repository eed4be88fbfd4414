"""The flux at a range in place of the object's c2: a coordinate that readings tell.

Frames at few ranges tell the object's flux there, a thousand times better than c0, c1 or c2. The
posterior is then a thin sheet along which c2 gives way to a function of c0 and c1 that no
polynomial follows; the flux itself, as a coordinate, needs none.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.reparametrisation import Reparametrisation

__all__ = ["FluxCoordinate", "flux_coordinate_of"]

Array = NDArray[np.float64]

_REACH = 8.0  # standard deviations of the priors that the tables reach; constant beyond
_GRID = np.linspace(-_REACH, _REACH, 801)
_STEP = 1e-3
_LEAST = 1e-6  # of the squared distance from the pole of c1, over c0
_SPAN = 1e3  # about sqrt(c0), where the range is looked for
_RATIOS = 36  # that are tried, and once more between the neighbours of the best
_MIDDLE = (0.1, 0.9)  # quantiles between which a sample's spread is measured


@dataclasses.dataclass(frozen=True, eq=False)
class FluxCoordinate:
    """Coordinates y: z, but the log of the flux at one range in place of c2.

    y = z + rate log(c0 / (r^2 + c1 r + c0)), with c0 and c1 interpolated between knots. Volumes
    stay as they are, and it can be undone exactly, whatever c0 and c1 are.

    Attributes
    ----------
    c2, c0, c1 : int
        Columns of the unknowns; c1 that of c0 where c1 is known.
    rate : float
        Change of z with log c2 at the middle of its prior.
    log_c0 : ndarray, shape (knots,)
        Log of c0 [m^2] over its z.
    above_pole : ndarray, shape (knots,)
        1 + c1 / (2 sqrt(c0)) over the z of c1.
    range_m : float
        The range [m].
    before : Reparametrisation or None
        Applied before all of this; None where nothing is confounded.
    """

    c2: int
    c0: int
    c1: int
    rate: float
    log_c0: Array
    above_pole: Array
    range_m: float
    before: Reparametrisation | None

    def _shape(self, z: Array) -> tuple[Array, Array]:
        """Return sqrt(c0) [m] and 1 + c1 / (2 sqrt(c0)), shape (n,) each."""
        root = np.exp(0.5 * np.interp(z[:, self.c0], _GRID, self.log_c0))
        return root, np.interp(z[:, self.c1], _GRID, self.above_pole)

    def _shift(self, z: Array) -> Array:
        return self.rate * _log_flux(self.range_m, *self._shape(z))

    def fitted(self, z: Array) -> "FluxCoordinate":
        """Return it at the range at which a sample, shape (n, d), tells the flux best."""
        y = z if self.before is None else self.before.forward(z)
        root, above_pole = self._shape(y)
        c2 = y[:, self.c2] / self.rate
        span = float(np.median(root)) * np.array([1.0 / _SPAN, _SPAN])
        for _ in range(2):
            ranges = np.geomspace(float(span[0]), float(span[1]), _RATIOS)
            flux = c2 + _log_flux(ranges[:, None], root, above_pole)
            low, high = np.quantile(flux, _MIDDLE, axis=1)
            best = int(np.argmin(high - low))
            span = ranges[[max(best - 1, 0), min(best + 1, _RATIOS - 1)]]
        return dataclasses.replace(self, range_m=float(ranges[best]))

    def with_volume(self, z: Array) -> tuple[Array, Array]:
        """Return y of z, shape (n, d), and log |dy/dz|, shape (n,), which is 0."""
        return self.forward(z), np.zeros(len(z))

    def forward(self, z: Array) -> Array:
        """Return y of z, shape (n, d)."""
        y = z.copy() if self.before is None else self.before.forward(z)
        y[:, self.c2] += self._shift(y)
        return y

    def backward(self, y: Array) -> Array:
        """Return z of y, shape (n, d)."""
        z = y.copy()
        z[:, self.c2] -= self._shift(z)
        return z if self.before is None else self.before.backward(z)


def _log_flux(range_m: Array | float, root: Array, above_pole: Array) -> Array:
    """Return log(c0 / (r^2 + c1 r + c0)), held where c1 is next to its pole."""
    s = range_m / root
    return np.asarray(-np.log(np.maximum((s - 1.0) ** 2 + 2.0 * s * above_pole, _LEAST)))


def flux_coordinate_of(
    density: CollapsedDensity, before: Reparametrisation | None
) -> FluxCoordinate | None:
    """Return the flux as a coordinate, its range not chosen yet.

    Parameters
    ----------
    density : CollapsedDensity
        Its unknowns.
    before : Reparametrisation or None
        Applied before it.

    Returns
    -------
    FluxCoordinate or None
        None where c2 or c0 is known, or their priors are not independent.
    """
    parameters = density.parameters
    names = list(parameters.names)
    if not {"object.c0", "object.c2"} <= set(names) or parameters.law is not None:
        return None
    c0, c2 = names.index("object.c0"), names.index("object.c2")
    c1 = names.index("object.c1") if "object.c1" in names else c0

    def along(column: int, z: Array) -> Array:
        points = np.zeros((len(z), len(names)))
        points[:, column] = z
        return parameters.natural(points)

    of_c0, of_c1 = along(c0, _GRID), along(c1, _GRID)
    known = parameters.known.get("object.c1", 0.0)
    slope = of_c1[:, c1] if c1 != c0 else np.full(len(_GRID), known)
    low, high = np.log(along(c2, np.array([-_STEP, _STEP]))[:, c2])
    return FluxCoordinate(
        c2,
        c0,
        c1,
        2.0 * _STEP / float(high - low),
        np.log(np.clip(of_c0[:, c0], 1e-300, 1e300)),
        np.maximum(1.0 + slope / (2.0 * np.sqrt(np.clip(of_c1[:, c0], 1e-300, 1e300))), 0.0),
        0.0,
        before,
    )
