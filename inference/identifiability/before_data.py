"""Identifiability before any data: what frames at given ranges would tell of a scene."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.clock import with_clock
from inference.identifiability.erring import erring
from inference.identifiability.expected_posterior import (
    STEP,
    ExpectedPosterior,
    expected_posterior,
    log_range_spread,
)
from inference.identifiability.experiment import Experiment
from inference.identifiability.information import Information
from inference.identifiability.judged import Spread
from inference.identifiability.known_beside import planned_circuit, planned_rates, with_rates
from inference.identifiability.lowered import lowered
from inference.identifiability.offers import NOTHING_HELPS, NOTHING_IDENTIFIES, Offer, offers
from inference.identifiability.over_priors import drawn, elsewhere, outside
from inference.identifiability.reasons import Diagnosis
from inference.identifiability.status import Identifiability
from inference.identifiability.statuses import statuses_of
from simulator.errors import InvalidInputError, Problem, RefusedError, escape
from simulator.parameters import Parameters, parameters_of
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Foresight", "check_discrepancy", "identifiability"]

Array = NDArray[np.float64]

_JUST_ENOUGH = (
    "; the distinct ranges are just as many as the unknowns need, and such systems can have "
    "several exact solutions: one more would tell them apart"
)


@dataclasses.dataclass(frozen=True, eq=False)
class Foresight:
    """What frames at given ranges would tell.

    Attributes
    ----------
    experiment : Experiment
        Sensor, unknowns, their reference values and the ranges.
    information : Information
        Of the readings alone, errors of the model among what is unknown: rank, singular values,
        Cramer-Rao bounds.
    posterior : ExpectedPosterior
        Spread to be expected, priors included.
    needed : int
        Number of distinct ranges that the unknowns need at least.
    distinct : int
        Number of distinct ranges.
    identifiability : tuple of Identifiability
        A row for every unknown and one for "range_m": as at least three of four draws of the priors
        have it, where that is worse than at the values of reference.
    over_priors : dict of str to dict of str to int
        Of every row how many draws of the priors have each status; empty where ``at`` gives all.
    remedies : dict of str to tuple of Offer
        Of every parameter that is not identified what would help: what has it identified first,
        and of what achieves as much the cheapest.
    """

    experiment: Experiment
    information: Information
    posterior: ExpectedPosterior
    needed: int
    distinct: int
    identifiability: tuple[Identifiability, ...]
    over_priors: dict[str, dict[str, int]]
    remedies: dict[str, tuple[Offer, ...]]

    @property
    def reference(self) -> dict[str, float]:
        """Values of the unknowns at which everything holds, in SI units."""
        e = self.experiment
        values = e.parameters.natural(e.z[None])[0].tolist()
        return dict(zip(e.parameters.names, values, strict=True))

    @property
    def sd(self) -> dict[str, float]:
        """Cramer-Rao bounds of the unknowns in SI units; inf where one is not identifiable.

        The parameters of the ranges' prior are not among them: without it they do not exist.
        """
        bounds = self.information.sd_of(self.experiment.unknowns.in_si_units).tolist()
        return dict(zip(self.experiment.names, bounds, strict=True))

    @property
    def posterior_sd(self) -> dict[str, float]:
        """Expected posterior standard deviations of all unknowns, in SI units."""
        e = self.experiment
        steps = STEP * np.eye(e.z.size)
        with np.errstate(over="ignore", invalid="ignore"):
            change = e.parameters.natural(e.z + steps) - e.parameters.natural(e.z - steps)
            slopes = change.T / (2 * STEP)  # the unknowns along z
            sd = np.linalg.norm(slopes @ self.posterior.factor, axis=1).tolist()
        return dict(zip(e.parameters.names, sd, strict=True))

    @property
    def range_sd(self) -> Array:
        """Cramer-Rao bounds of the ranges [m], shape (n,); nan for a frame without object."""
        return np.asarray(np.exp(self.experiment.log_r) * self.information.range_sd)


def _log_ranges(ranges_m: Sequence[float], object_present: Sequence[bool] | None) -> Array:
    ranges = np.asarray(ranges_m, dtype=float)
    if ranges.ndim != 1 or ranges.size == 0:
        raise InvalidInputError.at("/ranges_m", "must be a list of at least one range")
    bad = np.flatnonzero(~((ranges > 0) & np.isfinite(ranges)))[:1]
    problems = [Problem(f"/ranges_m/{index}", "must be positive and finite") for index in bad]
    if object_present is not None and len(object_present) != ranges.size:
        message = f"has {len(object_present)} entries where ranges_m has {ranges.size}"
        problems.append(Problem("/object_present", message))
    if problems:
        raise InvalidInputError(*problems)
    log_r = np.log(ranges)
    return log_r if object_present is None else np.where(object_present, log_r, np.nan)


def _reference(parameters: Parameters, at: Mapping[str, float] | None) -> Array:
    """Return z of the values given, the medians of the priors elsewhere."""
    given = {} if at is None else dict(at)
    problems = [
        Problem(f"/at/{escape(name)}", "is not an unknown of the scene")
        for name in given
        if name not in parameters.names
    ]
    z = np.zeros(len(parameters))
    if problems:
        raise InvalidInputError(*problems)
    for j, name in enumerate(parameters.names):
        if name not in given:
            continue
        # the prior of an unknown depends on those before it: their values stand already
        values = parameters.natural(z[None])
        values[0, j] = given[name]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            z[j] = parameters.standard(values)[0, j]
        if not math.isfinite(z[j]):
            problems.append(Problem(f"/at/{escape(name)}", "lies outside its prior"))
            z[j] = 0.0
    if problems:
        raise InvalidInputError(*problems)
    return z


def check_discrepancy(scene: Scene) -> None:
    """Refuse a discrepancy that nothing can tell.

    Raises
    ------
    RefusedError
        Where the object is stated not to move, and the size of the flux's error is.
    """
    error = scene.model_error
    if scene.motion == "static" and error.integrated and error.flux > 0:
        raise RefusedError(
            "an object at rest has one range, at which a discrepancy of its flux is no different "
            "from another c2; leave `discrepancy` out, and give `object.c2` a wider prior"
        )


def _check_ranges(experiment: Experiment, scene: Scene) -> None:
    present = np.isfinite(experiment.log_r)
    ranges = np.exp(experiment.log_r)
    prior, background = experiment.range_prior, experiment.background
    low, high = prior.low, prior.high
    beyond = outside(experiment)
    if beyond.size:
        message = (
            f"{ranges[beyond[0]]:g} m lies outside the support of range_m, {low:g} to {high:g} m"
        )
        if background is not None and low == -background.c1:
            message += " (nearer, a shadow with a negative c1 would be negative)"
        raise InvalidInputError.at(f"/ranges_m/{beyond[0]}", message)
    moves = present.any() and np.ptp(experiment.log_r[present]) > 1e-9
    if scene.motion == "static" and moves:
        message = "differ, and the scene states an object that does not move"
        raise InvalidInputError.at("/ranges_m", message)


def _with_rates(experiment: Experiment, rates: Array) -> Experiment:
    if experiment.common_range and rates[:, 1].any():
        message = "is given, and the scene states an object that does not move"
        raise InvalidInputError.at("/displacement_sd_m", message)
    try:
        return with_rates(experiment, rates)
    except InvalidInputError as error:
        raise InvalidInputError.at("/ranges_m", error.problems[0].message) from None


def identifiability(
    sensor: Sensor,
    scene: Scene,
    ranges_m: Sequence[float],
    object_present: Sequence[bool] | None = None,
    at: Mapping[str, float] | None = None,
    gain: Sequence[float] | None = None,
    known_range_sd_m: Sequence[float | None] | None = None,
    displacement_sd_m: Sequence[float | None] | None = None,
    temperature_k: Sequence[float] | None = None,
) -> Foresight:
    """Foresee what frames at given ranges tell of a scene, before any data.

    Parameters
    ----------
    sensor : Sensor
        The sensor, with its noise.
    scene : Scene
        What is known and what is not; optional terms are taken to stay. What its ``discrepancy``
        allows the model to err by, left out the default, is in all that is foreseen.
    ranges_m : sequence of float
        Range of the object in every frame [m].
    object_present : sequence of bool, optional
        False for a frame without the object, whose range plays no part.
    at : mapping of str to float, optional
        Values of unknowns, by scene path [SI units], at which the readings are linearised; the
        others are at the medians of their priors, and statuses hold at draws of these, too.
    gain : sequence of float, optional
        Factor of each frame on the sensor's gain.
    known_range_sd_m : sequence of float or None, optional
        Standard deviation to which a ruler or a robot tells the range of each frame [m]; None where
        nothing does.
    displacement_sd_m : sequence of float or None, optional
        The same of odometry, which tells ranges up to one offset that all frames share.
    temperature_k : sequence of float, optional
        Temperature of the sensor in each frame [K]; left out: that at which it was calibrated.

    Returns
    -------
    Foresight

    Raises
    ------
    InvalidInputError
        With pointers relative to the request: "/scene/...", "/ranges_m/i", "/object_present",
        "/at/...", "/known_range_sd_m", "/displacement_sd_m", "/temperature_k".
    RefusedError
        For tangential motion, a discrepancy of an object at rest, and where a number overflows.
    """
    try:
        parameters = parameters_of(sensor, scene)
    except InvalidInputError as error:
        raise error.below("/scene") from None
    check_discrepancy(scene)
    if scene.motion == "tangential":
        raise RefusedError(
            "in tangential motion every frame has an amplitude of its own, and the information is "
            "computed for one amplitude and a range that changes; state radial motion"
        )
    log_r = _log_ranges(ranges_m, object_present)
    allowed = scene.allowed_error
    rates = planned_rates(known_range_sd_m, displacement_sd_m, log_r)
    if rates is not None:
        rates = with_clock(rates, allowed.range_m)
    experiment = Experiment(
        sensor,
        parameters,
        _reference(parameters, at),
        log_r,
        planned_circuit(sensor, log_r.size, gain, temperature_k),
        common_range=scene.motion == "static",
    )
    _check_ranges(experiment, scene)
    if rates is not None:
        experiment = _with_rates(experiment, rates)
    experiment = erring(experiment, allowed)
    if not experiment.finite:
        raise RefusedError(
            "a reading, its noise or one of their derivatives is beyond what a number can hold; "
            "state the quantities in other units of reading"
        )

    posterior = expected_posterior(experiment)
    present = np.isfinite(log_r)
    still = bool(present.any()) and float(np.ptp(log_r[present])) < 1e-9
    spread = Spread(posterior.sd, posterior.scale_sd)
    diagnosis = Diagnosis(experiment, still)
    rows = statuses_of(diagnosis, spread, posterior)
    if 0 < diagnosis.distinct == diagnosis.needed and rates is None:
        rows = tuple(dataclasses.replace(row, reason=row.reason + _JUST_ENOUGH) for row in rows)
    left = {j for j, name in enumerate(parameters.names) if name not in (at or {})}
    draws = drawn(experiment.z, left)
    over = elsewhere(experiment, draws)
    units = [*np.ones(experiment.z.size).tolist(), log_range_spread(parameters)]
    rows = tuple(
        lowered(j, row, unit, over) for j, (row, unit) in enumerate(zip(rows, units, strict=True))
    )
    found: dict[str, tuple[Offer, ...]] = {}
    if not all(row.status == "identified" for row in rows):
        rows, found = _with_offers(diagnosis, rows, spread, draws)
    return Foresight(
        experiment,
        diagnosis.information,
        posterior,
        diagnosis.needed,
        diagnosis.distinct,
        rows,
        {row.parameter: over.counts(j) for j, row in enumerate(rows)} if left else {},
        found,
    )


def _with_offers(
    diagnosis: Diagnosis, rows: tuple[Identifiability, ...], spread: Spread, draws: Array
) -> tuple[tuple[Identifiability, ...], dict[str, tuple[Offer, ...]]]:
    """Return the rows, that nothing helps said in their reasons, and what would help."""
    said, found = [], {}
    actions = [dataclasses.replace(action, draws=draws) for action in diagnosis.actions]
    for row, size in zip(rows, [*spread.parameters.tolist(), spread.scale], strict=True):
        name = row.parameter
        if row.status == "identified" or name.startswith("range_m."):
            said.append(row)
            continue
        blind = diagnosis.distinct == 0 and name == "range_m"
        of = () if blind else offers(actions, row, diagnosis.bound(name), size)
        found[name] = of
        more = ""
        if diagnosis.distinct > 0 and not any(each.status == "identified" for each in of):
            more = NOTHING_IDENTIFIES if of else NOTHING_HELPS
        said.append(dataclasses.replace(row, reason=row.reason + more))
    return tuple(said), found
