"""Readings net of known crosstalk, at the sensor's own gain, with their covariance."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.technique import Task
from simulator.frames import Frames
from simulator.sensor import PulsedSensor, Sensor

__all__ = [
    "ABSENT",
    "COMMON_REASONS",
    "SATURATED",
    "UNREPRESENTABLE",
    "Form",
    "Net",
    "known_net_readings",
    "net_readings",
    "rule_out",
]

Array = NDArray[np.float64]

# the first reasons of every technique; a frame's state is its index among them
COMMON_REASONS = (
    "",
    "a reading is at or beyond full scale",
    "the scene holds no object",
    "the readings are too large or too small to be computed with",
)
SATURATED, ABSENT, UNREPRESENTABLE = 1, 2, 3


class Form(NamedTuple):
    """A linear form of two readings: ``first`` times the first, ``second`` times the second."""

    first: float
    second: float


class Net(NamedTuple):
    """Signals of object and background.

    Attributes
    ----------
    first, second : ndarray, shape (n,)
        Readings less crosstalk, over the frame's gain.
    var1, var2, cov : ndarray, shape (n,)
        Their noise but for the relative error of the object's signal.
    relative : float
        Standard deviation of that relative error.
    state : ndarray of uint8, shape (n,)
        0, or the index among `COMMON_REASONS` of what rules the frame out.
    """

    first: Array
    second: Array
    var1: Array
    var2: Array
    cov: Array
    relative: float
    state: NDArray[np.uint8]

    def variance(self, g1: Array, g2: Array) -> Array:
        """Return the variance of g1 first + g2 second from noise that is not relative."""
        # in this order nothing overflows that does not have to
        return g1 * (g1 * self.var1) + g2 * (g2 * self.var2) + 2.0 * g1 * (g2 * self.cov)

    def covariance(self, a: Form, b: Form) -> Array:
        """Return the covariance of two linear forms, from noise that is not relative."""
        both = a.first * b.second + a.second * b.first
        return a.first * b.first * self.var1 + a.second * b.second * self.var2 + both * self.cov

    def select(self, rows: slice | NDArray[np.intp]) -> "Net":
        """Return some of the frames."""
        return Net(
            self.first[rows],
            self.second[rows],
            self.var1[rows],
            self.var2[rows],
            self.cov[rows],
            self.relative,
            self.state[rows],
        )


def rule_out(sensor: Sensor, frames: Frames) -> NDArray[np.uint8]:
    """Return the state of each frame: saturated, without an object, or 0.

    Parameters
    ----------
    sensor : Sensor
        Its full scale.
    frames : Frames
        The frames.
    """
    state = np.zeros(len(frames), dtype=np.uint8)
    if frames.object_present is not None:
        state[~frames.object_present] = ABSENT
    if sensor.full_scale is not None:
        beyond = np.abs(frames.readings) >= np.asarray(sensor.full_scale)
        state[beyond.any(axis=1)] = SATURATED
    return state


def net_readings(sensor: Sensor, crosstalk: tuple[float, float], frames: Frames) -> Net:
    """Subtract known crosstalk and divide by the frame's gain.

    Parameters
    ----------
    sensor : Sensor
        Its noise.
    crosstalk : (float, float)
        To subtract, in reading units.
    frames : Frames
        The frames.

    Returns
    -------
    Net
        Signals and noise.
    """
    raw1, raw2 = frames.readings[:, 0], frames.readings[:, 1]
    noise = sensor.noise
    with np.errstate(all="ignore"):
        first, second = raw1 - crosstalk[0], raw2 - crosstalk[1]
        var1, var2 = np.full(raw1.size, noise.read[0] ** 2), np.full(raw1.size, noise.read[1] ** 2)
        cov = np.zeros(raw1.size)
        if noise.shot > 0:
            shot1, shot2 = noise.shot * np.abs(raw1), noise.shot * np.abs(raw2)
            var1, var2 = var1 + shot1, var2 + shot2
            if isinstance(sensor, PulsedSensor):
                cov = np.minimum(shot1, shot2)
        if frames.gain is not None:
            first, second = first / frames.gain, second / frames.gain
            square = frames.gain**2
            var1, var2, cov = var1 / square, var2 / square, cov / square
    state = rule_out(sensor, frames)
    bad = ~(np.isfinite(first) & np.isfinite(second))
    state[bad & (state == 0)] = UNREPRESENTABLE
    return Net(first, second, var1, var2, cov, noise.relative, state)


def known_net_readings(task: Task) -> Net:
    """Return the readings net of a task's crosstalk, which the plan has found to be known.

    Parameters
    ----------
    task : Task
        The request.
    """
    assert task.known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    return net_readings(task.sensor, task.known.crosstalk, task.frames)
