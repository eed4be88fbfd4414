"""Crosstalk beside an object at one known range: coordinates in which only their sum is thin.

Frames of an object at rest tell the sum of its light and the crosstalk, and nothing of how much of
it is whose. Where its range is known, too, that is a sheet with a bend in it: crosstalk stays where
the object is dark, and gives way to the object where that is bright. No polynomial follows it: of
weighted draws in the coordinates of the flux, means differed between seeds by a fifth of a standard
deviation, six times what they were said to err. The sum is straight, and so is the object's share.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.frame.blocks import RANGE, RATE
from inference.posterior.sampling.flux_coordinate import FluxCoordinate
from simulator.readings import background_readings

__all__ = ["LightAtRest", "light_at_rest"]

Array = NDArray[np.float64]

_REACH = 8.0  # standard deviations of the priors that the tables reach; straight on beyond
_GRID = np.linspace(-_REACH, _REACH, 801)
_STEP = 1e-3
_FARTHEST = 100.0  # standard deviations of a prior by which light may take the crosstalk's place


@dataclasses.dataclass(frozen=True, eq=False)
class LightAtRest:
    """Coordinates y: z, but the whole light in place of crosstalk, and the object's share for c2.

    Of crosstalk x >= 0 whose coordinate is z = Z(x), beside an object of flux F whose reading is
    F u, y = Z(x + F u). Where crosstalk may have either sign y = z + rate F u. In place of c2 comes
    rate log(F / (1 - F / F_most)), with F_most the least of the whole lights x + F u over their u:
    the flux at which there would be no crosstalk left.

    Attributes
    ----------
    flux : FluxCoordinate
        Which of the unknowns make the flux; at the range.
    log_unit : float
        Log of the flux [reading units] where the coordinate of the flux is zero.
    crosstalk : ndarray of int, shape (2,)
        Columns of the two unknown crosstalks.
    positive : ndarray of bool, shape (2,)
        Whether their priors hold no negative ones.
    log_crosstalk : ndarray, shape (2, knots)
        Log of a positive crosstalk [reading units] over its z.
    rates : ndarray, shape (2,)
        Change of z with a crosstalk of either sign at the middle of its prior [1 / reading units].
    units : ndarray, shape (2,)
        Readings u of a flux of one at the range.
    """

    flux: FluxCoordinate
    log_unit: float
    crosstalk: NDArray[np.int64]
    positive: NDArray[np.bool_]
    log_crosstalk: Array
    rates: Array
    units: Array

    def forward(self, z: Array) -> Array:
        """Return y of z, shape (n, d)."""
        return self.with_volume(z)[0]

    def with_volume(self, z: Array) -> tuple[Array, Array]:
        """Return y of z, shape (n, d), and log |dy/dz|, shape (n,)."""
        y = self.flux.forward(z)
        log_flux = y[:, self.flux.c2] / self.flux.rate + self.log_unit
        log_volume, log_left = np.zeros(len(z)), np.zeros(len(z))
        for j, column in enumerate(self.crosstalk):
            if not self.positive[j]:
                y[:, column] += self._shift(j, log_flux)
                continue
            own = _along(_GRID, self.log_crosstalk[j], z[:, column])
            whole = np.logaddexp(own, log_flux + math.log(self.units[j]))
            y[:, column] = _along(self.log_crosstalk[j], _GRID, whole)
            log_volume += own - whole + self._log_slope(j, z[:, column])
            log_volume -= self._log_slope(j, y[:, column])
            log_left = np.minimum(log_left, own - whole)
        y[:, self.flux.c2] -= self.flux.rate * log_left
        return y, log_volume - log_left

    def backward(self, y: Array) -> Array:
        """Return z of y, shape (n, d)."""
        z = y.copy()
        whole = {
            j: _along(_GRID, self.log_crosstalk[j], y[:, column])
            for j, column in enumerate(self.crosstalk)
            if self.positive[j]
        }
        free = y[:, self.flux.c2] / self.flux.rate + self.log_unit
        most = np.full(len(y), np.inf)
        for j, log_whole in whole.items():
            most = np.minimum(most, log_whole - math.log(self.units[j]))
        # log (1 - F / F_most), without the difference
        log_left = -np.logaddexp(0.0, free - most)
        for j, column in enumerate(self.crosstalk):
            if j not in whole:
                z[:, column] -= self._shift(j, free + log_left)
                continue
            # most u / whole <= 1 of the light is not the crosstalk's at F_most
            bound = np.minimum(most + math.log(self.units[j]) - whole[j], 0.0)
            share = -np.expm1(bound) + np.exp(bound + log_left)
            z[:, column] = _along(
                self.log_crosstalk[j], _GRID, whole[j] + np.log(np.maximum(share, 1e-300))
            )
        z[:, self.flux.c2] += self.flux.rate * log_left
        return self.flux.backward(z)

    def _shift(self, j: int, log_flux: Array) -> Array:
        """Return the object's light in units of the crosstalk's coordinate, held far beyond."""
        rate = self.rates[j] * self.units[j]
        most = math.log(_FARTHEST / max(abs(rate), 1e-300))
        return np.asarray(rate * np.exp(np.minimum(log_flux, most)))

    def _log_slope(self, j: int, z: Array) -> Array:
        """Return the log of how fast log crosstalk rises with z."""
        knots = self.log_crosstalk[j]
        first = np.clip(np.searchsorted(_GRID, z, side="right") - 1, 0, len(_GRID) - 2)
        return np.asarray(np.log((knots[1:] - knots[:-1])[first] / (_GRID[1] - _GRID[0])))


def _along(x: Array, values: Array, at: Array) -> Array:
    """Interpolate between rising knots, and go straight on beyond them."""
    first = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    slope = (values[first + 1] - values[first]) / (x[first + 1] - x[first])
    return np.asarray(values[first] + slope * (at - x[first]))


def light_at_rest(density: CollapsedDensity, flux: FluxCoordinate) -> LightAtRest | None:
    """Return the coordinates of a scene whose frames have one range, which is known.

    Parameters
    ----------
    density : CollapsedDensity
        Its unknowns, its frames and the sensor.
    flux : FluxCoordinate
        Of its c0, c1 and c2.

    Returns
    -------
    LightAtRest or None
        None where frames tell more than a sum: they have several ranges, or one that is unknown, or
        hold no object; and where crosstalk is known, a background is not, or the sensor's gain.
    """
    parameters, names = density.parameters, list(density.parameters.names)
    columns = [names.index(name) for name in parameters.crosstalk or () if name in names]
    several = density.data.blocks != 1 or not density.holds.all()
    if several or len(columns) != 2 or parameters.has_background or "sensor.gain" in names:
        return None
    rates = density.frames[:, RATE] if density.frames.shape[1] > RATE else np.zeros(1)
    if not rates.any():
        return None
    range_m = float(np.average(density.frames[:, RANGE], weights=rates**2))
    r0, wave = density.instrument.r0, density.instrument.wave
    units = np.array(background_readings(np.inf, r0, wave, (1.0, range_m, 1.0, 0.0)))
    z = np.zeros((len(_GRID), len(names)))
    z[:, columns] = _GRID[:, None]
    crosstalk = parameters.natural(z)[:, columns].T
    positive = np.all(crosstalk >= 0.0, axis=1)
    z[:2, columns] = [[-_STEP], [_STEP]]
    low, high = parameters.natural(z[:2])[:, columns]
    middle = parameters.natural(np.zeros((1, len(names))))[0, flux.c2]
    log_crosstalk = np.log(np.clip(crosstalk, 1e-300, None))
    if not (np.diff(log_crosstalk[positive]) > 0).all() or (units[positive] <= 0).any():
        return None
    unit = math.log(density.sensor.known_gain * float(middle)) - 2.0 * math.log(range_m)
    return LightAtRest(
        dataclasses.replace(flux, range_m=range_m),
        unit,
        np.array(columns, dtype=np.int64),
        positive,
        log_crosstalk,
        2.0 * _STEP / (high - low),
        units,
    )
