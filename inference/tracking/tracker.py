"""A tracker: sensor, scene and settings turned into what the filter's kernels want."""

import dataclasses
import hashlib
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import prior_of
from inference.posterior.answer.posterior import Posterior
from inference.tracking.first_state import crosstalk_bounds, first_state
from inference.tracking.hypotheses import WITHOUT_CROSSTALK, Hypotheses
from inference.tracking.model_error import sd_by_derivatives, sd_by_table
from inference.tracking.motion import Rules
from inference.tracking.nuisance import nuisance_of
from inference.tracking.nuisance_jacobian import crosstalk_root, nuisance_jacobian
from inference.tracking.observed import Observed, observed_of
from inference.tracking.places import Places
from inference.tracking.readings_table import ReadingsTable
from inference.tracking.rules import MisfitLimits, is_felt, misfit_limits, rules_of
from inference.tracking.settings import TrackingSettings
from inference.tracking.state import TrackState
from inference.tracking.stated_priors import check_carried
from inference.tracking.tabulate import empty_readings, knots_of, places_of, table_of
from inference.tracking.weighing import Model
from simulator.errors import InvalidInputError, Problem, RefusedError, listed
from simulator.model_error import ModelError
from simulator.parameters import Terms, parameters_of
from simulator.range_prior import RangePrior
from simulator.scene import Reference, Scene, Stroke
from simulator.sensor import PulsedSensor, Sensor, instrument
from simulator.sensor_unknowns import DRIFTS, sensor_at

__all__ = ["Tracker", "tracker"]

Array = NDArray[np.float64]

_TURN = 1.0  # radians by which a sine wave may be wrong


@dataclasses.dataclass(frozen=True, eq=False)
class Tracker:
    """What a stream needs besides its state; made once by `tracker`.

    Attributes
    ----------
    sensor : Sensor
        The sensor.
    settings : TrackingSettings
        The settings.
    observed : Observed
        What is read of every frame.
    model : Model
        What the kernels take.
    limits : MisfitLimits
        Above what the model does not fit: of the running surprise, of the running mean of changes
        across the curve, and of what lasts there.
    first : TrackState
        The state before any frame.
    added_sd : ndarray, shape (knots,), optional
        Standard deviation of log r by errors of the model, or of the table itself, that the filter
        does not carry along, at the knots of the table.
    crosstalk : (float, float)
        Its best value before any frame [reading units]: what is not turned with the light where the
        sensor's delay follows its temperature.
    crosstalk_bounds : ndarray, shape (2, 2), optional
        Least and largest that learnt crosstalk is as its prior says [reading units].
    """

    sensor: Sensor
    settings: TrackingSettings
    observed: Observed
    model: Model
    limits: MisfitLimits
    first: TrackState
    added_sd: Array | None = None
    crosstalk: tuple[float, float] = (0.0, 0.0)
    crosstalk_bounds: Array | None = None

    def added(self, positions: Array) -> Array:
        """Return that standard deviation at given log r; 0 where the filter carries everything."""
        if self.added_sd is None:
            return np.zeros_like(positions)
        table = self.model.table
        knots = np.linspace(table.start, table.end, self.added_sd.size)
        return np.interp(positions, knots, self.added_sd)

    @property
    def learns_crosstalk(self) -> bool:
        """Whether the crosstalk is part of the state."""
        # not by the kernel: whoever asks it of every batch would wait for the interpreter's clock
        return bool(self.first.hypotheses.X.shape[1] > WITHOUT_CROSSTALK)


