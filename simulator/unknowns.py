"""The unknowns that the terms of a scene have: with default priors, or with stated ones."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from simulator.priors import Distribution, HalfNormal, LogNormal
from simulator.scene import Quantity
from simulator.scene_checks import largest

__all__ = ["Unknown", "Values", "add_quantity", "add_reflectance", "add_shape"]

Array = NDArray[np.float64]
Values = dict[str, Array]

_DEFAULT_C0 = LogNormal(median=0.1, sigma=2.0).distribution()
_DEFAULT_C2 = LogNormal(median=0.1, sigma=1.0)
_DEFAULT_C1_SD = 0.4
_DEFAULT_SHADOW_C0 = LogNormal(median=0.75, sigma=0.5).distribution()
_DEFAULT_SHADOW_C1 = HalfNormal(sd=0.3).distribution()


@dataclasses.dataclass(frozen=True)
class Unknown:
    """One unknown.

    Attributes
    ----------
    name : str
        Its path in the scene, for example "object.c0".
    from_normal : callable
        (z, values so far) -> value; z standard normal, each of shape (n,).
    log_correction : callable, optional
        (values so far) -> log of the prior mass that a joint truncation leaves, shape (n,).
    to_normal : callable
        (value, values so far) -> z.
    law : Distribution, optional
        Its prior, where that is one law whatever the other unknowns are.
    deviation : callable, optional
        (value, values so far) -> `Distribution.deviation`; left out, it is |z|.
    """

    name: str
    from_normal: Callable[[Array, Values], Array]
    to_normal: Callable[[Array, Values], Array]
    log_correction: Callable[[Values], Array] | None = None
    law: Distribution | None = None
    deviation: Callable[[Array, Values], Array] | None = None


def add_quantity(
    name: str,
    quantity: Quantity,
    low: float,
    high: float,
    known: dict[str, float],
    unknowns: list[Unknown],
) -> None:
    """File a quantity under what is known, or make an unknown with its prior cut to a support."""
    if isinstance(quantity, float | int):
        known[name] = float(quantity)
        return
    law = quantity.distribution().truncated(low, high)
    unknowns.append(
        Unknown(
            name,
            lambda z, _: law.from_normal(z),
            lambda x, _: law.to_normal(x),
            law=law,
            deviation=lambda x, _: law.deviation(x),
        )
    )


def add_shape(
    path: str,
    c0: Quantity | None,
    c1: Quantity | None,
    known: dict[str, float],
    unknowns: list[Unknown],
) -> None:
    """Add c0 and c1 of the object or the shadow, jointly truncated to c1 > -2 sqrt(c0)."""
    name0, name1 = f"{path}.c0", f"{path}.c1"
    is_object = path == "object"
    # where no c1 can be above a negative bound, no smaller c0 has prior mass
    greatest = largest(c1)
    least = (greatest / 2) ** 2 if greatest < 0 else 0.0
    if c0 is None:
        law = _DEFAULT_C0 if is_object else _DEFAULT_SHADOW_C0

        def scale(values: Values) -> Array | float:
            return 1.0 if is_object else values["object.c0"]

        def cut(values: Values) -> Array | float:
            return 0.0 if least == 0.0 else least / scale(values)

        unknowns.append(
            Unknown(
                name0,
                lambda z, v: scale(v) * law.from_normal(z, cut(v)),
                lambda x, v: law.to_normal(x / scale(v), cut(v)),
                None if least == 0.0 else (lambda v: law.log_mass(least / scale(v))),
                deviation=lambda x, v: law.deviation(x / scale(v), cut(v)),
            )
        )
    else:
        add_quantity(name0, c0, least, math.inf, known, unknowns)
    if c1 is None and is_object:
        unknowns.append(
            Unknown(
                name1,
                lambda z, v: 2 * np.sqrt(v[name0]) * np.expm1(_DEFAULT_C1_SD * z),
                lambda x, v: np.log1p(x / (2 * np.sqrt(v[name0]))) / _DEFAULT_C1_SD,
            )
        )
    elif c1 is None:
        unknowns.append(
            Unknown(
                name1,
                lambda z, v: np.sqrt(v["object.c0"]) * _DEFAULT_SHADOW_C1.from_normal(z),
                lambda x, v: _DEFAULT_SHADOW_C1.to_normal(x / np.sqrt(v["object.c0"])),
                deviation=lambda x, v: _DEFAULT_SHADOW_C1.deviation(x / np.sqrt(v["object.c0"])),
            )
        )
    elif isinstance(c1, float | int):
        known[name1] = float(c1)
    else:
        law1 = c1.distribution()

        def bound(values: Values) -> Array:
            return -2 * np.sqrt(values[name0])

        always_inside = law1.low >= 0.0
        unknowns.append(
            Unknown(
                name1,
                lambda z, v: law1.from_normal(z, bound(v)),
                lambda x, v: law1.to_normal(x, bound(v)),
                None if always_inside else (lambda v: law1.log_mass(bound(v))),
                deviation=lambda x, v: law1.deviation(x, bound(v)),
            )
        )


def add_reflectance(c2: Quantity | None, known: dict[str, float], unknowns: list[Unknown]) -> None:
    """Add the object's c2."""
    add_quantity("object.c2", _DEFAULT_C2 if c2 is None else c2, 0.0, math.inf, known, unknowns)
