"""The collapsed posterior density: the ranges of all frames integrated out of it."""

import dataclasses
import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.density.best_ranges import fill_best_ranges
from inference.density.frame_integrals import fill_log_likelihoods
from inference.density.pieces import pieces
from inference.density.range_draw import fill_range_draws
from inference.frame.arguments import Instrument, Rows, instrument_of
from inference.frame.blocks import Data, own_blocks
from inference.frame.known_range import columns_of, with_displacements
from inference.frame.warmth import with_warmth, without_warmth
from simulator.at_temperature import warmth
from simulator.frames import Frames
from simulator.parameters import Parameters, Terms, parameters_of
from simulator.scene import Reference, Scene
from simulator.sensor import Sensor

__all__ = ["KERNELS", "CollapsedDensity", "FluxBasis", "RangeDraws", "collapsed_density"]

Array = NDArray[np.float64]

KERNELS = fill_best_ranges, fill_log_likelihoods
"""What a density spends its time in: of each there is machine code before the first step."""


class FluxBasis(NamedTuple):
    """The error of the object's log flux at the frames' ranges: functions times coefficients.

    Attributes
    ----------
    coefficients : ndarray, shape (functions,)
        At the joint maximum over them and all ranges; their priors are standard normal.
    values, slopes : ndarray, shape (frames, functions)
        Of the functions, along log r; zero for a frame without object.
    """

    coefficients: Array
    values: Array
    slopes: Array


class RangeDraws(NamedTuple):
    """Ranges drawn given draws of the parameters.

    Attributes
    ----------
    log_r : ndarray, shape (n, frames)
        nan for a frame without object.
    likelihoods : ndarray, shape (n, frames)
        `CollapsedDensity.frame_log_likelihoods` of the parameters.
    unfinished : int
        How many integrals over ranges, of n times the blocks, did not settle: density and draws are
        wrong there.
    """

    log_r: Array
    likelihoods: Array
    unfinished: int


