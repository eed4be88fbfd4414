"""Crosstalk and a background that look alike: coordinates in which only their sum is thin.

Where both are unknown, readings tell the static light, crosstalk and bare background together, a
thousand times better than either. Along such a sheet the crosstalk gives way to the product of the
background's strength and a function of its distance, which no polynomial follows over many widths
of the sheet: walkers and populations then end where the polynomial leaves it, and a quarter of the
posterior was seen to be lost without a word. The sum itself, as a coordinate, needs no polynomial.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from simulator.readings import background_readings

__all__ = ["Reparametrisation", "reparametrisation_of"]

Array = NDArray[np.float64]

_REACH = 8.0  # standard deviations of the priors that the tables reach; constant beyond
_KNOTS = 801
_STEP = 1e-3


@dataclasses.dataclass(frozen=True, eq=False)
class Reparametrisation:
    """Coordinates y: z, but the static light in place of each unknown crosstalk.

    y = z + rate B(z) f(z), B and f interpolated between knots. Volumes stay as they are, and it can
    be undone exactly, whatever B and f are.

    Attributes
    ----------
    crosstalk : ndarray of int, shape (k,)
        Columns of the unknown crosstalk.
    rates : ndarray, shape (k,)
        Change of z with the crosstalk at the middle of its prior [1 / reading units].
    strength : int
        Column of the background's strength.
    log_strength : ndarray, shape (knots,)
        Log of the strength [reading units] over z.
    distance : int
        Column of the background's distance; that of the strength where the distance is known.
    shares : ndarray, shape (k, knots)
        Readings of a bare background of unit strength over the distance's z.
    """

    crosstalk: NDArray[np.int64]
    rates: Array
    strength: int
    log_strength: Array
    distance: int
    shares: Array

    def _shift(self, z: Array) -> Array:
        """Return rate B f, shape (n, k)."""
        grid = np.linspace(-_REACH, _REACH, _KNOTS)
        strength = np.exp(np.interp(z[:, self.strength], grid, self.log_strength))
        shares = [np.interp(z[:, self.distance], grid, share) for share in self.shares]
        return np.asarray(strength[:, None] * np.stack(shares, axis=1) * self.rates)

    def with_volume(self, z: Array) -> tuple[Array, Array]:
        """Return y of z, shape (n, d), and log |dy/dz|, shape (n,), which is 0."""
        return self.forward(z), np.zeros(len(z))

    def forward(self, z: Array) -> Array:
        """Return y of z, shape (n, d)."""
        y = z.copy()
        y[:, self.crosstalk] += self._shift(z)
        return y

    def backward(self, y: Array) -> Array:
        """Return z of y, shape (n, d)."""
        z = y.copy()
        z[:, self.crosstalk] -= self._shift(y)
        return z


def reparametrisation_of(density: CollapsedDensity) -> Reparametrisation | None:
    """Return that of a scene; None where crosstalk or the background's strength is known.

    Parameters
    ----------
    density : CollapsedDensity
        Its unknowns, and the sensor.
    """
    parameters = density.parameters
    names = list(parameters.names)
    unknown = [
        (j, names.index(name)) for j, name in enumerate(parameters.crosstalk or ()) if name in names
    ]
    if not unknown or "background.strength" not in names:
        return None
    strength = names.index("background.strength")
    far = "background.distance_m"
    distance = names.index(far) if far in names else strength
    grid = np.linspace(-_REACH, _REACH, _KNOTS)
    z = np.zeros((_KNOTS, len(names)))
    z[:, strength] = z[:, distance] = grid
    natural = parameters.natural(z)
    distances = natural[:, distance] if far in names else np.full(_KNOTS, parameters.known[far])
    r0, wave = density.instrument.r0, density.instrument.wave
    bare = np.array(
        [background_readings(np.inf, r0, wave, (1.0, float(r), 1.0, 0.0)) for r in distances]
    )
    columns = np.array([column for _, column in unknown], dtype=np.int64)
    ends = np.zeros((2, len(names)))
    ends[:, columns] = [[-_STEP], [_STEP]]
    low, high = parameters.natural(ends)[:, columns]
    return Reparametrisation(
        columns,
        2.0 * _STEP / (high - low),
        strength,
        np.log(np.clip(natural[:, strength], 1e-300, 1e300)),
        distance,
        np.ascontiguousarray(bare[:, [j for j, _ in unknown]].T),
    )
