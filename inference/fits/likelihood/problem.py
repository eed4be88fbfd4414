"""What a fit over frames works on: unknowns of a scene as coordinates, usable frames, sensor."""

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS, Bounds, Fit, Layout, Place, Static
from inference.fits.likelihood.coordinates import (
    SHAPES,
    bounds_of,
    chain,
    physical,
)
from inference.fits.likelihood.known_values import IN_READINGS, known_and_unknown
from inference.fits.likelihood.law_mode import LawMode
from inference.fits.likelihood.places import Places
from inference.fits.likelihood.supports import supports_of, with_support_alone
from inference.fits.likelihood.told import KnownRanges
from inference.fits.likelihood.turns import ranges_of, windows_of
from inference.frame.arguments import Instrument, Rows
from inference.frame.blocks import own_blocks
from inference.frame.sensitivity import Value
from simulator.errors import RefusedError
from simulator.frames import Frames
from simulator.last_call import LastCall
from simulator.model_error import ModelError
from simulator.parameters import Parameters, parameters_of
from simulator.scene import Scene
from simulator.sensor import Sensor, instrument

__all__ = ["FitProblem", "fit_problem"]

Array = NDArray[np.float64]

_LOUDEST = 1e100  # times the noise: squares of readings, and bounds made from them, are numbers


