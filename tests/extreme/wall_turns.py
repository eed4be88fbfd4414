"""A posterior of a sine wave's wall as a quadrature over one turn of its phase.

Walls a whole turn of phase apart give the same readings: what differs is their prior, and whether
the wall cuts the prior of the ranges, which none behind the first turn does. So the integral over
all distances is one over a single turn, of the sum over turns, and every turn has its weight.
"""

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from simulator.priors import Distribution
from simulator.sensor import Sensor, SineWaveSensor
from tests.extreme.nested import Reference, reference_of

__all__ = ["reference_of_turns"]

Array = NDArray[np.float64]

_END = 6.5  # standard deviations of the distance's prior: beyond, it has 1e-10
_NEGLIGIBLE = 1e-13  # of all weight


@dataclasses.dataclass(frozen=True, eq=False)
class _Turns:
    """Strength and distance (z, u): the distance within the first turn is uniform in u's law."""

    density: CollapsedDensity
    law: Distribution
    first_m: float
    turn_m: float
    count: int

    def natural(self, y: Array) -> Array:
        """Return strength and distance within the first turn, shape (n, 2)."""
        z = np.column_stack([y[:, 0], np.zeros(len(y))])
        strength = self.density.parameters.natural(z)[:, 0]
        return np.column_stack([strength, self.first_m + self.turn_m * scipy.special.ndtr(y[:, 1])])

    def at(self, y: Array, number: int) -> Array:
        """Return z of a distance in turn `number`."""
        natural = self.natural(y)
        natural[:, 1] += number * self.turn_m
        return np.column_stack([y[:, 0], self.density.parameters.standard(natural)[:, 1]])

    def log_likelihoods(self, y: Array) -> Array:
        """Return those of the first turn and of any other, shape (n, 2)."""
        # of the second turn whatever the prior: its readings are those of all the others
        natural = self.natural(y)
        out = np.full((len(y), 2), -np.inf)
        for number in (0, 1):
            z = self.at(y, number)
            with np.errstate(invalid="ignore"):
                inside = np.isfinite(z).all(axis=1) & (natural[:, 1] > 0)
            out[inside, number] = self.density.log_likelihood(z[inside])
        return out

    def log_priors(self, y: Array) -> Array:
        """Return those of every turn, shape (n, turns)."""
        distance = self.natural(y)[:, 1]
        steps = self.turn_m * np.arange(self.count)
        return np.asarray(self.law.log_density(distance[:, None] + steps))

    def log_weights(self, y: Array) -> Array:
        """Return log densities of every turn, shape (n, turns), along z and u."""
        likelihoods = self.log_likelihoods(y)
        rest = np.broadcast_to(likelihoods[:, 1:], (len(y), self.count - 1))
        along = -0.5 * np.sum(y**2, axis=1)[:, None]  # the prior of z, and du by dR
        every = np.column_stack([likelihoods[:, :1], rest])
        return np.asarray(every + self.log_priors(y) + along)

    def __call__(self, y: Array) -> Array:
        """Return the log density summed over all turns."""
        with np.errstate(invalid="ignore"):
            return np.asarray(scipy.special.logsumexp(self.log_weights(y), axis=1))


def reference_of_turns(
    density: CollapsedDensity, sensor: Sensor, law: Distribution
) -> Reference | None:
    """Integrate the posterior of a wall's strength and distance, seen by a sine wave.

    Parameters
    ----------
    density : CollapsedDensity
        With these two unknowns, in this order.
    sensor : Sensor
        A sine wave whose turn of phase takes in all ranges.
    law : Distribution
        The prior of the distance.

    Returns
    -------
    Reference or None
        None where two quadratures differ.
    """
    assert density.parameters.names == ("background.strength", "background.distance_m")
    assert isinstance(sensor, SineWaveSensor)
    turn_m = sensor.max_range_m
    least, end = (float(x) for x in law.from_normal(np.array([-_END, _END])))
    first_m = law.low
    assert density.parameters.reach_m[1] <= first_m + turn_m
    assert least >= first_m >= 0
    count = max(int(np.ceil((end - first_m) / turn_m)), 2)
    turns = _Turns(density, law, first_m, turn_m, count)
    folded = reference_of(turns, turns.natural, 2)
    if folded is None:
        return None
    logs = turns.log_weights(folded.z)
    shares = folded.weights[:, None] * scipy.special.softmax(logs, axis=1)
    z, values, weights = [], [], []
    for number in range(count):
        held = shares[:, number] > _NEGLIGIBLE
        y = folded.z[held]
        z.append(turns.at(y, number))
        values.append(turns.natural(y) + np.array([0.0, number * turn_m]))
        weights.append(shares[held, number])
    weight = np.concatenate(weights)
    return dataclasses.replace(
        folded,
        z=np.concatenate(z),
        values=np.concatenate(values),
        weights=weight / weight.sum(),
    )
