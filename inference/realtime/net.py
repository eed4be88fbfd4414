"""Readings net of known crosstalk, at the sensor's own gain, with their covariance."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Instrument, instrument_of
from inference.frame.noise import covariance, noise_of
from inference.technique import Task
from simulator.compiled import compiled
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
    "on_time",
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
        Their noise (`inference.frame.noise`), the relative error of the object's signal apart.
    relative : float
        Standard deviation of that relative error; 0 where it is part of the noise.
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

    def variance(self, g1: Array | float, g2: Array | float) -> Array:
        """Return the variance of g1 first + g2 second from noise that is not relative."""
        # in this order nothing overflows that does not have to
        return np.asarray(
            g1 * (g1 * self.var1) + g2 * (g2 * self.var2) + 2.0 * g1 * (g2 * self.cov)
        )

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
    state[frames.saturated(sensor)] = SATURATED
    return state


def net_readings(
    sensor: Sensor, crosstalk: tuple[float, float], frames: Frames, with_relative: bool = False
) -> Net:
    """Subtract known crosstalk and divide by the frame's gain.

    Parameters
    ----------
    sensor : Sensor
        Its noise.
    crosstalk : (float, float)
        To subtract, in reading units.
    frames : Frames
        The frames.
    with_relative : bool
        Whether the relative error of the object's signal, which frames do not share, is part of
        the noise; it is apart otherwise. That of the source does not cancel beside crosstalk, and
        always is.

    Returns
    -------
    Net
        Signals and noise.
    """
    n = len(frames)
    noise = instrument_of(sensor)
    # sizes of zero rather than None: the machine code is one, and here costs nothing
    with_relative = with_relative or sensor.noise.flickers
    whole = noise._replace(
        shot=noise.shot or 0.0, relative=(noise.relative or 0.0) if with_relative else 0.0
    )
    gain = frames.gains
    net = Net(
        first=np.empty(n),
        second=np.empty(n),
        var1=np.empty(n),
        var2=np.empty(n),
        cov=np.empty(n),
        relative=0.0 if with_relative else sensor.noise.relative,
        state=rule_out(sensor, frames),
    )
    _fill(np.ascontiguousarray(frames.readings), crosstalk, gain, whole, net)
    return on_time(sensor, net)


def on_time(sensor: Sensor, net: Net) -> Net:
    """Return signals as a pulse without timing offset would give them.

    Of an offset of length s the late window has w1 = w2 (r + s) / r0, so that w1 - w2 s / r0 is
    what it would be without (docs/model.md, sensor-unknowns): linear, and so is its noise.

    Parameters
    ----------
    sensor : Sensor
        The sensor; another one's signals stay as they are.
    net : Net
        Its signals, or their derivatives.
    """
    if not isinstance(sensor, PulsedSensor) or sensor.timing_offset_s is None:
        return net
    if not isinstance(sensor.timing_offset_s, float | int):
        return net  # the plan lets nothing but w2 be read of such a sensor
    share = sensor.known_shift_m / sensor.r0
    return net._replace(
        first=net.first - share * net.second,
        var1=net.variance(np.ones_like(net.var1), np.full_like(net.var1, -share)),
        cov=net.cov - share * net.var2,
    )


@compiled
def _fill(
    readings: Array, crosstalk: tuple[float, float], gain: Array, instrument: Instrument, net: Net
) -> None:
    """Fill in signals and noise, and mark the frames that are beyond what a number can hold."""
    first_crosstalk, second_crosstalk = crosstalk
    for i in range(gain.size):
        raw1, raw2 = readings[i, 0], readings[i, 1]
        first, second = raw1 - first_crosstalk, raw2 - second_crosstalk
        matrix = covariance(noise_of((raw1, raw2), (first, second), instrument))
        square = gain[i] * gain[i]
        net.first[i], net.second[i] = first / gain[i], second / gain[i]
        net.var1[i], net.var2[i] = _held(matrix.e11) / square, _held(matrix.e22) / square
        net.cov[i] = _held(matrix.e21) / square
        finite = math.isfinite(net.first[i]) and math.isfinite(net.second[i])
        if not finite and net.state[i] == 0:
            net.state[i] = UNREPRESENTABLE


@compiled
def _held(variance: float) -> float:
    """Return a variance: infinite where its parts are beyond what a number can hold."""
    return variance if variance == variance else math.inf


def known_net_readings(task: Task) -> Net:
    """Return the readings net of a task's crosstalk, which the plan has found to be known.

    Parameters
    ----------
    task : Task
        The request.
    """
    assert task.known.crosstalk is not None  # noqa: S101  # the plan leaves the technique out
    return net_readings(task.sensor, task.known.crosstalk, task.frames)
