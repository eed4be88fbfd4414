"""The unknowns of a scene: their names, their map from the standard normal, their prior.

An unknown exists only where the scene gives a prior, or leaves out a member of a term that it has.
In the coordinates z every unknown has, given those before it, the standard normal prior; where a
scene has a joint law of them, z are independent of one another under that law.
"""

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray

from simulator.errors import InvalidInputError, RefusedError
from simulator.joint_law import JointLaw, joint_law
from simulator.last_call import LastCall
from simulator.priors import UniformDistribution
from simulator.range_prior import RangePrior, range_prior, range_prior_rows, stroke_unknowns
from simulator.scene import Reference, Scene, Stroke
from simulator.scene_checks import check_scene
from simulator.sensor import PulsedSensor, Sensor
from simulator.sensor_unknowns import add_sensor, sensor_terms
from simulator.terms import Terms
from simulator.unknowns import Unknown, Values, add_quantity, add_reflectance, add_shape

__all__ = ["OFFSET", "Parameters", "Terms", "Unknown", "parameters_of", "with_offset"]

OFFSET = "odometry.offset_m"
"""The range at a displacement of zero, an unknown wherever frames tell displacements [m]."""

Array = NDArray[np.float64]

_MOST_REJECTIONS = 1_000_000
_NEAREST = 1e-3  # of the farthest range, where the prior of the ranges begins at zero
_FAR = 4.0  # standard deviations of a prior of the ranges that `Parameters.reach_m` takes in


@dataclasses.dataclass(frozen=True)
class Parameters:
    """All unknowns of a scene seen by a sensor, in a fixed order.

    Attributes
    ----------
    names : tuple of str
        Scene paths of the unknowns.
    law : JointLaw or None
        Of unknowns whose priors are not independent.
    """

    unknowns: tuple[Unknown, ...]
    known: dict[str, float]
    crosstalk: tuple[str, str] | None
    has_background: bool
    shadow_is_object: bool
    range_prior: RangePrior
    law: JointLaw | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Scene paths of the unknowns."""
        return tuple(unknown.name for unknown in self.unknowns)

    @property
    def reach_m(self) -> tuple[float, float]:
        """Ranges between which practically all of their prior lies [m]; the first may be 0."""
        law = self.range_prior
        if isinstance(law, Stroke | Reference):
            return law.low, law.high
        low, high = (float(x) for x in law.from_normal(np.array([-_FAR, _FAR])))
        return max(low, 0.0), high if math.isfinite(high) else law.high

    def __len__(self) -> int:
        return len(self.unknowns)

    @functools.cached_property
    def _last(self) -> LastCall[Values]:
        return LastCall()

    def _values(self, z: Array) -> Values:
        return self._last.of(self._values_anew, z)

    def _values_anew(self, z: Array) -> Values:
        values = {name: np.full(z.shape[0], value) for name, value in self.known.items()}
        z = self.marginal(z)
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
        t = np.column_stack(columns or [np.empty((len(natural), 0))])
        return t if self.law is None else self.law.joint(t)

    def marginal(self, z: Array) -> Array:
        """Return coordinates of one unknown each, of mean 0 and variance 1 under their priors.

        They are z itself where the priors are independent.
        """
        return z if self.law is None else self.law.marginal(z)

    def deviations(self, z: Array) -> Array:
        """Return how far unknowns lie from where their priors are densest, shape (n, d).

        Of a normal law |z|; of one that is densest at an end, or everywhere the same, less
        (`Distribution.deviation`). Of a joint law |z|.
        """
        off = np.abs(z)
        if self.law is not None:
            return np.asarray(off)
        values = self._values(z)
        for j, unknown in enumerate(self.unknowns):
            if unknown.deviation is not None:
                off[:, j] = np.fmin(off[:, j], unknown.deviation(values[unknown.name], values))
        return np.asarray(off)

    def log_prior(self, z: Array) -> Array:
        """Return the log prior density of z, shape (n,), up to one constant of the scene."""
        density = self._log_law(z)
        if any(unknown.log_correction for unknown in self.unknowns):
            values = self._values(z)
            with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
                for unknown in self.unknowns:
                    if unknown.log_correction is not None:
                        density = density + unknown.log_correction(values)
        return np.where(np.isnan(density), -np.inf, density)

    def _log_law(self, z: Array) -> Array:
        """Return the log density before the joint truncations, shape (n,)."""
        if self.law is not None:
            return self.law.log_density(z)
        return np.asarray(-0.5 * np.einsum("ij,ij->i", z, z))

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
            range_prior_rows(self.range_prior, values, background, z.shape[0]),
            values.get(OFFSET),
            *sensor_terms(values),
        )

    def sample(self, rng: "np.random.Generator", n: int) -> Array:
        """Draw n vectors z from the prior, joint truncations by rejection.

        The effort is bounded: priors that all but exclude one another are refused.

        Parameters
        ----------
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
            if self.law is None:
                z = rng.standard_normal((size, len(self)))
            else:
                z = self.law.sample(rng, size)
            log_weight = self.log_prior(z) - self._log_law(z)
            z = z[np.log(rng.uniform(size=size)) < log_weight]
            accepted.append(z)
            count += len(z)
            tried += size
            # larger pieces where few are accepted, without holding many at once
            size = min(max(n - count, 2 * size if len(z) < size / 2 else 16), 1 << 16)
        return np.concatenate(accepted)[:n]