@dataclasses.dataclass(frozen=True, eq=False)
class FitProblem:
    """Everything unknown of a scene, and the frames that tell of it.

    Attributes
    ----------
    names : tuple of str
        Scene path of each coordinate.
    slots : ndarray of int, shape (d,)
        `Value` of each coordinate.
    layout : Layout
        As the kernels take it; readings in ``unit``.
    unit : float
        The read noise of the second reading [reading units].
    frames : ndarray, shape (n, 3)
        Readings in ``unit`` and gain factor; saturated frames left out.
    present : ndarray of bool, shape (n,)
        Where an object may be.
    gain : float
        Sensor's gain in ``unit``.
    instrument : Instrument
        Sensor, readings in ``unit``.
    background : bool or None
        None where the scene has none.
    support : (float, float)
        Ranges that the scene allows [m].
    parameters : Parameters
        The scene's priors, from which starting points are drawn.
    error : ModelError
        What the model may be wrong by; the likelihood knows nothing of it.
    known : KnownRanges or None
        What the frames know of their ranges beside the readings; the likelihood knows nothing of
        that either.
    law : bool
        Whether the scene's joint law counts as what is known of the unknowns.
    modes : tuple of LawMode or None
        Of what is known of the unknowns; that of an object that may be glossy is one.
    mode : LawMode or None
        That which is taken; None: the unknowns have their priors.
    places : Places or None
        Where frames share what following errors of the model leaves; None: nowhere.
    priors : bool
        Whether the priors of the unknowns count though the model is exact: frames alone leave too
        much open.
    """

    names: tuple[str, ...]
    slots: NDArray[np.int64]
    layout: Layout
    unit: float
    frames: Array
    present: NDArray[np.bool_]
    gain: float
    instrument: Instrument
    background: bool | None
    support: tuple[float, float]
    parameters: Parameters
    error: ModelError
    known: KnownRanges | None = None
    law: bool = False
    modes: tuple[LawMode | None, ...] = (None,)
    mode: LawMode | None = None
    places: Places | None = None
    priors: bool = False

    def __len__(self) -> int:
        return len(self.names)

    @property
    def erring(self) -> bool:
        """Whether an object's model errs, or something is known of it or of ranges."""
        known = self.law or self.priors or self.known is not None
        return bool(self.present.any()) and (self.object_errs or self.shadow_errs or known)

    @property
    def object_errs(self) -> bool:
        """Whether the object's light or its delay errs."""
        return self.error.flux > 0 or self.error.range_m > 0

    @property
    def shadow_errs(self) -> bool:
        """Whether there is a background whose shadow errs."""
        return self.background is not None and self.error.shadow > 0

    @functools.cached_property
    def logarithms(self) -> NDArray[np.bool_]:
        """Which coordinates are logarithms: all but crosstalk, shape (d,)."""
        return ~np.isin(self.slots, CROSSTALK)

    def kernel_fit(self) -> Fit:
        """Return what the kernels take, with fresh work space."""
        prior = np.array([[0.0, -1.0, 0.0, 0.0, 0.0, 0.0, *self.support]])
        background = None if self.background is None else np.empty((1, 4))
        return Fit(
            self.layout,
            Rows(np.empty((1, 3)), np.empty((1, 2)), background, prior),
            own_blocks(self.frames, self.present),
            self.instrument,
            self.gain,
            self.background,
            self.support,
        )

    def place(self, x: Array) -> Place:
        """Return room for what the likelihood finds at a copy of coordinates x."""
        best = np.full((1, self.frames.shape[0], 3), np.nan)
        return Place(np.array(x, dtype=np.float64), np.empty(SLOTS), best)

    def values(self, x: Array) -> Array:
        """Return all physical values, readings in ``unit``, shape (SLOTS,)."""
        values = np.empty(SLOTS)
        physical(values, x, self.layout)
        return values

    def bounds(self, x: Array) -> Bounds:
        """Return the bounds of the coordinates at x."""
        bounds = Bounds(np.empty(x.size), np.empty(x.size))
        bounds_of(bounds, self.values(x), self.layout)
        return bounds

    def chain(self, x: Array) -> Array:
        """Return the derivatives of all values along the coordinates, shape (SLOTS, d)."""
        return self.opened(x)[1]

    def opened(self, x: Array) -> tuple[Array, Array]:
        """Return `values` and `chain`, of coordinates that were just asked for without a search.

        Nothing may be written to either.
        """
        return self._last.of(self._opened_anew, x)

    def _opened_anew(self, x: Array) -> tuple[Array, Array]:
        values, out = self.values(x), np.empty((SLOTS, x.size))
        bounds = Bounds(np.empty(x.size), np.empty(x.size))
        bounds_of(bounds, values, self.layout)
        chain(out, values, x, self.layout, bounds)
        return values, out

    @functools.cached_property
    def _last(self) -> LastCall[tuple[Array, Array]]:
        return LastCall()

    @functools.cached_property
    def log_support(self) -> tuple[float, float]:
        """Ends of log r that the scene allows."""
        low, high = np.log(self.support).tolist()
        return low, high

    def log_ends(self, x: Array) -> tuple[float, float]:
        """Return the ends of log r at coordinates x: nearer than -c1' a shadow is negative."""
        low, high = self.log_support
        if self.background is None:
            return low, high
        nearest = -float(self.opened(x)[0][Value.SHADOW_C1])
        return (max(low, math.log(nearest)) if nearest > 0.0 else low), high

    @functools.cached_property
    def windows(self) -> list[tuple[float, float]]:
        """Parts of the ranges, of a turn of phase and more; none where they are within one [m]."""
        wave = self.instrument.wave
        return [] if wave is None else windows_of(self.support, 2.0 * math.pi / wave[0])

    @functools.cached_property
    def columns(self) -> list[int]:
        """Where the priors have the unknowns."""
        return [self.parameters.names.index(name) for name in self.names]

    @functools.cached_property
    def units(self) -> Array:
        """Size of one unit of each unknown's value in SI or reading units, shape (d,)."""
        return np.where(np.isin(self.slots, IN_READINGS), self.unit, 1.0)

    def natural(self, x: Array) -> Array:
        """Return the unknowns in SI or reading units, shape (d,)."""
        return np.asarray(self.values(x)[self.slots] * self.units)

    def naturals(self, points: Array) -> Array:
        """Return `natural` of many coordinates at once, shape (m, d) for (m, d)."""
        shapes, sides = self._apart
        with np.errstate(all="ignore"):
            natural = np.asarray(np.exp(points) * self.units)
            columns = {slot: natural[:, j] for j, slot in enumerate(self.slots.tolist())}
            for j, slot in shapes:
                c0 = columns.get(slot - 1, self.layout.known[slot - 1])
                natural[:, j] = 2 * np.sqrt(c0) * np.expm1(points[:, j])
            for j, side in sides:
                natural[:, j] = (points[:, j] - self._bare(columns, side)) * self.unit
        return natural

    @functools.cached_property
    def _apart(self) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
        """Coordinates that are no plain logarithms: of shapes with their slots, and crosstalk's."""
        slots = self.slots.tolist()
        shapes = [(j, slot) for j, slot in enumerate(slots) if slot in SHAPES]
        sides = [(j, CROSSTALK.index(slot)) for j, slot in enumerate(slots) if slot in CROSSTALK]
        return shapes, sides

    def coordinates(self, natural: Array) -> Array:
        """Return coordinates of given unknowns, shape (m, d) for (m, d); nan where impossible."""
        x = np.empty_like(natural)
        columns = {int(slot): natural[:, j] for j, slot in enumerate(self.slots)}
        with np.errstate(all="ignore"):
            for j, slot in enumerate(self.slots.tolist()):
                value = natural[:, j]
                if slot in CROSSTALK:
                    x[:, j] = value / self.unit + self._bare(columns, CROSSTALK.index(slot))
                elif slot in SHAPES:
                    c0 = columns.get(slot - 1, self.layout.known[slot - 1])
                    x[:, j] = np.log1p(value / (2 * np.sqrt(c0)))
                else:
                    x[:, j] = np.log(value / (self.unit if slot in IN_READINGS else 1.0))
        return x

    def _bare(self, columns: dict[int, Array], side: int) -> Array | float:
        """Return what the static light has beside crosstalk, in ``unit``."""
        static, known = self.layout.static, self.layout.known
        if not static.share > 0.0:
            return 0.0
        strength = known[Value.STRENGTH]
        if Value.STRENGTH in columns:
            strength = columns[Value.STRENGTH] / self.unit
        distance = columns.get(Value.DISTANCE, known[Value.DISTANCE])
        if static.wave_number > 0.0:
            phase = static.wave_number * distance + static.phase
            bare = np.sin(phase) if side else np.cos(phase)
        else:
            bare = np.ones_like(distance) if side else np.minimum(distance / static.r0, 1.0)
        return np.asarray(static.share * strength * bare)

    def select(self, index: NDArray[np.intp]) -> "FitProblem":
        """Return the same problem with some of the frames."""
        return dataclasses.replace(
            self,
            frames=np.ascontiguousarray(self.frames[index]),
            present=np.ascontiguousarray(self.present[index]),
            known=None if self.known is None else self.known.select(index),
            places=None if self.places is None else self.places.select(index),
        )


