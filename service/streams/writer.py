"""Changes of many streams, written together: the disk is waited for once, not once for each."""

import asyncio

from service.store.stream_record import StreamChange
from service.store.stream_store import StreamStore

__all__ = ["Writer"]

_TOGETHER = 32


class Writer:
    """Writes what came while it wrote."""

    def __init__(self, store: StreamStore) -> None:
        self._store = store
        self._waiting: list[tuple[StreamChange, asyncio.Future[bool]]] = []
        self._task: asyncio.Task[None] | None = None

    async def write(self, change: StreamChange) -> bool:
        """Write a change; it is durable when this returns true.

        Returns
        -------
        bool
            False where the stream stands elsewhere by now.

        Raises
        ------
        StoreError
            Where the store does not take it.
        """
        future: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
        self._waiting.append((change, future))
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._work())
        return await future

    async def _work(self) -> None:
        while self._waiting:
            together, self._waiting = self._waiting[:_TOGETHER], self._waiting[_TOGETHER:]
            try:
                done = await asyncio.to_thread(self._store.apply, [c for c, _ in together])
            except Exception as error:
                for _, future in together:
                    if not future.done():
                        future.set_exception(error)
            else:
                for (_, future), one in zip(together, done, strict=True):
                    if not future.done():
                        future.set_result(one)
