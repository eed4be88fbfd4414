"""Frames in blocks: those of a block have one range in common.

The frames of an object that moves are blocks of one; all frames of an object at rest are one block.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled, when_compiling

__all__ = [
    "FIRST",
    "GAIN",
    "SECOND",
    "Block",
    "Data",
    "Frame",
    "Known",
    "block_of",
    "frame_count",
    "frame_of",
    "is_empty",
    "known_of",
    "one_block",
    "own_blocks",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

# columns of frames; the last four only where something is known of ranges
FIRST, SECOND, GAIN = 0, 1, 2
RANGE, RATE, DISPLACEMENT, DISPLACEMENT_RATE = 3, 4, 5, 6
# above the sensor's reference [K], where it follows its temperature; kernels do not see it
WARM = 7
_PLAIN = 3  # columns of frames of whose ranges nothing is known


class Known(NamedTuple):
    """What is known of a frame's range beside its readings.

    Attributes
    ----------
    range_m : float
        The range [m].
    rate : float
        One over its standard deviation [1/m]; 0 where it is not known.
    displacement_m, displacement_rate : float
        The same of the range less an offset that all frames share.
    """

    range_m: float
    rate: float
    displacement_m: float
    displacement_rate: float


class Told(NamedTuple):
    """Marks frames that have columns of what is known of their ranges."""

    ranges: bool


class Frame(NamedTuple):
    """Two readings [reading units], the factor on the sensor's gain, what is known of the range."""

    first: float
    second: float
    gain: float
    known: Known | None = None


class Block(NamedTuple):
    """Frames that have one range in common.

    Attributes
    ----------
    one : Frame or None
        The frame of a block of one: numbers that need no memory.
    many : ndarray, shape (frames, 3 or 7), or None
        The frames of any other block.
    told : Told or None
        Not None where those have what is known of their ranges.
    """

    one: Frame | None
    many: Array | None
    told: Told | None = None


class Data(NamedTuple):
    """The frames that a kernel runs over.

    Attributes
    ----------
    frames : ndarray, shape (n, 3 or 7)
        As `Frame`.
    present : ndarray of bool, shape (n,)
        False where it is known that no object is there, the same within a block.
    starts : ndarray of int, shape (blocks + 1,), or None
        First frame of each block, and last the number of frames; None where every frame is a block.
    strongest : float
        Largest gain factor of frames that may hold an object.
    told : Told or None
        Not None where something is known of ranges.
    """

    frames: Array
    present: Flags
    starts: NDArray[np.int64] | None
    strongest: float
    told: Told | None

    @property
    def blocks(self) -> int:
        """Number of blocks; for Python, not for kernels."""
        return len(self.frames) if self.starts is None else len(self.starts) - 1


def _flags(frames: Array, present: Flags | None) -> Flags:
    # an array in any case: kernels are compiled once, for frames with and without such flags
    return np.ones(len(frames), dtype=bool) if present is None else present


def own_blocks(frames: Array, present: Flags | None) -> Data:
    """Return every frame as a block of its own."""
    strongest = float(frames[:, GAIN].max())
    return Data(frames, _flags(frames, present), None, strongest, _told(frames))


def _told(frames: Array) -> Told | None:
    return Told(True) if frames.shape[1] > _PLAIN else None


def one_block(frames: Array, present: Flags | None) -> Data:
    """Return all frames that may hold an object as one block, and behind it each of the others."""
    flags = _flags(frames, present)
    seen = frames[flags]
    count = max(len(seen), 1)
    starts = np.concatenate([[0], np.arange(count, len(frames) + 1)])
    order = np.argsort(~flags, kind="stable")
    strongest = float((seen if len(seen) else frames)[:, GAIN].max())
    return Data(frames[order], flags[order], starts, strongest, _told(frames))


@compiled
def frame_count(block: Block) -> int:
    """Return the number of frames of a block."""
    return _count(block.many)


@compiled
def _count(many: Array | None) -> int:
    if many is not None:
        return int(many.shape[0])
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return 1


@compiled
def frame_of(block: Block, j: int) -> Frame:
    """Return frame j of a block."""
    return _frame(block.one, block.many, block.told, j)


@compiled
def _frame(one: Frame | None, many: Array | None, told: Told | None, j: int) -> Frame:
    if many is not None:
        return Frame(many[j, FIRST], many[j, SECOND], many[j, GAIN], known_of(many, told, j))
    else:  # noqa: RET505
        return one  # type: ignore[return-value]


@compiled
def block_of(data: Data, b: int) -> Block:
    """Return block b."""
    return _block(data.frames, data.starts, data.told, b)


def known_of(frames: Array, told: Told | None, j: int) -> Known | None:
    """Return what is known of the range of frame j."""
    return None if told is None else Known(*frames[j, RANGE:].tolist())


def _block(frames: Array, starts: NDArray[np.int64] | None, told: Told | None, b: int) -> Block:
    if starts is None:
        first, second, gain = frames[b, :RANGE].tolist()
        return Block(Frame(first, second, gain, known_of(frames, told, b)), None, None)
    return Block(None, frames[starts[b] : starts[b + 1]], told)


@when_compiling
def _overload_block() -> None:
    from simulator.machine_code import is_none, overload

    # the type of what is returned depends on that of an argument
    @overload(known_of)
    def _known(frames: Any, told: Any, j: Any) -> Callable[..., Any]:  # noqa: ARG001
        if is_none(told):
            return lambda frames, told, j: None  # noqa: ARG005
        return lambda frames, told, j: Known(  # noqa: ARG005
            frames[j, RANGE],
            frames[j, RATE],
            frames[j, DISPLACEMENT],
            frames[j, DISPLACEMENT_RATE],
        )

    @overload(_block)
    def _(frames: Any, starts: Any, told: Any, b: Any) -> Callable[..., Any]:  # noqa: ARG001
        if is_none(starts):
            return lambda frames, starts, told, b: Block(  # noqa: ARG005
                Frame(
                    frames[b, FIRST], frames[b, SECOND], frames[b, GAIN], known_of(frames, told, b)
                ),
                None,
                None,
            )
        return lambda frames, starts, told, b: Block(None, frames[starts[b] : starts[b + 1]], told)


@compiled
def is_empty(data: Data, b: int) -> bool:
    """Tell whether block b is known to hold no object."""
    return not data.present[_start(data.starts, b)]


@compiled
def _start(starts: NDArray[np.int64] | None, b: int) -> int:
    if starts is not None:
        return int(starts[b])
    else:  # noqa: RET505
        return b
