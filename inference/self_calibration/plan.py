"""What a stream that calibrates itself needs besides its state."""

import dataclasses
import functools

from inference.self_calibration.gathering import nothing_kept
from inference.self_calibration.scenes import (
    check_unknown,
    prior_scene,
    trackable,
    unknowns_of,
)
from inference.self_calibration.state import CalibrationState
from inference.tracking.settings import TrackingSettings
from inference.tracking.tracker import Tracker, tracker
from simulator.errors import RefusedError
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Plan", "begin", "plan_of"]


@dataclasses.dataclass(frozen=True)
class Plan:
    """A stream that calibrates itself.

    Attributes
    ----------
    sensor : Sensor
        The sensor.
    stated : Scene
        The scene as it was stated.
    settings : TrackingSettings
        How objects move, come and go.
    seed : int
        From which the seeds of its calibrations come.
    """

    sensor: Sensor
    stated: Scene
    settings: TrackingSettings
    seed: int

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
        Where there is no tracker for it; of a sensor with temperature coefficients.
    """
    if sensor.temperature is not None:
        raise RefusedError(
            "a stream that calibrates itself takes no temperature coefficients: its calibrations "
            "would have to tell their drift from that of the crosstalk; calibrate from recorded "
            "frames, and track with what that has found"
        )
    check_unknown(sensor, scene)
    plan = Plan(sensor, scene, settings, seed)
    begin(plan)
    return plan


def begin(plan: Plan) -> CalibrationState:
    """Return the state before any frame.

    A scene whose joint law already names all its unknowns is known; any other is not, and is
    tracked with all that its priors leave open.
    """
    told = () if plan.stated.joint is None else plan.stated.joint.unknowns
    known = set(unknowns_of(plan.sensor, plan.stated)) <= set(told)
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