def _static(sensor: Sensor, parameters: Parameters, low: Array, high: Array, gain: Array) -> Static:
    """Return what the coordinates of crosstalk have in them beside it."""
    crosstalk = np.array(CROSSTALK)
    # a bound of crosstalk is none of the static light
    free = bool(np.isinf(low[crosstalk]).all() and np.isinf(high[crosstalk]).all())
    share = float(np.median(gain)) if parameters.has_background and free else 0.0
    r0, wave = instrument(sensor)
    assert not isinstance(r0, tuple)  # noqa: S101  # the plan leaves timing offsets to posteriors
    return Static(share, r0, *(wave or (0.0, 0.0)))


def fit_problem(sensor: Sensor, scene: Scene, frames: Frames, *, exact: bool = False) -> FitProblem:
    """Set a fit up.

    Parameters
    ----------
    scene : Scene
        The scene; of its priors only the supports bound the fit.
    frames : Frames
        Usable frames, at least one.
    exact : bool
        Whether the model is taken as exact, whatever the scene says of its error.

    Raises
    ------
    InvalidInputError
        Where the scene breaks a rule.
    RefusedError
        Where squares of a reading in units of its noise would overflow.
    """
    parameters = parameters_of(sensor, with_support_alone(scene))
    noise = sensor.noise
    # no power of two: where a walk strides must not depend on the unit of the readings
    unit = noise.read[1]
    r0, wave = instrument(sensor)
    varies = noise.shot > 0 or noise.relative > 0
    law = parameters.range_prior
    near, far = ranges_of(sensor, scene, (law.low, law.high))
    gain = frames.gains
    with np.errstate(over="ignore"):
        scaled = frames.readings / unit
    if not (np.abs(scaled) < _LOUDEST).all():
        raise RefusedError(
            f"a reading is more than {_LOUDEST:g} times its noise: check the units of the readings "
            "and of the noise's `read`, or leave out frames that something else has spoilt"
        )
    readings = np.ascontiguousarray(np.column_stack([scaled, gain]))
    loudest = np.maximum(np.abs(scaled).max(axis=1), 1.0) * unit
    with np.errstate(over="ignore"):
        light = float(loudest.max() / gain.max()), float((loudest / gain).max())
    low, high = supports_of(sensor, scene, (near, far), light)
    for k in IN_READINGS:
        low[k], high[k] = low[k] / unit, high[k] / unit
    names, index, known = known_and_unknown(sensor, parameters, unit)
    return FitProblem(
        names=names,
        slots=np.flatnonzero(index >= 0),
        layout=Layout(index, known, low, high, _static(sensor, parameters, low, high, gain)),
        unit=unit,
        frames=readings,
        present=frames.present,
        gain=sensor.known_gain / unit,
        instrument=Instrument(
            r0,
            wave,
            (noise.read[0] / unit, noise.read[1] / unit),
            noise.shot / unit if varies else None,
            noise.relative if varies else None,
            noise.flickers,
        ),
        background=True if parameters.has_background else None,
        support=(near, far),
        parameters=parameters,
        error=ModelError(0.0, 0.0, integrated=False) if exact else scene.allowed_error,
    )
