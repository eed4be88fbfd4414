"""A quantity of the scene language: a number is known, a prior is unknown."""

from typing import Annotated

import pydantic

from simulator.priors import Prior
from simulator.validated import Number, Positive, Validated

__all__ = ["PositiveQuantity", "Quantity"]


def _kind_of_quantity(value: object) -> str:
    # anything that is not an object is read as a number, so that the message speaks of numbers
    return "unknown" if isinstance(value, dict | Validated) else "known"


Quantity = Annotated[
    Annotated[Number, pydantic.Tag("known")] | Annotated[Prior, pydantic.Tag("unknown")],
    pydantic.Discriminator(_kind_of_quantity),
]
PositiveQuantity = Annotated[
    Annotated[Positive, pydantic.Tag("known")] | Annotated[Prior, pydantic.Tag("unknown")],
    pydantic.Discriminator(_kind_of_quantity),
]
