"""What a stream that calibrates itself needs besides its state."""

import dataclasses
import functools

import numpy as np

from inference.self_calibration.gathering import nothing_kept
from inference.self_calibration.scenes import (
    check_unknown,
    open_names,
    prior_scene,
    trackable,
)
from inference.self_calibration.state import CalibrationState
from inference.tracking.settings import TrackingSettings
from inference.tracking.tracker import Tracker, tracker
from simulator.at_temperature import at_reference
from simulator.errors import InvalidInputError, Problem, RefusedError
from simulator.frames import Frames, check_frames
from simulator.scene import Scene
from simulator.sensor import Sensor
from simulator.sensor_unknowns import DRIFTS

__all__ = ["Plan", "begin", "plan_of"]


@dataclasses.dataclass(frozen=True)
class Plan:
    """A stream that calibrates itself.

    Attributes
    ----------
    sensor : Sensor
        The sensor, without temperature coefficients.
    stated : Scene
        The scene as it was stated.
    settings : TrackingSettings
        How objects move, come and go.
    seed : int
        From which the seeds of its calibrations come.
    reads : Sensor
        The sensor as it was stated, whose frames come.
    """

    sensor: Sensor
    stated: Scene
    settings: TrackingSettings
    seed: int
    reads: Sensor

    def at_reference(self, frames: Frames) -> Frames:
        """Return frames as the sensor reads them at its reference temperature.

        Raises
        ------
        InvalidInputError
            At "/frames/temperature_k" where a temperature that plays a part is not known.
        """
        if self.reads.temperature is None:
            return frames
        check_frames(self.reads, frames)
        if frames.temperature_k is not None and np.isnan(frames.temperature_k).any():
            at = int(np.isnan(frames.temperature_k).argmax())
            raise InvalidInputError.at(
                "/frames/temperature_k",
                f"entry {at} is not known: a stream that calibrates itself needs it in every frame",
            )
        return at_reference(self.reads, frames, _numbers(self.stated) or (0.0, 0.0))[1]

    def reader(self) -> Tracker:
        """Return a tracker that takes frames as they come."""
        return _tracker(self.reads, begin(self).scene, self.settings)

    def tracker(self, scene: Scene) -> Tracker:
        """Return the tracker of a scene.

        Crosstalk that drifts widens the scene (`inference.self_calibration.drift`), and is not
        learnt on line: what is learnt beside an object whose shape is open is sure and wrong
        (docs/limits.md).

        Parameters
        ----------
        scene : Scene
            Of which every unknown has a law.
        """
        return _tracker(self.sensor, scene, self.settings)


@functools.lru_cache(maxsize=64)
def _tracker(sensor: Sensor, scene: Scene, settings: TrackingSettings) -> Tracker:
    return tracker(sensor, scene, settings.model_copy(update={"crosstalk_drift": None}))


def plan_of(sensor: Sensor, scene: Scene, settings: TrackingSettings, seed: int) -> Plan:
    """Check that a stream can calibrate itself.

    Parameters
    ----------
    sensor, scene, settings, seed
        As of `Plan`.

    Raises
    ------
    InvalidInputError
        At "/calibrate" where nothing is unknown; as `inference.tracking.tracker.tracker`.
    RefusedError
        Where there is no tracker for it; where a temperature coefficient is unknown, or that of the
        delay is stated beside unknown crosstalk.
    """
    drifting = [path for path in sensor.unknown if path in DRIFTS]
    if drifting:
        raise RefusedError(
            "temperature coefficients unknown: calibrations of a stream could not tell their drift "
            "from that of the crosstalk; calibrate from recorded frames, and state what has been "
            "found",
            *(Problem(f"/{path.replace('.', '/')}", "must be a number here") for path in drifting),
        )
    cold = sensor
    if sensor.temperature is not None:
        if sensor.temperature.known[1] != 0.0 and _numbers(scene) is None:
            raise RefusedError(
                "the sensor's delay follows its temperature, which turns the light and not the "
                "crosstalk: a stream that calibrates itself takes delay_drift_s_per_k beside "
                "crosstalk as numbers alone; calibrate from recorded frames, and track with what "
                "that has found",
                Problem("/scene/crosstalk", "must be numbers here"),
            )
        cold = sensor.model_copy(update={"temperature": None})
    check_unknown(cold, scene)
    plan = Plan(cold, scene, settings, seed, sensor)
    begin(plan)
    return plan


def _numbers(scene: Scene) -> tuple[float, float] | None:
    """Return crosstalk that is known, 0 where there is none; None where it is not."""
    first, second = scene.crosstalk_values or (0.0, 0.0)
    if isinstance(first, float | int) and isinstance(second, float | int):
        return float(first), float(second)
    return None


def begin(plan: Plan) -> CalibrationState:
    """Return the state before any frame.

    A scene whose joint law already names all its unknowns is known; any other is not, and is
    tracked with all that its priors leave open.
    """
    told = () if plan.stated.joint is None else plan.stated.joint.unknowns
    known = set(open_names(plan.sensor, plan.stated)) <= set(told)
    scene = trackable(plan.sensor, plan.stated)
    return CalibrationState(
        track=plan.tracker(scene).first,
        scene=scene,
        before=plan.stated if not known else prior_scene(plan.stated),
        recent=nothing_kept(),
        gathered=nothing_kept(),
        calibrated=known,
        known=known,
        trusts_empty=known,
    )
