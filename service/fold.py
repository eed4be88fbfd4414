"""What the service asks of a computation that is a fold over chunks."""

from collections.abc import Sequence
from typing import Any, Protocol, Self, TypeVar

from inference.posterior import job as posterior_job
from inference.posterior.answer.draws import Draws
from inference.posterior.progress import Progress
from inference.posterior.settings import SamplerSettings
from simulator.frames import Frames
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Fold", "Stored", "StoredCheckpoint", "StoredJob", "Summary"]


class Stored(Protocol):
    """What a store keeps as bytes."""

    def to_bytes(self) -> bytes:
        """Return it as bytes."""
        ...


class StoredJob(Stored, Protocol):
    """A prepared job."""

    @property
    def settings(self) -> SamplerSettings:
        """How it is sampled, with a seed."""
        ...


class StoredCheckpoint(Stored, Protocol):
    """Where a job stands."""

    @property
    def method(self) -> str:
        """What is being done."""
        ...

    def addition(self, before: Self, /) -> bytes | None:
        """Return what a store that holds an earlier one needs besides; None: all of it."""
        ...


class Summary(Protocol):
    """An answer."""

    def to_json(self) -> dict[str, Any]:
        """Return it as plain JSON data."""
        ...


J = TypeVar("J", bound=StoredJob)
C = TypeVar("C", bound=StoredCheckpoint)
T = TypeVar("T")
P = TypeVar("P")
S = TypeVar("S", covariant=True)


class Reader(Protocol[S]):
    """A class whose instances can be read again from bytes."""

    def from_bytes(self, data: bytes, /) -> S:
        """Read what ``to_bytes`` wrote."""
        ...


class PieceReader(Protocol[S]):
    """A class whose instances can be read again from pieces."""

    def from_bytes(self, *pieces: bytes) -> S:
        """Read what ``to_bytes`` wrote, and what ``addition`` wrote after it."""
        ...


class Fold(Protocol[J, C, T, P]):
    """What `inference.posterior.fold` offers; every function is pure and importable by name.

    Its types are a job, a checkpoint, a task (one share of a chunk) and what becomes of it.
    """

    @property
    def FORMAT(self) -> str:  # noqa: N802  (a constant)
        """Names the form of stored jobs and checkpoints."""
        ...

    @property
    def Job(self) -> Reader[J]:  # noqa: N802  (a class)
        """The job's class."""
        ...

    @property
    def Checkpoint(self) -> PieceReader[C]:  # noqa: N802
        """The checkpoint's class."""
        ...

    def prepare(
        self, sensor: Sensor, scene: Scene, frames: Frames, settings: SamplerSettings, /
    ) -> J:
        """Validate and refuse; resolve the seed."""
        ...

    def start(self, job: J, /) -> C:
        """Return the first checkpoint."""
        ...

    def tasks(self, job: J, checkpoint: C, cpu_s: float, /) -> Sequence[T]:
        """Return the independent pieces of the next chunk; none when finished or out of time."""
        ...

    def run(self, task: T, /) -> P:
        """Compute one piece."""
        ...

    def merge(self, job: J, checkpoint: C, pieces: Sequence[P], /) -> C:
        """Return the next checkpoint."""
        ...

    def progress(self, job: J, checkpoint: C, /) -> Progress:
        """Return steps, target, ess, rhat, finished."""
        ...

    def summarise(self, job: J, checkpoint: C, wall_s: float, cpu_s: float, /) -> Summary:
        """Return the posterior so far; ``cpu_s`` as it was given to ``tasks``."""
        ...

    def draw(self, job: J, checkpoint: C, /) -> tuple[posterior_job.Job, Draws]:
        """Return the job as it was sampled and its draws."""
        ...
