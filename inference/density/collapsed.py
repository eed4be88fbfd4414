"""The collapsed posterior density: the ranges of all frames integrated out of it."""

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.curve_table import integration_bounds, tabulate
from inference.density.frame_integral import frame_log_likelihood
from inference.density.gaussian import Pair, gaussian, log_top
from inference.density.integrand import Quad, Triple
from inference.density.range_modes import find_modes
from inference.density.rows import background_of, crosstalk_of, law_of, row_of
from inference.frame.arguments import Instrument, instrument_of
from simulator.compiled import compiled
from simulator.frames import Frames
from simulator.parameters import Parameters, Terms, parameters_of
from simulator.readings import background_readings
from simulator.scene import Reference, Scene
from simulator.sensor import Sensor

__all__ = ["CollapsedDensity", "collapsed_density"]

Array = NDArray[np.float64]


@compiled
def empty_frame_log_likelihood(
    frame: Triple,
    crosstalk: Pair | None,
    background: Quad | None,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
) -> float:
    """Return the log density of a frame of which it is known that no object is in it."""
    m1, m2 = 0.0, 0.0
    if background is not None:
        b1, b2 = background_readings(math.inf, r0, wave, background)
        m1, m2 = frame[2] * b1, frame[2] * b2
    if crosstalk is not None:
        m1, m2 = m1 + crosstalk[0], m2 + crosstalk[1]
    residual = (frame[0] - m1, frame[1] - m2)
    density = gaussian(residual, (m1, m2), (0.0, 0.0), read, shot, None, wave is None)
    return density + log_top(read)


