"""A tracker: sensor, scene and settings turned into what the filter's kernels want."""

import dataclasses
import hashlib
import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inference.density.rows import law_of
from inference.posterior.answer.posterior import Posterior
from inference.tracking.columns import columns_of, crosstalk_change
from inference.tracking.curve import Curve, Places
from inference.tracking.first_state import first_state
from inference.tracking.globals import globals_of
from inference.tracking.motion import Rules
from inference.tracking.settings import TrackingSettings
from inference.tracking.state import TrackState
from inference.tracking.tabulate import boxes_of, empty_readings, knots_of, means_over, scan_of
from simulator.errors import InvalidInputError, RefusedError
from simulator.parameters import Terms, parameters_of
from simulator.scene import Reference, Scene, Stroke
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["Tracker", "tracker"]

Array = NDArray[np.float64]

_BREADTH = 10.0
_SAME = 0.05
_SURPRISE_TAIL = 1e-4  # probability beyond which a single frame's surprise is cut


@dataclasses.dataclass(frozen=True, eq=False)
class Tracker:
    """What a stream needs besides its state; made once by `tracker`.

    Attributes
    ----------
    sensor : Sensor
        The sensor.
    settings : TrackingSettings
        The settings.
    units : (float, float)
        Noise of the two observables, in which the kernels count [reading units, or a second].
    curve, places, rules : Curve, Places, Rules
        The kernels' arguments.
    limit : float
        Running surprise above which the model does not fit.
    first : TrackState
        The state before any frame.
    """

    sensor: Sensor
    settings: TrackingSettings
    units: tuple[float, float]
    curve: Curve
    places: Places
    rules: Rules
    limit: float
    first: TrackState

    @property
    def arguments(self) -> tuple[Curve, Places, Rules]:
        """What the kernels take."""
        return self.curve, self.places, self.rules

    @property
    def learns_crosstalk(self) -> bool:
        """Whether the crosstalk is part of the state."""
        return bool(self.first.x.shape[1] > 2)


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
        every standard deviation and does not average down.

    Returns
    -------
    Tracker

    Raises
    ------
    InvalidInputError
        Where `check_scene` refuses the scene (pointers below "/scene"), for draws that do not
        belong to it ("/posterior"), or for settings that do not belong to the sensor ("/settings").
    RefusedError
        Where there is no honest answer: unknowns without a posterior, tangential motion, optional
        terms, derivatives with an uncertain scene.
    """
    settings = TrackingSettings() if settings is None else settings
    try:
        parameters = parameters_of(sensor, scene)
    except InvalidInputError as error:
        raise error.below("/scene") from None
    _check(sensor, scene, settings)
    by_rate = settings.observables == "derivatives"
    crosstalk_names = parameters.crosstalk or ()
    unknown_crosstalk = tuple(name for name in crosstalk_names if name in parameters.names)
    learns = not by_rate and (
        settings.crosstalk_drift is not None or (posterior is None and bool(unknown_crosstalk))
    )
    # derivatives do not see crosstalk at all
    spared = unknown_crosstalk if learns or by_rate else ()
    known = globals_of(parameters, posterior, spared)
    if by_rate and known.plus:
        raise RefusedError(
            "derivatives can be tracked only with a known scene; state its values as numbers, or "
            "track the readings"
        )
    units = _units(sensor, by_rate)
    used = np.array([settings.observables != "w2", settings.observables != "w1"])
    scale = np.where(used, 1.0 / np.asarray(units), 0.0)
    factors = np.tile(scale, 4)
    law = _law(scene, known.centre)
    rate = 5.0 * settings.rate_sd if by_rate else 1.0
    knots = knots_of(
        sensor, law, lambda u: means_over(u, sensor, known.centre, by_rate) * factors, rate
    )
    columns, empty_columns = columns_of(sensor, scene, known, knots, factors, not learns)
    changes = [
        crosstalk_change(*pair) * scale for pair in zip(known.plus, known.minus, strict=True)
    ]
    noise = sensor.noise
    relative, shot = (0.0, 0.0) if by_rate else (noise.relative, noise.shot)
    fixed, offset = np.zeros(2), np.zeros(2)
    if known.centre.crosstalk is not None and not by_rate:
        offset = known.centre.crosstalk[0] * scale
    if not learns:
        fixed = offset
    scan = scan_of(knots, by_rate, settings.rate_sd)
    curve = Curve(
        table=np.ascontiguousarray(
            np.column_stack(
                [
                    knots.means * np.repeat([1.0, knots.step, 1.0, knots.step], 2),
                    knots.log_prior,
                    columns,
                ]
            )
        ),
        start=float(knots.positions[0]),
        step=knots.step,
        end=float(knots.positions[-1]),
        crosstalk1=float(fixed[0]),
        crosstalk2=float(fixed[1]),
        by_rate=by_rate,
        plain=relative == 0.0 and shot == 0.0,
        shot1=shot * float(scale[0]),
        shot2=shot * float(scale[1]),
        ratio=units[0] / units[1],
        relative=relative,
        pulsed=isinstance(sensor, PulsedSensor),
        channels=int(used.sum()),
    )
    places = Places(
        knots.positions[scan],
        np.searchsorted(scan, np.arange(knots.positions.size)).astype(np.int64),
        np.column_stack([empty_readings(sensor, known.centre, by_rate) * scale, empty_columns]),
        *boxes_of(knots, scan),
    )
    memory = 1.0 - 1.0 / settings.window
    freedom = 0.5 * curve.channels * (1.0 + memory) / (1.0 - memory)
    drift = settings.crosstalk_drift or (0.0, 0.0)
    rules = Rules(
        leave=1.0 / settings.visit_s,
        arrive=1.0 / settings.absence_s,
        rate_sd=0.0 if scene.motion == "static" else settings.rate_sd,
        rate_time=settings.rate_time_s,
        drift1=drift[0] * float(scale[0]),
        drift2=drift[1] * float(scale[1]),
        outlier=settings.outlier,
        breadth=_BREADTH,
        log_negligible=math.log(settings.negligible),
        same=_SAME,
        memory=memory,
        most_surprise=float(stats.chi2.isf(_SURPRISE_TAIL, curve.channels)),
        unique_above=settings.unique_above,
    )
    limit = float(stats.gamma.isf(settings.false_alarm, freedom, scale=1.0 / freedom))
    first = first_state(
        scene,
        settings,
        empty_columns.shape[1],
        offset if learns else None,
        np.array(changes).reshape(-1, 2).T,
        scale,
    )
    shapes = np.array([*first.x.shape, *first.X.shape])
    first = dataclasses.replace(first, signature=_signature(curve, places, rules, (shapes,)))
    return Tracker(sensor, settings, units, curve, places, rules, limit, first)


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
    if settings.observables in ("w1", "w2") and not isinstance(sensor, PulsedSensor):
        raise InvalidInputError.at(
            "/settings/observables", f"{settings.observables!r} is a window of a pulse"
        )
    if settings.observables == "derivatives" and sensor.noise.derivative is None:
        raise InvalidInputError.at("/sensor/noise/derivative", "is missing: derivatives are read")
    if settings.observables == "derivatives" and scene.discrepancy is not None:
        raise RefusedError(
            "derivatives can be tracked only with a known scene; leave discrepancy out, or track "
            "the readings"
        )


def _units(sensor: Sensor, by_rate: bool) -> tuple[float, float]:
    if by_rate:
        assert sensor.noise.derivative is not None  # noqa: S101  # checked before
        return sensor.noise.derivative
    return sensor.noise.read


def _law(scene: Scene, centre: Terms) -> Any:
    """Return the law of ranges; of one with unknowns of its own the support alone."""
    law = centre.ranges.copy()
    if isinstance(scene.range_m, Stroke | Reference):
        low, high = law[0, 6], law[0, 7]
        law[0] = [-math.log(math.log(high / low)), -1.0, 0.0, 0.0, 0.0, 0.0, low, high]
    return law_of(law, 0)


def _signature(*parts: Any) -> str:
    """Return a digest of everything that gives a state its meaning."""
    digest = hashlib.sha256()
    for value in itertools.chain(*parts):
        array = np.asarray(value)
        digest.update(str((array.shape, array.dtype.str)).encode())
        digest.update(array.tobytes())
    return digest.hexdigest()[:16]
