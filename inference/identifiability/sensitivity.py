"""Mean readings of every frame and their derivatives, analytic.

The information can lie eight orders of magnitude below the largest derivative, where finite
differences leave nothing.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from simulator.object_model import quadratic_minimum
from simulator.parameters import Terms
from simulator.sensor import Noise, PulsedSensor, Sensor

__all__ = [
    "COORDINATES",
    "Sensitivity",
    "sensitivity",
    "term_changes",
    "whitener_of",
    "whiteners",
]

Array = NDArray[np.float64]

COORDINATES = (
    "object.c0",
    "object.c1",
    "object.c2",
    "crosstalk.0",
    "crosstalk.1",
    "background.strength",
    "background.distance_m",
    "background.shadow.c0",
    "background.shadow.c1",
)
"""Columns of `Sensitivity.by_term`; a term that the scene lacks has columns of zeros.

Derivatives are along log c0, c1 / sqrt(c0) with c0 held, log c2, the crosstalk [reading units],
log B, log R, log c0' and c1' / sqrt(c0') with c0' held, everything else held.
"""


@dataclasses.dataclass(frozen=True, eq=False)
class Sensitivity:
    """Mean readings of n frames and how they change.

    Attributes
    ----------
    mean : ndarray, shape (n, 2)
        Mean readings [reading units].
    signal : ndarray, shape (n, 2)
        The object's part of them; zero for a frame without object.
    by_term : ndarray, shape (n, 2, 9)
        Derivatives along `COORDINATES`.
    by_range : ndarray, shape (n, 2)
        Derivative along log r; zero for a frame without object.
    """

    mean: Array
    signal: Array
    by_term: Array
    by_range: Array


def _quadratic(r: Array, c0: float, c1: float) -> Array:
    """Return Q = r^2 + c1 r + c0 without cancellation (`simulator.object_model.quadratic`)."""
    if c1 >= 0.0:
        return r * (r + c1) + c0
    return np.asarray((r + 0.5 * c1) ** 2 + quadratic_minimum(c0, c1))


def _carrier(sensor: Sensor, r: Array) -> tuple[Array, Array]:
    """Return what one unit of flux from range r reads, and its derivative along log r, (n, 2)."""
    if isinstance(sensor, PulsedSensor):
        late = r < sensor.r0  # beyond, the whole pulse is late (errata, 2.33)
        share = np.where(late, r / sensor.r0, 1.0)
        one = np.ones_like(share)
        return np.stack([share, one], axis=1), np.stack(
            [np.where(late, share, 0.0), 0.0 * one], axis=1
        )
    turn = sensor.wave_number * r
    phase = turn + sensor.phase_offset_rad
    cosine, sine = np.cos(phase), np.sin(phase)
    return np.stack([cosine, sine], axis=1), turn[:, None] * np.stack([-sine, cosine], axis=1)


def sensitivity(
    sensor: Sensor, terms: Terms, log_r: Array, gain: Array | None = None
) -> Sensitivity:
    """Differentiate the mean readings.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    terms : Terms
        Physical values; the first parameter vector is used.
    log_r : ndarray, shape (n,)
        log r of every frame [log m]; nan for a frame without object.
    gain : ndarray, shape (n,), optional
        Factor of each frame on the sensor's gain.

    Returns
    -------
    Sensitivity
        Not finite where a number overflows.
    """
    n = log_r.size
    factor = np.ones(n) if gain is None else gain
    present = np.isfinite(log_r)
    c0, c1, c2 = (float(value) for value in terms.object[0])
    by_term = np.zeros((n, 2, len(COORDINATES)))
    signal, mean, by_range = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
    r = np.exp(log_r[present])
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        q = _quadratic(r, c0, c1)
        flux = sensor.gain * factor[present] * c0 * c2 / r / r / q
        unit, turning = _carrier(sensor, r)
        signal[present] = flux[:, None] * unit
        slope = -2.0 - r * (2.0 * r + c1) / q  # d log Phi / d log r (4.13 with errata 4.18)
        by_range[present] = slope[:, None] * signal[present] + flux[:, None] * turning
        by_term[present, :, 0] = signal[present] * (r * (r + c1) / q)[:, None]
        by_term[present, :, 1] = -signal[present] * (r * math.sqrt(c0) / q)[:, None]
        by_term[:, :, 2] = signal
        mean += signal
        if terms.background is not None:
            _add_background(
                sensor, terms.background[0], r, present, factor, mean, by_range, by_term
            )
        if terms.crosstalk is not None:
            mean += terms.crosstalk[0]
            by_term[:, 0, 3] = by_term[:, 1, 4] = 1.0
    return Sensitivity(mean, signal, by_term, by_range)


def _add_background(
    sensor: Sensor,
    background: Array,
    r: Array,
    present: NDArray[np.bool_],
    factor: Array,
    mean: Array,
    by_range: Array,
    by_term: Array,
) -> None:
    """Add B S(r) of every frame, S = (r^2 + c1' r) / Q' (errata, 3.30)."""
    strength, distance, c0, c1 = (float(value) for value in background)
    q = _quadratic(r, c0, c1)
    visible = np.ones(present.size)
    visible[present] = r * (r + c1) / q
    bare, turning = (strength * part for part in _carrier(sensor, np.array([distance])))
    light = factor[:, None] * visible[:, None] * bare
    mean += light
    by_term[:, :, 5] = light
    by_term[:, :, 6] = factor[:, None] * visible[:, None] * turning
    here = factor[present, None] * bare
    by_range[present] += (r * c0 * (2.0 * r + c1) / q / q)[:, None] * here
    by_term[present, :, 7] = (-r * (r + c1) * c0 / q / q)[:, None] * here
    by_term[present, :, 8] = (math.sqrt(c0) * r * c0 / q / q)[:, None] * here


def term_changes(reference: Terms, plus: Terms, minus: Terms) -> Array:
    """Return how the coordinates differ between pairs of parameter vectors.

    Parameters
    ----------
    reference : Terms
        Its first vector gives the units of c1 and c1'.
    plus, minus : Terms
        k vectors each.

    Returns
    -------
    ndarray, shape (9, k)
        Differences along `COORDINATES`.
    """
    change = np.zeros((len(COORDINATES), plus.object.shape[0]))
    root = math.sqrt(float(reference.object[0, 0]))
    change[0], change[2] = np.log(plus.object[:, (0, 2)] / minus.object[:, (0, 2)]).T
    change[1] = (plus.object[:, 1] - minus.object[:, 1]) / root
    if plus.crosstalk is not None and minus.crosstalk is not None:
        change[3:5] = (plus.crosstalk - minus.crosstalk).T
    if (
        reference.background is not None
        and plus.background is not None
        and minus.background is not None
    ):
        root = math.sqrt(float(reference.background[0, 2]))
        change[5:8] = np.log(plus.background[:, :3] / minus.background[:, :3]).T
        change[8] = (plus.background[:, 3] - minus.background[:, 3]) / root
    return change


def whiteners(sensor: Sensor, of: Sensitivity) -> Array:
    """Return W with W^T W the inverse covariance of a frame's two readings.

    Parameters
    ----------
    sensor : Sensor
        Its noise.
    of : Sensitivity
        Mean readings, on which shot and relative noise depend.

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Lower triangular [1 / reading units].

    """
    noise: Noise = sensor.noise
    unit = noise.read[1]
    mean, signal = of.mean / unit, of.signal / unit
    own = np.empty_like(mean)
    own[:, 0], own[:, 1] = (noise.read[0] / unit) ** 2, 1.0
    shot = noise.shot / unit * np.abs(mean)
    shared = shot.min(axis=1) if sensor.kind == "pulsed" else np.zeros(len(mean))
    own1, own2 = (own + shot - shared[:, None]).T
    s1, s2 = noise.relative * signal.T
    return whitener_of(own1, own2, shared, s1, s2) / unit


def whitener_of(own1: Array, own2: Array, shared: Array, s1: Array, s2: Array) -> Array:
    """Return W with W^T W the inverse covariance of two readings, given the noise's parts.

    Parameters
    ----------
    own1, own2, shared, s1, s2 : ndarray, shape (n,)
        Those of `simulator.readings.noise_parts`.

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Lower triangular.

    Notes
    -----
    The determinant is a sum of squares, so that nothing cancels where a common relative error is
    far above the read noise.
    """
    first = own1 + shared + s1 * s1
    cross = shared + s1 * s2
    determinant = own1 * own2 + shared * (own1 + own2) + own2 * s1**2 + own1 * s2**2
    determinant = determinant + shared * (s1 - s2) ** 2
    root, area = np.sqrt(first), np.sqrt(determinant)
    whitener = np.zeros((len(root), 2, 2))
    whitener[:, 0, 0] = 1 / root
    whitener[:, 1, 0] = -cross / root / area
    whitener[:, 1, 1] = root / area
    return whitener
