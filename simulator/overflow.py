"""Which field of a simulation made a number overflow."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from simulator.errors import InvalidInputError
from simulator.scene import Crosstalk, Scene
from simulator.sensor import Sensor
from simulator.trajectories import RadialTrajectory, SampledTrajectory

__all__ = ["check_drawn", "check_readings"]

Array = NDArray[np.float64]

_BEYOND = "is beyond what a number can hold"


def check_drawn(scene: Scene, drawn: Mapping[str, float]) -> None:
    """Check values that were drawn from priors.

    Parameters
    ----------
    drawn : mapping of str to float
        Values of its unknowns by their names.

    Raises
    ------
    InvalidInputError
        With the pointer of the prior from which a value that is not finite was drawn.
    """
    for name, value in drawn.items():
        if math.isfinite(value):
            continue
        term, *members = name.split(".")
        if term == "crosstalk":
            members = ["0" if members[0] in ("w1", "i") else "1"]
            if isinstance(scene.crosstalk, Crosstalk):
                members.insert(0, "values")
        elif term == "range_m":
            members = []
        where = ["/sensor"] if term == "sensor" else ["/scene", term]
        raise InvalidInputError.at(
            "/".join([*where, *members]), f"a value drawn from the prior {_BEYOND}"
        )


def check_readings(
    sensor: Sensor,
    trajectory: RadialTrajectory | SampledTrajectory,
    factor: Array,
    moments: Array,
    readings: Array,
) -> None:
    """Check readings, and name the cause where one is not finite.

    Parameters
    ----------
    sensor : Sensor
        The sensor, nothing of it unknown.
    factor : ndarray, shape (n,)
        Factor on the object's signal in every frame.
    moments : ndarray, shape (n, 7)
        Means and noise parts (`simulator.readings.noise_parts`).
    readings : ndarray, shape (n, 2)
        What the sensor would deliver.

    Raises
    ------
    InvalidInputError
        With a pointer of the first frame that cannot be represented.
    """
    finite = np.isfinite(moments).all(axis=1) & np.isfinite(readings).all(axis=1)
    if finite.all():
        return
    frame = int(np.argmin(finite))
    mean = moments[frame, :2]
    if not math.isfinite(factor[frame]):
        raise InvalidInputError.at("/scene/discrepancy", f"the error of the flux {_BEYOND}")
    largest = float(np.abs(mean).max())
    if math.isfinite(largest):
        noise = sensor.noise
        sds = {
            "read": max(noise.read),
            "shot": math.sqrt(noise.shot) * math.sqrt(largest),
            "relative": float(np.abs(moments[frame, 5:]).max()),
        }
        name = max(sds, key=sds.__getitem__)
        if sds[name] >= largest:
            message = f"the noise of frame {frame} {_BEYOND}"
            raise InvalidInputError.at(f"/sensor/noise/{name}", message)
    if isinstance(trajectory, SampledTrajectory):
        amplitude = 1.0 if trajectory.amplitude is None else trajectory.amplitude[frame]
        column = "range_m" if amplitude <= 1.0 else "amplitude"
        where = f"{column}/{frame}"
    else:
        where = "from_m" if 2 * frame < moments.shape[0] else "to_m"
    raise InvalidInputError.at(
        f"/trajectory/{where}",
        f"the reading of frame {frame} {_BEYOND} at a gain of {sensor.known_gain:g}",
    )