@dataclasses.dataclass(frozen=True, eq=False)
class CollapsedDensity:
    """log p(z | frames), ranges integrated out, up to one constant of the scene.

    Attributes
    ----------
    parameters : Parameters
        The unknowns; z are their standard normal coordinates.
    frames : ndarray, shape (n, 3, 7 or 8)
        Usable frames: two readings, the gain factor, what is known of the ranges, and by how much
        warmer than its reference a sensor was that follows its temperature.
    present : ndarray of bool, optional
        False where a frame is known to hold no object; None where all may.
    sensor : Sensor
        The sensor.
    weights : ndarray, shape (n,), or None
        How many frames each stands for; None where it is one each.
    """

    parameters: Parameters
    frames: Array
    present: NDArray[np.bool_] | None
    sensor: Sensor
    weights: Array | None

    @functools.cached_property
    def instrument(self) -> Instrument:
        """The sensor as the kernels take it."""
        return instrument_of(self.sensor)

    @functools.cached_property
    def data(self) -> Data:
        """The frames as the kernels take them."""
        return self.blocks_of(without_warmth(self.frames))

    def blocks_of(self, frames: Array) -> Data:
        """Return frames, shape (n, 3 or 7), as blocks that have a range of their own."""
        return own_blocks(frames, self.present)

    def rows(self, terms: Terms) -> Rows:
        """Return parameter vectors for maxima over ranges, and for linearisations.

        A reference prior is a density for integrals; here it is flat in log r.
        """
        c0, c1, c2 = terms.object.T
        with np.errstate(over="ignore", invalid="ignore"):
            gain = self.sensor.known_gain if terms.gain is None else terms.gain
            shapes = np.column_stack([gain * c0 * c2, c0, c1])
        # to add zero costs less than machine code of its own for scenes without crosstalk
        crosstalk = np.zeros((len(shapes), 2)) if terms.crosstalk is None else terms.crosstalk
        return Rows(
            shapes,
            crosstalk,
            terms.background,
            terms.ranges,
            offsets=terms.offset,
            lags=terms.lag,
        )

    def integral_rows(self, terms: Terms) -> Rows:
        """Return parameter vectors for kernels that integrate ranges out, or draw them."""
        return self.rows(terms)._replace(resolves=self._reference)

    @property
    def _reference(self) -> bool:
        return isinstance(self.parameters.range_prior, Reference)

    def _of_rows(self, rows: Rows, data: Data) -> Array:
        """Return log p(block of frames | vector), shape (n, blocks)."""
        out = np.empty((len(rows.shapes), data.blocks))
        fill_log_likelihoods(out, rows, data, self.instrument)
        return out

    def shared(self, values: Array) -> Array:
        """Return log densities of blocks, shape (n, blocks), as shares of frames, (n, frames)."""
        return values

    def of_frames(self, found: Array) -> Array:
        """Return best ranges of blocks, shape (n, blocks, 3), as those of frames."""
        return found

    def total(self, values: Array) -> Array:
        """Return the sum of values of frames, shape (n, frames), over all that they stand for."""
        return np.asarray(values.sum(axis=1) if self.weights is None else values @ self.weights)

    def common(self, values: Array) -> Array:
        """Return for every frame what its block has, shape (n, frames)."""
        return values

    @property
    def holds(self) -> NDArray[np.bool_]:
        """Which frames may hold the object, shape (frames,)."""
        return np.ones(len(self.frames), dtype=bool) if self.present is None else self.present

    @property
    def range_of_frame(self) -> NDArray[np.intp]:
        """Which of the ranges each frame has, shape (frames,)."""
        return np.arange(len(self.frames))

    def _of_terms(self, terms: Terms) -> Array:
        """Return log p(y_j | terms_i) for physical terms."""
        rows = self.integral_rows(terms)
        out = np.empty((len(rows.shapes), self.data.blocks))  # of no vectors there are no pieces
        for k, each, data in pieces(self, terms, rows):
            out[k] = self._of_rows(each, data)
        return self.shared(out)

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
        for values in (terms.gain, terms.lag):
            if values is not None:
                good &= np.isfinite(values)
        if terms.drift is not None:
            good &= np.isfinite(terms.drift).all(axis=1)
        if good.all():
            out = self._of_terms(terms)
        elif good.any():
            out[good] = self.frame_log_likelihoods(z[good])
        return out

    def _with_flux_errors(
        self,
        rows: Rows,
        z: Array,  # noqa: ARG002
        rng: np.random.Generator,  # noqa: ARG002
    ) -> tuple[Rows, Array | None]:
        """Draw what multiplies the object's flux given each z: here nothing.

        Beside it shares of the log likelihood, shape (n, frames), where ranges are drawn given it.
        """
        return rows, None

    def draw_log_ranges(self, z: Array, rng: np.random.Generator) -> Array:
        """Draw the range of every frame given each parameter vector.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Draws of the parameters, of positive density.
        rng : numpy.random.Generator
            Source of randomness.

        Returns
        -------
        ndarray, shape (n, frames)
            log r; nan for a frame without object.
        """
        return self.common(self._draw_blocks(z, rng)[0])

    def draw_with_likelihoods(self, z: Array, rng: np.random.Generator) -> RangeDraws:
        """Draw ranges as `draw_log_ranges`, with what is found on the way."""
        log_r, unfinished, values = self._draw_blocks(z, rng)
        return RangeDraws(self.common(log_r), values, int(np.count_nonzero(unfinished)))

    def _draw_blocks(self, z: Array, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Draw log r of every block, and count what did not settle, each of shape (n, blocks).

        Beside them `frame_log_likelihoods` of z.
        """
        terms = self.parameters.terms(z)
        rows, known = self._with_flux_errors(self.integral_rows(terms), z, rng)
        out, likelihoods, unfinished = np.empty((3, len(z), self.data.blocks))
        uniforms = rng.random((*out.shape, 2))
        for k, each, data in pieces(self, terms, rows):
            filled = out[k], likelihoods[k], unfinished[k]
            fill_range_draws(*filled, uniforms[k], each, data, self.instrument)
        return out, unfinished, self.shared(likelihoods) if known is None else known

    def best_ranges(self, z: Array) -> Array:
        """Find each frame's best range for given parameters.

        Parameters
        ----------
        z : ndarray, shape (n, d)
            Parameter vectors.

        Returns
        -------
        ndarray, shape (n, frames, 3)
            log r, log p(y, log r | z) and its standard deviation in log r; nan, log likelihood and
            nan for a frame without object.
        """
        terms = self.parameters.terms(z)
        found = np.empty((len(z), self.data.blocks, 3))
        for k, rows, data in pieces(self, terms, self.rows(terms)):
            fill_best_ranges(found[k], rows, data, self.instrument)
        return self.of_frames(found)

    def flux_basis(self, z: Array, log_r: Array) -> FluxBasis | None:  # noqa: ARG002
        """Return what the error of the object's flux is made of at given ranges: here none."""
        return None

    def flux_errors(self, log_r: Array, rng: np.random.Generator) -> Array | None:  # noqa: ARG002
        """Draw errors of the object's log flux at given log ranges from their prior: here none."""
        return None

    def log_likelihood(self, z: Array) -> Array:
        """Return log p(frames | z), shape (len(z),)."""
        return self.total(self.frame_log_likelihoods(z))

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
        Where the scene breaks a rule, or displacements lead beyond the ranges that it allows.
    """
    all_present = frames.object_present is None or bool(frames.object_present.all())
    columns = columns_of(frames)
    parameters = with_displacements(parameters_of(sensor, scene), columns)
    columns = with_warmth(columns, warmth(sensor, frames))
    present = None if all_present else frames.object_present
    return CollapsedDensity(parameters, columns, present, sensor, None)
