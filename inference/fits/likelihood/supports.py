"""Least and largest values that a fit allows for what is unknown."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS
from inference.frame.sensitivity import Value
from simulator.scene import Quantity, Reference, Scene, Stroke
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["supports_of", "with_support_alone"]

Array = NDArray[np.float64]

_WIDEST = 1e6  # of a square length against the ranges of the scene
_FREE = (-math.inf, math.inf)


def _quantities(scene: Scene) -> dict[Value, Quantity | None]:
    """Quantities of all values; a member that the scene leaves out is None."""
    found: dict[Value, Quantity | None] = dict.fromkeys(list(Value)[:SLOTS], 0.0)
    shape = scene.object
    found |= {Value.C0: shape.c0, Value.C1: shape.c1, Value.C2: shape.c2}
    found |= zip(CROSSTALK, scene.crosstalk_values or (0.0, 0.0), strict=True)
    if scene.background is not None and scene.shadow is not None:
        found[Value.STRENGTH] = scene.background.strength
        found[Value.DISTANCE] = scene.background.distance_m
        found[Value.SHADOW_C0], found[Value.SHADOW_C1] = scene.shadow
    return found


def supports_of(
    sensor: Sensor, scene: Scene, support: tuple[float, float], light: tuple[float, float]
) -> tuple[Array, Array]:
    """Return least and largest physical values: support of the prior, and what ranges can tell.

    Parameters
    ----------
    support : (float, float)
        Ranges that the scene allows [m].
    light : (float, float)
        The loudest reading at the largest gain factor of the frames, and the loudest one of each
        frame's reading over its own: object and background are readings at gain factor 1.

    Returns
    -------
    (ndarray, ndarray), each of shape (SLOTS,)
        In the order of `Value`, reading units.
    """
    near, far = support
    wide = (near * near / _WIDEST, far * far * _WIDEST)
    dim, bright = light
    farthest = sensor.r0 if isinstance(sensor, PulsedSensor) else math.inf
    box = {
        Value.C0: wide,
        Value.C2: (
            dim / sensor.known_gain * near * near * 1e-12,
            bright / sensor.known_gain * far**4 / wide[0] * 1e6,
        ),
        Value.STRENGTH: (dim * 1e-9, bright * 1e3),
        Value.DISTANCE: (near * 1e-3, farthest),
        Value.SHADOW_C0: wide,
    }
    low, high = np.empty(SLOTS), np.empty(SLOTS)
    quantities = _quantities(scene)
    for k, quantity in quantities.items():
        a, b = box.get(k, _FREE)
        if quantity is not None and not isinstance(quantity, float | int):
            law = quantity.distribution()
            a, b = max(a, law.low), min(b, law.high)
            if not a < b:  # the scene allows only what the box leaves out
                a, b = law.low, law.high
        elif k == Value.SHADOW_C1:
            a = 0.0  # its default prior, where nothing is stated
        low[k], high[k] = a, b
    if not isinstance(sensor, PulsedSensor):
        # beyond a wrap the background looks the same
        wrap = max(low[Value.DISTANCE], 0.0) + sensor.max_range_m
        high[Value.DISTANCE] = min(high[Value.DISTANCE], wrap)
    for c0, c1 in ((Value.C0, Value.C1), (Value.SHADOW_C0, Value.SHADOW_C1)):
        stated = quantities[c1]
        if isinstance(stated, float | int) and stated < 0.0:
            low[c0] = max(low[c0], 0.25 * stated * stated * (1 + 1e-9))
    return low, high


def with_support_alone(scene: Scene) -> Scene:
    """Return the scene with the support of its ranges alone: no fit has a law of them to learn."""
    law = scene.range_m
    if not isinstance(law, Stroke):
        return scene
    support = Reference(prior="reference", low=law.low, high=law.high)
    return scene.model_copy(update={"range_m": support})