@compiled
def _log_likelihoods(
    out: Array,
    shapes: Array,
    crosstalks: Array | None,
    backgrounds: Array | None,
    laws: Array | tuple[Array],
    frames: Array,
    present: NDArray[np.bool_] | None,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
) -> None:
    """Fill out[i, j] with the log likelihood of frame j under parameter vector i."""
    strongest = frames[:, 2].max()
    for i in range(shapes.shape[0]):
        shape = (shapes[i, 0], shapes[i, 1], shapes[i, 2])
        crosstalk = crosstalk_of(crosstalks, i)
        background = background_of(backgrounds, i)
        law = law_of(laws, i)
        bounds = integration_bounds(law)
        if not bounds[1] > bounds[0] or not math.isfinite(law[0]):
            out[i, :] = -math.inf
            continue
        table = tabulate(bounds, shape, crosstalk, background, law, r0, wave, read, shot, strongest)
        values = np.empty(table.shape[1])
        modes = np.empty((values.size // 2 + 1, 6))
        scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, None)
        for j in range(frames.shape[0]):
            frame = (frames[j, 0], frames[j, 1], frames[j, 2])
            if present is not None and not present[j]:
                out[i, j] = empty_frame_log_likelihood(
                    frame, crosstalk, background, r0, wave, read, shot
                )
                continue
            count = find_modes(modes, values, table, frame, scene)
            out[i, j] = frame_log_likelihood(modes, count, frame, scene)


@dataclasses.dataclass(frozen=True, eq=False)
class CollapsedDensity:
    """log p(z | frames), ranges integrated out, up to one constant of the scene.

    Attributes
    ----------
    parameters : Parameters
        The unknowns; z are their standard normal coordinates.
    frames : ndarray, shape (n, 3)
        Usable frames: two readings and the gain factor.
    present : ndarray of bool, optional
        False where a frame is known to hold no object; None where all may.
    sensor : Sensor
        The sensor.
    """

    parameters: Parameters
    frames: Array
    present: NDArray[np.bool_] | None
    sensor: Sensor

    @property
    def instrument(self) -> Instrument:
        """The sensor as the kernels take it."""
        return instrument_of(self.sensor)

    @property
    def gain(self) -> float:
        """The sensor's gain."""
        return self.sensor.gain

    @property
    def r0(self) -> float:
        """As `Instrument.r0`."""
        return self.instrument.r0

    @property
    def wave(self) -> Pair | None:
        """As `Instrument.wave`."""
        return self.instrument.wave

    @property
    def read(self) -> Pair:
        """As `Instrument.read`."""
        return self.instrument.read

    @property
    def shot(self) -> float | None:
        """As `Instrument.shot`."""
        return self.instrument.shot

    def arguments(self, terms: Terms) -> tuple[Any, ...]:
        """Return the kernels' arguments for given terms: scene first, then frames and sensor."""
        c0, c1, c2 = terms.object.T
        with np.errstate(over="ignore", invalid="ignore"):
            shapes = np.column_stack([self.gain * c0 * c2, c0, c1])
        return (
            shapes,
            terms.crosstalk,
            terms.background,
            terms.ranges,
            self.frames,
            self.present,
            *self.instrument,
        )

    def integrals(self, terms: Terms) -> tuple[Any, ...]:
        """Return the arguments of kernels that integrate ranges out, or draw them.

        A reference prior is a density for integrals; maxima over ranges and linearisations take
        `arguments`, whose law is then flat in log r.
        """
        arguments = self.arguments(terms)
        if isinstance(self.parameters.range_prior, Reference):
            return (*arguments[:3], (terms.ranges,), *arguments[4:])
        return arguments

    def paired_log_likelihood(self, z: Array, readings: Array) -> Array:
        """Return log p(readings_i | z_i) for readings of shape (n, frames, 2), shape (n,)."""
        arguments = self.integrals(self.parameters.terms(z))
        scene, sensor = arguments[:4], arguments[5:]
        out = np.empty((len(z), self.frames.shape[0]))
        frames = self.frames.copy()
        for i in range(len(z)):
            frames[:, :2] = readings[i]
            row = [row_of(part, i) for part in scene]
            everything: list[Any] = [*row, frames, *sensor]
            _log_likelihoods(out[i : i + 1], *everything)
        return np.asarray(out.sum(axis=1))

    def _of_terms(self, terms: Terms) -> Array:
        """Return log p(y_j | terms_i) for physical terms."""
        out = np.empty((terms.object.shape[0], self.frames.shape[0]))
        _log_likelihoods(out, *self.integrals(terms))
        return out

    def frame_log_likelihoods(self, z: Array) -> Array:
        """Return log p(y_j | z_i), shape (len(z), frames); -inf where physics forbids z."""
        z = np.atleast_2d(z)
        terms = self.parameters.terms(z)
        out = np.full((z.shape[0], self.frames.shape[0]), -np.inf)
        good = np.isfinite(terms.object).all(axis=1) & (terms.object[:, 0] > 0)
        good &= terms.object[:, 1] > -2 * np.sqrt(np.where(good, terms.object[:, 0], 0.0))
        for part in (terms.crosstalk, terms.background):
            if part is not None:
                good &= np.isfinite(part).all(axis=1)
        if good.all():
            out = self._of_terms(terms)
        elif good.any():
            out[good] = self.frame_log_likelihoods(z[good])
        return out

    def curves(self, z: Array, rng: np.random.Generator) -> tuple[Array | None, Pair | None]:  # noqa: ARG002
        """Draw what multiplies the object's flux given each z: here nothing.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Parameter vectors.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        (ndarray, (float, float)) or (None, None)
            Knots of shape (n, knots, 2) and their grid (`inference.density.warp.Curve`).
        """
        return None, None

    def flux_errors(self, log_r: Array, rng: np.random.Generator) -> Array | None:  # noqa: ARG002
        """Draw errors of the object's log flux at given log ranges from their prior: here none."""
        return None

    def log_likelihood(self, z: Array) -> Array:
        """Return log p(frames | z), shape (len(z),)."""
        return np.asarray(self.frame_log_likelihoods(z).sum(axis=1))

    def __call__(self, z: Array) -> Array:
        """Return the log posterior density, shape (len(z),); never nan."""
        z = np.atleast_2d(z)
        density = self.parameters.log_prior(z)
        inside = np.isfinite(density)
        density[inside] += self.log_likelihood(z[inside])
        return np.where(np.isnan(density), -np.inf, density)


def collapsed_density(sensor: Sensor, scene: Scene, frames: Frames) -> CollapsedDensity:
    """Make the collapsed density of a scene from usable frames.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    scene : Scene
        The scene.
    frames : Frames
        At least one; saturated frames taken out.

    Returns
    -------
    CollapsedDensity

    Raises
    ------
    InvalidInputError
        Where the scene breaks a rule.
    """
    gain = np.ones(len(frames)) if frames.gain is None else frames.gain
    all_present = frames.object_present is None or bool(frames.object_present.all())
    return CollapsedDensity(
        parameters_of(sensor, scene),
        np.ascontiguousarray(np.column_stack([frames.readings, gain])),
        None if all_present else frames.object_present,
        sensor,
    )
