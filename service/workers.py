"""What runs chunks: the processes of this machine, or a cluster."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol, TypeVar

__all__ = ["Workers"]

R = TypeVar("R")


class Workers(Protocol):
    """Where chunks run."""

    def submit_within(self, limit_s: float, fn: Callable[..., R], /, *args: Any) -> Future[R]:
        """Run a function within some processor time [s]."""
        ...

    def compiling(self, future: Future[Any]) -> bool:
        """Tell whether machine code is being made for a task."""
        ...

    def abandon(self, future: Future[Any]) -> None:
        """Give a task up."""
        ...

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End."""
        ...
