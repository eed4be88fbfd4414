"""What the techniques need, are immune to and cost, as clients see it."""

import dataclasses

import pydantic

from inference.technique import Technique
from inference.techniques import ALL_TECHNIQUES
from service.answers.shape import Shape, model_of

__all__ = ["TechniquesResponse", "all_techniques"]


@dataclasses.dataclass(frozen=True)
class _Techniques:
    """Answer of ``GET /v1/techniques``."""

    techniques: tuple[Technique, ...]


# what solves and what refuses is code
_SHAPES: dict[type, Shape] = {
    Technique: Shape(without=frozenset({"solve", "obstacle", "farthest_m", "same_as"}))
}

TechniquesResponse: type[pydantic.BaseModel] = model_of(_Techniques, _SHAPES)


def all_techniques() -> pydantic.BaseModel:
    """Return every technique, as `TechniquesResponse`."""
    listed = _Techniques(tuple(ALL_TECHNIQUES.values()))
    return TechniquesResponse.model_validate(listed, from_attributes=True)
