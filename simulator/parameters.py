"""The unknowns of a scene: their names, their map from the standard normal, their prior.

An unknown exists only where the scene gives a prior, or leaves out a member of a term that it has.
In the coordinates z every unknown has, given those before it, the standard normal prior.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from simulator.errors import RefusedError
from simulator.priors import Distribution, HalfNormal, LogNormal, LogUniform, Uniform
from simulator.scene import Quantity, Reference, Scene, Stroke, check_scene, largest
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["Parameters", "Terms", "Unknown", "parameters_of"]

Array = NDArray[np.float64]
Values = dict[str, Array]

_DEFAULT_C0 = LogNormal(median=0.1, sigma=2.0).distribution()
_DEFAULT_C2 = LogNormal(median=0.1, sigma=1.0).distribution()
_DEFAULT_C1_SD = 0.4
_DEFAULT_SHADOW_C0 = LogNormal(median=0.75, sigma=0.5).distribution()
_DEFAULT_SHADOW_C1 = HalfNormal(sd=0.3).distribution()
_DEFAULT_RANGE = (0.02, 20.0)
_MOST_REJECTIONS = 1_000_000
_STROKE_SPREAD = LogNormal(median=0.5, sigma=1.0).distribution()


@dataclasses.dataclass(frozen=True)
class Terms:
    """Physical values of n parameter vectors; a term that the scene lacks is None.

    Attributes
    ----------
    object : ndarray, shape (n, 3)
        c0 [m^2], c1 [m], c2.
    crosstalk : ndarray, shape (n, 2), optional
        In reading units.
    background : ndarray, shape (n, 4), optional
        Strength [reading units], distance [m], c0' [m^2], c1' [m].
    ranges : ndarray, shape (n, 8)
        Prior density of a range: log p(r) = a0 + a1 log r - ((r - a2) a3)^2 / 2
        - ((log r - a4) a5)^2 / 2 on [a6, a7] [m].
    """

    object: Array
    crosstalk: Array | None
    background: Array | None
    ranges: Array


@dataclasses.dataclass(frozen=True)
class Unknown:
    """One unknown.

    Attributes
    ----------
    name : str
        Its path in the scene, for example "object.c0".
    from_normal : callable
        (z, values so far) -> value; z standard normal, each of shape (n,).
    log_correction : callable, optional
        (values so far) -> log of the prior mass that a joint truncation leaves, shape (n,).
    to_normal : callable
        (value, values so far) -> z.
    """

    name: str
    from_normal: Callable[[Array, Values], Array]
    to_normal: Callable[[Array, Values], Array]
    log_correction: Callable[[Values], Array] | None = None


@dataclasses.dataclass(frozen=True)
class Parameters:
    """All unknowns of a scene seen by a sensor, in a fixed order.

    Attributes
    ----------
    names : tuple of str
        Scene paths of the unknowns.
    """

    unknowns: tuple[Unknown, ...]
    known: dict[str, float]
    crosstalk: tuple[str, str] | None
    has_background: bool
    shadow_is_object: bool
    range_prior: Distribution | Stroke | Reference

    @property
    def names(self) -> tuple[str, ...]:
        """Scene paths of the unknowns."""
        return tuple(unknown.name for unknown in self.unknowns)

    def __len__(self) -> int:
        return len(self.unknowns)

    def _values(self, z: Array) -> Values:
        values = {name: np.full(z.shape[0], value) for name, value in self.known.items()}
        # far out in z values overflow to inf or 0; log_prior and the likelihood judge them
        with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
            for j, unknown in enumerate(self.unknowns):
                values[unknown.name] = unknown.from_normal(z[:, j], values)
        return values

    def natural(self, z: Array) -> Array:
        """Return the unknowns in SI units, shape (n, d), in the order of ``names``."""
        values = self._values(z)
        return np.column_stack([values[name] for name in self.names] or [np.empty((len(z), 0))])

    def standard(self, natural: Array) -> Array:
        """Inverse of `natural`: coordinates z, shape (n, d)."""
        values = {name: np.full(natural.shape[0], value) for name, value in self.known.items()}
        columns = []
        for j, unknown in enumerate(self.unknowns):
            columns.append(unknown.to_normal(natural[:, j], values))
            values[unknown.name] = natural[:, j]
        return np.column_stack(columns or [np.empty((len(natural), 0))])

    def log_prior(self, z: Array) -> Array:
        """Return the log prior density of z, shape (n,), up to one constant of the scene."""
        density = -0.5 * np.einsum("ij,ij->i", z, z)
        if any(unknown.log_correction for unknown in self.unknowns):
            values = self._values(z)
            with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
                for unknown in self.unknowns:
                    if unknown.log_correction is not None:
                        density = density + unknown.log_correction(values)
        return np.where(np.isnan(density), -np.inf, density)

    def terms(self, z: Array) -> Terms:
        """Return the physical terms of n vectors z of shape (n, d)."""
        values = self._values(z)
        crosstalk = background = None
        if self.crosstalk is not None:
            crosstalk = np.column_stack([values[name] for name in self.crosstalk])
        if self.has_background:
            source = "object" if self.shadow_is_object else "background.shadow"
            background = np.column_stack(
                [
                    values["background.strength"],
                    values["background.distance_m"],
                    values[f"{source}.c0"],
                    values[f"{source}.c1"],
                ]
            )
        return Terms(
            np.column_stack([values[f"object.{c}"] for c in ("c0", "c1", "c2")]),
            crosstalk,
            background,
            self._ranges(values, background, z.shape[0]),
        )

    def sample(self, rng: np.random.Generator, n: int) -> Array:
        """Draw n vectors z from the prior, joint truncations by rejection.

        The effort is bounded: priors that all but exclude one another are refused.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        n : int
            Number of vectors.

        Returns
        -------
        ndarray, shape (n, d)

        Raises
        ------
        RefusedError
            Where less than about a millionth of the separate priors satisfies c1 > -2 sqrt(c0).
        """
        accepted: list[Array] = []
        count = tried = 0
        size = max(n, 16)
        while count < n:
            if tried > _MOST_REJECTIONS * (count + 1):
                raise RefusedError(
                    "the priors of c0 and c1 leave less than a millionth of their mass where "
                    "c1 > -2 sqrt(c0); bring them into agreement with one another"
                )
            z = rng.standard_normal((size, len(self)))
            log_weight = self.log_prior(z) + 0.5 * np.einsum("ij,ij->i", z, z)
            z = z[np.log(rng.uniform(size=size)) < log_weight]
            accepted.append(z)
            count += len(z)
            tried += size
            # larger pieces where few are accepted, without holding many at once
            size = min(max(n - count, 2 * size if len(z) < size / 2 else 16), 1 << 16)
        return np.concatenate(accepted)[:n]

    def _ranges(self, values: Values, background: Array | None, n: int) -> Array:
        law = np.zeros((n, 8))
        if isinstance(self.range_prior, Stroke):
            law[:, 1] = -1.0
            law[:, 4] = np.log(values["range_m.centre"])
            with np.errstate(divide="ignore", over="ignore"):  # far out in z a spread underflows
                law[:, 5] = 1.0 / values["range_m.spread"]
            law[:, 6], law[:, 7] = self.range_prior.low, self.range_prior.high
        elif isinstance(self.range_prior, Reference):
            law[:, 1] = -1.0
            law[:, 6], law[:, 7] = self.range_prior.low, self.range_prior.high
        else:
            prior = self.range_prior
            law[:, 1] = -1.0 if prior.log else 0.0
            if prior.base == "normal":
                law[:, 4 if prior.log else 2] = prior.loc
                law[:, 5 if prior.log else 3] = 1.0 / prior.scale
            law[:, 6], law[:, 7] = prior.low, prior.high
        if background is not None:
            # a shadow with c1' < 0 is negative below r = -c1': such ranges are not physical
            law[:, 6] = np.maximum(law[:, 6], -background[:, 3])
            # and an object stands before its background: else a frame whose object is dark could
            # lie anywhere behind it, where nothing contradicts, and draw the other unknowns along
            law[:, 7] = np.minimum(law[:, 7], background[:, 1])
        law[:, 0] = -self._log_normaliser(law)
        return law

    def _log_normaliser(self, law: Array) -> Array:
        """Log integral of the unnormalised law over its support, shape (n,)."""
        low, high = law[:, 6], law[:, 7]
        if isinstance(self.range_prior, Reference):  # a density per distinguishable range
            return np.where(high > low, 0.0, np.inf)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if isinstance(self.range_prior, Stroke) or self.range_prior.base == "normal":
                in_log = isinstance(self.range_prior, Stroke) or self.range_prior.log
                loc, inverse = (law[:, 4], law[:, 5]) if in_log else (law[:, 2], law[:, 3])
                unit = Distribution("normal", False, 0.0, 1.0, -math.inf, math.inf)
                a, b = (np.log(low), np.log(high)) if in_log else (low, high)
                mass = unit.log_mass((a - loc) * inverse, (b - loc) * inverse)
                total = mass + 0.5 * math.log(2 * math.pi) - np.log(inverse)
            elif self.range_prior.log:
                total = np.log(np.log(high) - np.log(low))
            else:
                total = np.log(high - low)
        return np.where(high > low, total, np.inf)


def _known_or_unknown(
    name: str,
    quantity: Quantity,
    low: float,
    high: float,
    known: dict[str, float],
    unknowns: list[Unknown],
) -> None:
    """File a quantity under what is known, or make an unknown with its prior cut to a support."""
    if isinstance(quantity, float | int):
        known[name] = float(quantity)
        return
    law = quantity.distribution().truncated(low, high)
    unknowns.append(Unknown(name, lambda z, _: law.from_normal(z), lambda x, _: law.to_normal(x)))


def _add_shape(
    path: str,
    c0: Quantity | None,
    c1: Quantity | None,
    known: dict[str, float],
    unknowns: list[Unknown],
) -> None:
    """Add c0 and c1 of the object or the shadow, jointly truncated to c1 > -2 sqrt(c0)."""
    name0, name1 = f"{path}.c0", f"{path}.c1"
    is_object = path == "object"
    # where no c1 can be above a negative bound, no smaller c0 has prior mass
    greatest = largest(c1)
    least = (greatest / 2) ** 2 if greatest < 0 else 0.0
    if c0 is None:
        law = _DEFAULT_C0 if is_object else _DEFAULT_SHADOW_C0

        def scale(values: Values) -> Array | float:
            return 1.0 if is_object else values["object.c0"]

        unknowns.append(
            Unknown(
                name0,
                lambda z, v: scale(v) * law.from_normal(z, least / scale(v)),
                lambda x, v: law.to_normal(x / scale(v), least / scale(v)),
                None if least == 0.0 else (lambda v: law.log_mass(least / scale(v))),
            )
        )
    else:
        _known_or_unknown(name0, c0, least, math.inf, known, unknowns)
    if c1 is None and is_object:
        unknowns.append(
            Unknown(
                name1,
                lambda z, v: 2 * np.sqrt(v[name0]) * np.expm1(_DEFAULT_C1_SD * z),
                lambda x, v: np.log1p(x / (2 * np.sqrt(v[name0]))) / _DEFAULT_C1_SD,
            )
        )
    elif c1 is None:
        unknowns.append(
            Unknown(
                name1,
                lambda z, v: np.sqrt(v["object.c0"]) * _DEFAULT_SHADOW_C1.from_normal(z),
                lambda x, v: _DEFAULT_SHADOW_C1.to_normal(x / np.sqrt(v["object.c0"])),
            )
        )
    elif isinstance(c1, float | int):
        known[name1] = float(c1)
    else:
        law1 = c1.distribution()

        def bound(values: Values) -> Array:
            return -2 * np.sqrt(values[name0])

        always_inside = law1.low >= 0.0
        unknowns.append(
            Unknown(
                name1,
                lambda z, v: law1.from_normal(z, bound(v)),
                lambda x, v: law1.to_normal(x, bound(v)),
                None if always_inside else (lambda v: law1.log_mass(bound(v))),
            )
        )


def _range_prior(sensor: Sensor, scene: Scene) -> Distribution | Stroke | Reference:
    limit = sensor.r0 if isinstance(sensor, PulsedSensor) else math.inf
    if scene.background is not None and isinstance(scene.background.distance_m, float | int):
        limit = min(limit, scene.background.distance_m)
    if scene.range_m is None:
        high = min(sensor.max_range_m, _DEFAULT_RANGE[1], limit)
        # a sensor that sees less than 2 cm still has ranges
        low = _DEFAULT_RANGE[0] if high > _DEFAULT_RANGE[0] else high / 100
        return LogUniform(low=low, high=high).distribution()
    if isinstance(scene.range_m, Stroke | Reference):
        return type(scene.range_m)(low=scene.range_m.low, high=min(scene.range_m.high, limit))
    return scene.range_m.distribution().truncated(0.0, limit)


def parameters_of(sensor: Sensor, scene: Scene) -> Parameters:
    """Find the unknowns of a scene.

    Parameters
    ----------
    sensor : Sensor
        Bounds ranges and background distance (r0 of a pulse).
    scene : Scene
        The scene.

    Returns
    -------
    unknowns : Parameters
        In the order object, crosstalk, background, shadow, stroke.

    Raises
    ------
    InvalidInputError
        Where `check_scene` refuses the scene.
    """
    check_scene(sensor, scene)
    first, second = sensor.columns
    known: dict[str, float] = {}
    unknowns: list[Unknown] = []
    _add_shape("object", scene.object.c0, scene.object.c1, known, unknowns)
    c2: Quantity | None = scene.object.c2
    if c2 is None:
        c2 = LogNormal(median=math.exp(_DEFAULT_C2.loc), sigma=_DEFAULT_C2.scale)
    _known_or_unknown("object.c2", c2, 0.0, math.inf, known, unknowns)
    crosstalk = scene.crosstalk_values
    if crosstalk is not None:
        for column, quantity in zip((first, second), crosstalk, strict=True):
            name = f"crosstalk.{column}"
            _known_or_unknown(name, quantity, -math.inf, math.inf, known, unknowns)
    if scene.background is not None:
        limit = sensor.r0 if isinstance(sensor, PulsedSensor) else math.inf
        _known_or_unknown(
            "background.strength", scene.background.strength, 0.0, math.inf, known, unknowns
        )
        _known_or_unknown(
            "background.distance_m", scene.background.distance_m, 0.0, limit, known, unknowns
        )
        shadow = scene.shadow
        if shadow is not None and not scene.shadow_is_object:
            _add_shape("background.shadow", shadow[0], shadow[1], known, unknowns)
    range_prior = _range_prior(sensor, scene)
    if isinstance(range_prior, Stroke):
        centre = Uniform(low=math.log(range_prior.low), high=math.log(range_prior.high))
        law = centre.distribution()
        unknowns.append(
            Unknown(
                "range_m.centre",
                lambda z, _: np.exp(law.from_normal(z)),
                lambda x, _: law.to_normal(np.log(x)),
            )
        )
        unknowns.append(
            Unknown(
                "range_m.spread",
                lambda z, _: _STROKE_SPREAD.from_normal(z),
                lambda x, _: _STROKE_SPREAD.to_normal(x),
            )
        )
    return Parameters(
        tuple(unknowns),
        known,
        None if crosstalk is None else (f"crosstalk.{first}", f"crosstalk.{second}"),
        scene.background is not None,
        scene.shadow_is_object,
        range_prior,
    )
