"""What came of many frames: wrong counts, folds decided by rounding, the worst root."""

import dataclasses
from typing import Generic, TypeVar

__all__ = ["Tally"]

Scene = TypeVar("Scene")


@dataclasses.dataclass
class Tally(Generic[Scene]):
    """A count of frames, of their roots, and of what is wrong with them.

    Attributes
    ----------
    excused : int
        Frames whose count changes when the readings change by a few units of rounding.
    wrong : list
        Scene, readings, count that came back and count that is proved.
    worst : float
        Error of a root in units of its condition times rounding.
    where : tuple
        Its scene, readings and root.
    """

    frames: int = 0
    roots: int = 0
    excused: int = 0
    wrong: list[tuple[Scene, tuple[float, float], int, int]] = dataclasses.field(
        default_factory=list
    )
    worst: float = 0.0
    where: tuple[Scene, tuple[float, float], float] | None = None
