"""A posterior of a sine wave's wall from one frame, as an integral over the object's range.

Given the range r a wall of the complex reading `u = (y - m(r) - e) / S(r)` explains a frame y, of
an object that reads m and a noise e: strength |u|, a distance for every turn of the phase. So the
posterior is a curve, as thin as the noise, that r runs along once; its weight is that of the priors
by the determinant of strength and distance along u, `S² k B`. No grid over the unknowns meets a tip
of it, into which all far ranges fall.
"""

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from simulator.priors import Distribution
from simulator.sensor import SineWaveSensor
from tests.extreme.nested import Reference

__all__ = ["WallCurve", "wall_curve"]

Array = NDArray[np.float64]

_POINTS = 4001  # along log r; half as many are the other quadrature
_NODES = 3  # of a Gauss-Hermite rule for either part of the noise
_END = 6.5  # standard deviations of the distance's prior: beyond, it has 1e-10
_NEGLIGIBLE = 1e-8  # of the largest weight
_OFF = 1e-3  # nat, standard deviations, and relative: by which the two may differ


@dataclasses.dataclass(frozen=True, eq=False)
class WallCurve:
    """Strength and distance that explain one frame, along the object's range."""

    density: CollapsedDensity
    sensor: SineWaveSensor
    ranges: Distribution
    reading: complex
    read: float
    shape: tuple[float, float, float]
    shadow: tuple[float, float]

    def at(self, r: Array, noise: complex = 0.0) -> tuple[Array, Array, Array]:
        """Return strength, distance within the first turn and share of the wall that is seen.

        Parameters
        ----------
        r : ndarray, shape (n,)
            Ranges [m].
        noise : complex
            Of the reading.
        """
        turn_m = self.sensor.max_range_m
        c0, c1, c2 = self.shape
        size, bend = self.shadow
        seen = (r**2 + bend * r) / (r**2 + bend * r + size)
        light = c0 * c2 / (r**2 * (r**2 + c1 * r + c0))
        of_object = light * np.exp(2j * np.pi * r / turn_m)
        u = (self.reading - noise - of_object) / seen
        distance = np.mod(np.angle(u) / (2 * np.pi), 1.0) * turn_m
        return np.abs(u), distance, seen

    def log_weights(self, r: Array, places: tuple[Array, Array, Array], turns: Array) -> Array:
        """Return log densities along log r, of every turn, shape (n, turns)."""
        strength, distance, seen = places
        strengths, distances = (unknown.law for unknown in self.density.parameters.unknowns)
        assert strengths is not None
        assert distances is not None
        every = distance[:, None] + self.sensor.max_range_m * turns
        with np.errstate(divide="ignore"):
            before = np.where(
                every > r[:, None], self.ranges.log_mass(np.zeros_like(every), every), 0.0
            )
        along = strengths.log_density(strength) + self.ranges.log_density(r) + np.log(r)
        along -= 2 * np.log(seen) + np.log(2 * np.pi / self.sensor.max_range_m * strength)
        behind = every > r[:, None]
        before = np.where(behind, before, 0.0)
        whole = along[:, None] + distances.log_density(every) - before
        return np.asarray(np.where(behind, whole, -np.inf))

    def integrated(self, points: int) -> Reference:
        """Return the quadrature over log r with so many points."""
        low, high = self.ranges.from_normal(np.array([-9.0, 9.0]))
        log_r = np.linspace(np.log(low), np.log(high), points)
        r = np.exp(log_r)
        law = self.density.parameters.unknowns[1].law
        assert law is not None
        end = float(law.from_normal(np.array([_END]))[0])
        turns = np.arange(np.ceil(end / self.sensor.max_range_m) + 1.0)
        nodes, heights = np.polynomial.hermite_e.hermegauss(_NODES)
        logs, values = [], []
        for a, one in zip(nodes, heights / heights.sum(), strict=True):
            for b, other in zip(nodes, heights / heights.sum(), strict=True):
                places = self.at(r, self.read * complex(a, b))
                log = self.log_weights(r, places, turns) + np.log(one * other)
                log[[0, -1]] += np.log(0.5)  # the trapezoidal rule
                kept = np.nonzero(log > log.max() + np.log(_NEGLIGIBLE))
                logs.append(log[kept] + np.log(log_r[1] - log_r[0]))
                far = places[1][kept[0]] + self.sensor.max_range_m * turns[kept[1]]
                values.append(np.column_stack([places[0][kept[0]], far]))
        found, log = np.concatenate(values), np.concatenate(logs)
        evidence = float(scipy.special.logsumexp(log))
        z = self.density.parameters.standard(found)
        return Reference(z, found, np.exp(log - evidence), evidence, np.nan)

    def reference(self) -> Reference | None:
        """Return the posterior; None where half the points say something else."""
        fine, coarse = self.integrated(_POINTS), self.integrated(_POINTS // 2 + 1)
        off = max(
            float(np.max(np.abs(fine.mean - coarse.mean) / fine.sd)),
            float(np.max(np.abs(np.log(fine.sd / coarse.sd)))),
            abs(fine.log_evidence - coarse.log_evidence),
        )
        return dataclasses.replace(fine, error=off / _OFF) if off < _OFF else None


def wall_curve(density: CollapsedDensity) -> WallCurve | None:
    """Return the curve of a posterior.

    Parameters
    ----------
    density : CollapsedDensity
        With strength and distance of a wall as unknowns, in this order.

    Returns
    -------
    WallCurve or None
        None of several frames, and where the range has no law of its own.
    """
    parameters, sensor = density.parameters, density.sensor
    assert parameters.names == ("background.strength", "background.distance_m")
    assert isinstance(sensor, SineWaveSensor)
    if len(density.frames) > 1 or not isinstance(parameters.range_prior, Distribution):
        return None
    noise = sensor.noise
    assert noise.read[0] == noise.read[1]
    assert noise.shot == noise.relative == sensor.phase_offset_rad == 0
    assert sensor.gain == 1
    known = parameters.known
    i, q = density.frames[0, :2]
    shape = (known["object.c0"], known["object.c1"], known["object.c2"])
    shadow = (known["background.shadow.c0"], known["background.shadow.c1"])
    return WallCurve(
        density, sensor, parameters.range_prior, complex(i, q), noise.read[0], shape, shadow
    )