def parameters_of(sensor: Sensor, scene: Scene) -> Parameters:
    """Find the unknowns of a scene.

    Parameters
    ----------
    sensor : Sensor
        Bounds ranges and background distance (r0 of a pulse).

    Returns
    -------
    unknowns : Parameters
        In the order object, crosstalk, background, shadow, sensor, stroke.

    Raises
    ------
    InvalidInputError
        Where `check_scene` refuses the scene.
    """
    check_scene(sensor, scene)
    first, second = sensor.columns
    known: dict[str, float] = {}
    unknowns: list[Unknown] = []
    add_shape("object", scene.object.c0, scene.object.c1, known, unknowns)
    add_reflectance(scene.object.c2, known, unknowns)
    crosstalk = scene.crosstalk_values
    if crosstalk is not None:
        for column, quantity in zip((first, second), crosstalk, strict=True):
            name = f"crosstalk.{column}"
            add_quantity(name, quantity, -math.inf, math.inf, known, unknowns)
    if scene.background is not None:
        limit = sensor.r0 if isinstance(sensor, PulsedSensor) else math.inf
        add_quantity(
            "background.strength", scene.background.strength, 0.0, math.inf, known, unknowns
        )
        add_quantity(
            "background.distance_m", scene.background.distance_m, 0.0, limit, known, unknowns
        )
        shadow = scene.shadow
        if shadow is not None and not scene.shadow_is_object:
            add_shape("background.shadow", shadow[0], shadow[1], known, unknowns)
    add_sensor(sensor, known, unknowns)
    prior = range_prior(sensor, scene)
    if isinstance(prior, Stroke):
        unknowns += stroke_unknowns(prior)
    law = None
    if scene.joint is not None:
        law = joint_law(scene.joint, tuple(unknown.name for unknown in unknowns))
        unknowns = [
            law.unknown(j, unknown) if unknown.name in scene.joint.unknowns else unknown
            for j, unknown in enumerate(unknowns)
        ]
    return Parameters(
        tuple(unknowns),
        known,
        None if crosstalk is None else (f"crosstalk.{first}", f"crosstalk.{second}"),
        scene.background is not None,
        scene.shadow_is_object,
        prior,
        law,
    )


def with_offset(parameters: Parameters, displacement_m: Array) -> Parameters:
    """Add the offset of displacements to the unknowns.

    Parameters
    ----------
    parameters : Parameters
        Of a scene.
    displacement_m : ndarray, shape (n,)
        Displacements of frames with an object [m], at least one.

    Returns
    -------
    unknowns : Parameters
        With `OFFSET` as the last. The nearest of the ranges is log-uniform where all of them lie
        within the prior of the ranges.

    Raises
    ------
    InvalidInputError
        Where they do not fit there.
    """
    least, span = float(displacement_m.min()), float(np.ptp(displacement_m))
    low, high = parameters.reach_m
    low = max(low, _NEAREST * high)
    if not high - span > low:
        raise InvalidInputError.at(
            "/frames/displacement_m",
            f"spans {span:.4g} m, and the ranges that the scene allows span {high - low:.4g} m",
        )
    law = UniformDistribution(log=True, low=low, high=high - span)
    offset = Unknown(
        OFFSET,
        lambda z, _: law.from_normal(z) - least,
        lambda x, _: law.to_normal(x + least),
    )
    known = None if parameters.law is None else parameters.law.with_another()
    return dataclasses.replace(parameters, unknowns=(*parameters.unknowns, offset), law=known)
