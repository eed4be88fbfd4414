"""Where requests are worked on, each at a bounded cost.

Threads take what is small, processes what may take long. A queue that is full says so at once, and
what nobody waits for any more is given up.
"""

import asyncio
from collections.abc import Awaitable, Callable, Generator
from concurrent.futures import Future
from typing import Any, TypeVar

import anyio
import anyio.to_thread
from fastapi import Request

from service.errors import BusyError, ClientGoneError
from service.process_pool import ProcessPool
from simulator.compiled import while_compiling

__all__ = ["Processes", "Threads", "while_wanted"]

R = TypeVar("R")


async def _gone(request: Request) -> None:
    while (await request.receive())["type"] != "http.disconnect":
        pass


async def while_wanted(request: Request, work: Awaitable[R]) -> R:
    """Await some work for as long as its client waits for it.

    Parameters
    ----------
    request : Request
        Whose body was read to its end.
    work : awaitable
        Is cancelled when the client hangs up.

    Raises
    ------
    ClientGoneError
        When it does.
    """
    working = asyncio.ensure_future(work)
    leaving = asyncio.ensure_future(_gone(request))
    try:
        await asyncio.wait((working, leaving), return_when=asyncio.FIRST_COMPLETED)
        if not working.done():
            raise ClientGoneError("the client hung up")
        return working.result()
    finally:
        for task in (working, leaving):
            task.cancel()
        await asyncio.gather(working, leaving, return_exceptions=True)


def _at_once(function: Callable[..., R], *arguments: Any) -> R:
    """Run what is small: nobody waits for a compiler."""
    with while_compiling():
        return function(*arguments)


class Threads:
    """Some threads, and a queue before them that has an end.

    Parameters
    ----------
    threads, waiting : int
        How many work, and how many may wait.
    """

    def __init__(self, threads: int, waiting: int) -> None:
        self._limiter = anyio.CapacityLimiter(threads)
        self._waiting = waiting

    async def run(self, request: Request, function: Callable[..., R], *arguments: Any) -> R:
        """Run a function.

        Raises
        ------
        BusyError
            Where too many wait.
        ClientGoneError
            Where the client hung up before its turn; what has begun is ended.
        """
        limiter = self._limiter
        if limiter.available_tokens <= 0:
            if limiter.statistics().tasks_waiting >= self._waiting:
                raise BusyError("too many requests wait for their turn")
            work = anyio.to_thread.run_sync(_at_once, function, *arguments, limiter=limiter)
            return await while_wanted(request, work)
        return await anyio.to_thread.run_sync(_at_once, function, *arguments, limiter=limiter)


class Processes:
    """Processes in which a task that takes too long is ended, and a queue that has an end.

    Parameters
    ----------
    processes, waiting : int
        How many work, and how many tasks may wait.
    limit_s : float
        Processor time of a task [s], without that of compiling.
    """

    def __init__(self, processes: int, waiting: int, limit_s: float) -> None:
        self._pool = ProcessPool(processes)
        self._most = processes + waiting
        self._limit_s = limit_s
        self._count = 0

    async def run(self, request: Request, function: Callable[..., R], *arguments: Any) -> R:
        """Run a pure function that can be imported by its name.

        Raises
        ------
        BusyError
            Where too many wait.
        OverdueError
            Where it takes too long.
        ClientGoneError
            Where the client hung up; the process is ended then.
        """
        self._check_room()
        return await self._result(
            request, self._pool.submit_once(self._limit_s, function, *arguments)
        )

    async def run_in_parts(
        self, request: Request, function: Callable[..., Generator[R, None, R]], *arguments: Any
    ) -> list[R]:
        """Run a generator that can be imported by its name; what it returns is the last part.

        Raises
        ------
        BusyError, ClientGoneError
            As of `run`.
        OverdueError
            As of `run`, with the parts that were told in time.
        """
        self._check_room()
        return await self._result(
            request, self._pool.submit_in_parts(self._limit_s, function, *arguments)
        )

    def _check_room(self) -> None:
        if self._count >= self._most:
            raise BusyError("too many requests wait for their turn")

    async def _result(self, request: Request, future: Future[R]) -> R:
        """Await a task that was handed over, for as long as its client waits for it."""
        self._count += 1
        try:
            return await while_wanted(request, asyncio.wrap_future(future))
        finally:
            self._count -= 1
            if not future.done() or future.cancelled():
                self._pool.abandon(future)

    def close(self) -> None:
        """End the processes, and what they work on."""
        self._pool.shutdown(cancel_futures=True)