def tracker(
    sensor: Sensor,
    scene: Scene,
    settings: TrackingSettings | None = None,
    posterior: Posterior | Array | None = None,
) -> Tracker:
    """Prepare to track one object.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    scene : Scene
        What is known. Its ``range_m`` is the law of where objects appear, and its support the only
        ranges that are possible at all.
    settings : TrackingSettings, optional
        How objects move, come and go.
    posterior : Posterior or ndarray, shape (draws, d), optional
        What is known of the scene's unknowns: draws in SI units in the order of
        ``parameters_of(sensor, scene).names``. Their uncertainty is common to all frames: it is in
        every standard deviation and does not average down. Left out, it is the scene's joint law,
        where it has one, and the priors of object and gain.

    Returns
    -------
    Tracker

    Raises
    ------
    InvalidInputError
        Where `check_scene` refuses the scene (pointers below "/scene"), for draws that do not
        belong to it ("/posterior"), or for settings that do not belong to the sensor ("/settings").
    RefusedError
        Where there is no honest answer: unknowns without a posterior, but for crosstalk and an
        object whose light is known to a factor of two; tangential motion, optional terms,
        derivatives with an uncertain scene, crosstalk to learn of a sensor whose delay drifts, an
        error of the distance of more than a radian of a sine wave.
    """
    settings = TrackingSettings() if settings is None else settings
    try:
        parameters = parameters_of(sensor, scene)
    except InvalidInputError as error:
        raise error.below("/scene") from None
    _check(sensor, scene, settings)
    observed = observed_of(sensor, settings)
    unknown_crosstalk = tuple(n for n in parameters.crosstalk or () if n in parameters.names)
    told = () if parameters.law is None else parameters.law.names
    untold = [name for name in unknown_crosstalk if name not in told]
    learns = not observed.by_rate and (
        settings.crosstalk_drift is not None or (posterior is None and bool(untold))
    )
    if learns and sensor.temperature is not None and sensor.temperature.known[1] != 0.0:
        raise RefusedError(
            "the sensor's delay follows its temperature and crosstalk does not: a tracker that "
            "learns crosstalk could not take them apart; state its numbers, or calibrate"
        )
    # derivatives do not see crosstalk at all
    spared = unknown_crosstalk if learns or observed.by_rate else ()
    known = nuisance_of(scene, parameters, posterior, spared)
    static = (0.0, 0.0)
    if known.centre.crosstalk is not None:
        first, second = known.centre.crosstalk[0].tolist()
        static = (first, second)
    sensor = sensor_at(sensor, known.centre)
    if observed.by_rate and known.plus:
        raise RefusedError(
            "derivatives can be tracked only with a known scene; state its values as numbers, or "
            "track the readings"
        )
    law = _law(parameters.range_prior, known.centre)
    knots = knots_of(sensor, known.centre, law, observed, settings.rate_sd)
    check_carried(scene, known, knots.positions)
    # what derivatives owe to errors of the model is added to what the filter says
    erring = scene.model_error
    carried = ModelError(0.0, 0.0, integrated=False)
    if not observed.by_rate:
        # numbers, a joint law, and priors about numbers come from a fit
        whole = posterior is not None and any(
            n.startswith("object.") and n not in told for n in parameters.names
        )
        carried = erring if whole else erring.beside_numbers()
    jacobian = nuisance_jacobian(sensor, carried, known, knots, observed.scale, not learns)
    crosstalk = np.zeros(2)
    if known.centre.crosstalk is not None and not observed.by_rate:
        crosstalk = known.centre.crosstalk[0] * observed.scale
    table = table_of(knots, jacobian.along, np.zeros(2) if learns else crosstalk, observed)
    empty = empty_readings(sensor, known.centre, observed.by_rate) * observed.scale
    bare = np.column_stack([empty, jacobian.empty])
    places = places_of(knots, jacobian.along, bare, observed, settings.rate_sd)
    rules = rules_of(settings, observed, scene.motion == "static", jacobian)
    limits = misfit_limits(settings, rules, observed.channels, jacobian)
    one, other = parameters.crosstalk or ("", "")
    by_prior = posterior is None and one in untold, posterior is None and other in untold
    first = first_state(
        scene,
        settings,
        jacobian.empty.shape[1],
        crosstalk if learns else None,
        crosstalk_root(known, observed.scale),
        observed.scale,
        by_prior,
        is_felt(jacobian) and observed.channels == 2 and not observed.by_rate,
    )
    first = dataclasses.replace(first, signature=_signature(table, places, rules, first.hypotheses))
    model = Model(table, places, rules, first.hypotheses)
    added = sd_by_derivatives(sensor, erring, known.centre, knots, observed)
    by_table = sd_by_table(knots, observed.by_rate)
    if by_table is not None:
        added = by_table if added is None else np.hypot(added, by_table)
    bounds = crosstalk_bounds(scene, settings, by_prior) if learns else None
    return Tracker(sensor, settings, observed, model, limits, first, added, static, bounds)


def _check(sensor: Sensor, scene: Scene, settings: TrackingSettings) -> None:
    """Refuse what cannot be tracked honestly."""
    if scene.motion == "tangential":
        raise RefusedError(
            "an object that moves tangentially changes its amplitude at a fixed range, which the "
            'tracker cannot tell from a change of range; use motion "radial", or estimates'
        )
    if scene.optional_terms:
        raise RefusedError(
            f"{', '.join(scene.optional_terms)} optional: a stream cannot wait for the data to "
            "decide; keep the term or leave it out of the scene"
        )
    drifting = [path for path in sensor.unknown if path in DRIFTS]
    if drifting:
        raise RefusedError(
            f"{listed(drifting)} unknown: what that does to a range changes with the temperature, "
            "and a tracker takes a number; state the median of a posterior, and calibrate with it",
            *(Problem(f"/{path.replace('.', '/')}", "must be a number here") for path in drifting),
        )
    _, wave = instrument(sensor)
    if wave is not None and wave[0] * scene.model_error.range_m > _TURN:
        raise RefusedError(
            f"an error of the distance of {scene.model_error.range_m:g} m turns the sine wave by "
            "more than a radian: a tracker takes it as a small error of the readings; state "
            "discrepancy.range_m as it is, or a lower frequency"
        )
    if settings.observables in ("w1", "w2") and not isinstance(sensor, PulsedSensor):
        raise InvalidInputError.at(
            "/settings/observables", f"{settings.observables!r} is a window of a pulse"
        )
    if settings.observables == "derivatives" and sensor.noise.derivative is None:
        raise InvalidInputError.at("/sensor/noise/derivative", "is missing: derivatives are read")


def _law(stated: RangePrior, centre: Terms) -> Any:
    """Return the law of ranges: log-uniform on its support where none tells how they are spread."""
    law = centre.ranges.copy()
    if isinstance(stated, Stroke | Reference):
        low, high = law[0, 6], law[0, 7]
        if not high > low:
            raise RefusedError(
                f"the scene's background is known to be nearer than every range from {low:g} m on, "
                "and an object stands before it; lower `range_m`, or raise `background.distance_m`"
            )
        law[0] = [-math.log(math.log(high / low)), -1.0, 0.0, 0.0, 0.0, 0.0, low, high]
    return prior_of(law[0])


def _signature(table: ReadingsTable, places: Places, rules: Rules, hypotheses: Hypotheses) -> str:
    """Return a digest of everything that gives a state its meaning."""
    digest = hashlib.sha256()
    shapes = np.array([*hypotheses.x.shape, *hypotheses.X.shape, hypotheses.numbers.size])
    for value in _leaves((table, places, rules, shapes)):
        array = np.asarray(value)
        digest.update(str((array.shape, array.dtype.str)).encode())
        digest.update(array.tobytes())
    return digest.hexdigest()[:16]


def _leaves(value: Any) -> Iterator[Any]:
    """Return the numbers and arrays of nested tuples, in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
    else:
        yield value
