"""The collapsed density of an object that does not move: one range for all frames.

Taken as independent, the ranges of an object that does not move would be as uncertain as a single
frame leaves them, and the parameters would be told nothing by the frames' agreement.
"""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.frame.blocks import Data, one_block

__all__ = ["StaticDensity", "with_common_range"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class StaticDensity(CollapsedDensity):
    """log p(z | frames), the one range of all frames integrated out."""

    def blocks_of(self, frames: Array) -> Data:
        """Return frames as one block: those that may hold the object first."""
        return one_block(frames, self.present)

    @property
    def range_of_frame(self) -> NDArray[np.intp]:
        """Which of the ranges each frame has: there is one."""
        return np.zeros(len(self.frames), dtype=np.intp)

    def shared(self, values: Array) -> Array:
        """Return equal shares: the frames are not independent given the parameters."""
        n = len(self.frames)
        return np.repeat(values.sum(axis=1)[:, None] / n, n, axis=1)

    def of_frames(self, found: Array) -> Array:
        """Return the best range for each frame, and equal shares of its density."""
        u, top, sd = np.moveaxis(found, 2, 0)
        return np.stack([self.common(u), self.shared(top), self.common(sd)], axis=2)

    def common(self, values: Array) -> Array:
        """Return what the first block has in common, nan for frames without object."""
        return np.where(self.holds, values[:, :1], np.nan)


def with_common_range(density: CollapsedDensity) -> StaticDensity:
    """Return the density of the same frames with one range for all of them."""
    parts: dict[str, Any] = {
        field.name: getattr(density, field.name) for field in dataclasses.fields(CollapsedDensity)
    }
    return StaticDensity(**parts)
