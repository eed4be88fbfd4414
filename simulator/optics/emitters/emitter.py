"""A light source: a pattern, where it stands, where it points, and its power."""

from typing import Annotated

import pydantic

from simulator.optics.emitters.intensity import Pattern
from simulator.optics.emitters.uniform import Uniform
from simulator.optics.vectors import Position, Unit
from simulator.validated import Validated

__all__ = ["Emitter"]


class Emitter(Validated):
    """A light source.

    Attributes
    ----------
    pattern : Pattern
        Radiant intensity against the angle from the aim.
    position_m : (float, float, float)
        [m].
    aim : (float, float, float)
        Direction of the axis; normalised on the way in.
    power_w : float
        Phi0 [W].
    size_m : (float, float), optional
        Width and height of an extended source, whose points all radiate the pattern (2.17). Left
        out: a point.
    """

    pattern: Pattern = Uniform()
    position_m: Position = (0.0, 0.0, 0.0)
    aim: Unit = (0.0, 0.0, 1.0)
    power_w: Annotated[float, pydantic.Field(gt=0)] = 1.0
    size_m: (
        Annotated[
            tuple[Annotated[float, pydantic.Field(gt=0)], Annotated[float, pydantic.Field(gt=0)]],
            pydantic.Strict(False),
        ]
        | None
    ) = None
