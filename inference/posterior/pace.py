"""How long a posterior will go on, as far as its own pace tells."""

import dataclasses

from inference.posterior.progress import Progress

__all__ = ["Pace"]


@dataclasses.dataclass(frozen=True)
class Pace:
    """From where on steps were made as they are made now.

    Attributes
    ----------
    steps : int
        Steps of each ensemble then.
    seconds : float
        When that was, by the clock of who runs the job.
    """

    steps: int
    seconds: float

    @classmethod
    def followed(cls, before: "Pace | None", progress: Progress, seconds: float) -> "Pace":
        """Return the pace after a chunk.

        Parameters
        ----------
        before : Pace or None
            That after the chunk before; None where this process saw none.
        progress : Progress
            How far the job is.
        seconds : float
            When, by a clock that goes on.
        """
        if before is None or progress.phase != "sampling" or progress.steps < before.steps:
            return cls(progress.steps, seconds)
        return before

    def foretell(self, progress: Progress, seconds: float) -> Progress:
        """Return the progress with the time that the steps up to its target will take."""
        made = progress.steps - self.steps
        if progress.phase != "sampling" or progress.target is None or made <= 0:
            return progress
        left = (progress.target - progress.steps) * (seconds - self.seconds) / made
        return dataclasses.replace(progress, eta_s=left)
