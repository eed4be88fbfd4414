"""Distance from hybrid intensity/time-of-flight sensors, with honest uncertainty.

::

    import hybridtof

    noise = {"read": [1e-5, 1e-3]}
    sensor = hybridtof.parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": noise})
    scene = hybridtof.parse_scene({"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}})
    frames = hybridtof.frames_from_columns(sensor, {"w1": w1, "w2": w2})
    estimates = hybridtof.estimate(sensor, scene, frames)

Units are SI throughout. Every public name stands here, and ``docs/api.md`` describes each of them.
A name is imported when it is first used: the package alone brings neither numpy nor a compiler.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from inference.estimate import all_roots, estimate
    from inference.estimates import Status
    from inference.identifiability.before_data import identifiability
    from inference.plan import plan
    from inference.posterior import fold
    from inference.posterior.calibrated import calibrated_scene
    from inference.posterior.infer import infer
    from inference.posterior.settings import SamplerSettings
    from inference.tracking.settings import TrackingSettings
    from inference.tracking.state import state_from_bytes, state_to_bytes
    from inference.tracking.track import step, track
    from inference.tracking.tracker import tracker
    from simulator.errors import HybridTofError, InvalidInputError, RefusedError
    from simulator.frames import Frames, frames_from_columns
    from simulator.scene import parse_scene
    from simulator.sensor import Sensor, parse_sensor
    from simulator.simulate import simulate
    from simulator.trajectories import RadialTrajectory, SampledTrajectory

    __version__: str

__all__ = [
    "Frames",
    "HybridTofError",
    "InvalidInputError",
    "RadialTrajectory",
    "RefusedError",
    "SampledTrajectory",
    "SamplerSettings",
    "Status",
    "TrackingSettings",
    "__version__",
    "all_roots",
    "calibrated_scene",
    "estimate",
    "fold",
    "frames_from_columns",
    "identifiability",
    "infer",
    "parse_scene",
    "parse_sensor",
    "plan",
    "read_frames",
    "simulate",
    "state_from_bytes",
    "state_to_bytes",
    "step",
    "track",
    "tracker",
]

# where each name lives: a function that moves is entered here, and in the imports above
_HOMES = {
    "Frames": "simulator.frames",
    "HybridTofError": "simulator.errors",
    "InvalidInputError": "simulator.errors",
    "RadialTrajectory": "simulator.trajectories",
    "RefusedError": "simulator.errors",
    "SampledTrajectory": "simulator.trajectories",
    "SamplerSettings": "inference.posterior.settings",
    "Status": "inference.estimates",
    "TrackingSettings": "inference.tracking.settings",
    "all_roots": "inference.estimate",
    "calibrated_scene": "inference.posterior.calibrated",
    "estimate": "inference.estimate",
    "fold": "inference.posterior",
    "frames_from_columns": "simulator.frames",
    "identifiability": "inference.identifiability.before_data",
    "infer": "inference.posterior.infer",
    "parse_scene": "simulator.scene",
    "parse_sensor": "simulator.sensor",
    "plan": "inference.plan",
    "simulate": "simulator.simulate",
    "state_from_bytes": "inference.tracking.state",
    "state_to_bytes": "inference.tracking.state",
    "step": "inference.tracking.track",
    "track": "inference.tracking.track",
    "tracker": "inference.tracking.tracker",
}


def read_frames(sensor: "Sensor", path: "str | Path") -> "Frames":
    """Read frames from a file.

    Parameters
    ----------
    sensor : Sensor
        Decides which columns are readings.
    path : str or Path
        ``.csv``: a header with the names of the columns and one frame a row; ``.ndjson``: one
        frame a line; ``.json``: an object of columns.

    Returns
    -------
    Frames
        The frames, checked as by `frames_from_columns`.

    Raises
    ------
    InvalidInputError
        A pointer ``/column`` or ``/column/index`` for each offending field, the line in the text.
    HybridTofError
        Where the file cannot be read as what its name says, or its name says nothing.
    OSError
        Where it cannot be opened.
    """
    from pathlib import Path

    from service import frame_files
    from simulator.frames import frames_from_columns

    return frames_from_columns(sensor, frame_files.read_frames(Path(path)))


# hidden from type checkers, which would take any misspelt name for one that this function knows
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            # slower to import than all of this
            value: Any = importlib.import_module("importlib.metadata").version("hybridtof")
        elif name == "fold":
            value = importlib.import_module("inference.posterior.fold")
        elif name in _HOMES:
            value = getattr(importlib.import_module(_HOMES[name]), name)
            if hasattr(value, "model_rebuild"):
                value.model_rebuild()  # or help() does not know what it takes
        else:
            raise AttributeError(f"module 'hybridtof' has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return __all__
