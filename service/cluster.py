"""Chunks on a Dask cluster, behind the interface of the pool of one machine.

The store alone knows how far a job is: a chunk whose worker, or whose scheduler, vanished is sent
again, for as long as it takes until there is one.
"""

import asyncio
import contextlib
import importlib
import logging
import pickle
import re
import threading
import uuid
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from typing import Any, TypeVar

from service.border.authorities import is_loopback
from service.cluster_worker import COMPILING, chunk
from service.errors import WorkerDiedError
from simulator.errors import InvalidInputError

__all__ = ["POINTER", "Cluster"]

R = TypeVar("R")
POINTER = "/HYBRIDTOF_EXECUTOR"

_log = logging.getLogger("hybridtof")
_ADDRESS = re.compile(r"(tls|tcp)://(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")
_CONNECT_S = 10.0
_LONGEST_PAUSE_S = 5.0
# of Dask's workers, which a chunk cannot crash: somebody has to mean it
_DEATHS = 25


class Cluster:
    """The workers of a scheduler.

    Parameters
    ----------
    address : str
        Of the scheduler: ``tls://host:port`` with the certificates of Dask's configuration, or
        ``tcp://127.0.0.1:port``.

    Raises
    ------
    InvalidInputError
        Where the address is none, or nobody answers there.

    Notes
    -----
    A scheduler runs what is sent to it, and a service what comes back: who can reach one without
    certificates has both machines, so that tcp is for loopback alone.
    """

    def __init__(self, address: str) -> None:
        self._address = _checked(address)
        self._security = _security(address)
        self._compiling: set[str] = set()
        self._names: dict[Future[Any], str] = {}
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="cluster", daemon=True)
        self._thread.start()
        self._open = True
        self._lock = asyncio.Lock()
        try:
            self._client = self._wait(self._connect())
        except (OSError, RuntimeError) as error:
            self._end_loop()
            reason = str(error).split("\n")[0]
            message = f"there is no scheduler to be reached at {address}: {reason}"
            raise InvalidInputError.at(POINTER, message) from None

    def submit_within(self, limit_s: float, fn: Callable[..., R], /, *args: Any) -> Future[R]:
        """Hand over a pure function that workers can import, as `ProcessPool.submit_within`."""
        if not self._open:
            raise RuntimeError("the cluster is closed")
        name = uuid.uuid4().hex
        answering = self._answer(name, limit_s, pickle.dumps((fn, args)))
        future: Future[R] = asyncio.run_coroutine_threadsafe(answering, self._loop)
        self._names[future] = name
        future.add_done_callback(self._forget)
        return future

    def compiling(self, future: Future[Any]) -> bool:
        """Tell whether machine code is being made for a task."""
        return self._names.get(future) in self._compiling

    def abandon(self, future: Future[Any]) -> None:
        """Give a task up: the process that runs it is ended soon."""
        future.cancel()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks and let go of the scheduler.

        Parameters
        ----------
        wait : bool
            Whether to return only when that is done.
        cancel_futures : bool
            Give up all tasks, which otherwise come to their end first.
        """
        if not self._open:
            return
        self._open = False
        ending = threading.Thread(target=self._shutdown, args=(cancel_futures,))
        ending.start()
        if wait:
            ending.join()

    def _shutdown(self, cancel: bool) -> None:
        for future in tuple(self._names):
            if cancel:
                future.cancel()
            with contextlib.suppress(Exception, CancelledError):
                future.result()
        with contextlib.suppress(OSError, TimeoutError):
            self._wait(self._let_go())
        self._end_loop()

    async def _let_go(self) -> None:
        # in its own loop: elsewhere the client takes itself for one that blocks
        await self._client.close()

    def _end_loop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    def _wait(self, work: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    def _forget(self, future: Future[Any]) -> None:
        self._compiling.discard(self._names.pop(future, ""))

    async def _answer(self, name: str, limit_s: float, call: bytes) -> Any:
        """Have a call answered, however often the cluster loses it."""
        from distributed import KilledWorker

        deaths, pause = 0, 0.1
        while True:
            client = await self._connected()
            # not what came of an equal call before; in bytes, which are not searched for tasks
            asked = client.submit(chunk, name, limit_s, call, pure=False)
            try:
                succeeded, answer = pickle.loads(await asked)  # noqa: S301  (of our workers)
            except KilledWorker as error:
                deaths += error.allowed_failures + 1
                _log.warning("%d workers of the cluster died with a chunk", deaths)
                if deaths >= _DEATHS:
                    message = f"a part of the computation ended {deaths} workers of the cluster"
                    raise WorkerDiedError(message) from None
            except (CancelledError, OSError, TimeoutError) as error:
                _log.warning("the cluster lost a chunk, which is sent again: %s", error)
            else:
                if succeeded:
                    return answer
                raise answer
            finally:
                asked.release()  # what nobody waits for is ended
                self._compiling.discard(name)
            await asyncio.sleep(pause)
            pause = min(2 * pause, _LONGEST_PAUSE_S)

    async def _connected(self) -> Any:
        """Return a client that has a scheduler, as soon as there is one."""
        async with self._lock:
            said = False
            while self._client.status != "running":
                if not said:
                    _log.warning("the scheduler at %s is away", self._address)
                    said = True
                if self._client.status == "closed":
                    with contextlib.suppress(OSError):
                        self._client = await self._connect()
                await asyncio.sleep(0.1)
            return self._client

    async def _connect(self) -> Any:
        make: Any = importlib.import_module("distributed").Client  # it carries no types
        client = make(
            self._address,
            asynchronous=True,
            security=self._security,
            timeout=_CONNECT_S,
            set_as_default=False,
        )
        try:
            await client
        except BaseException:
            await client.close()
            raise
        client.subscribe_topic(COMPILING, self._hear)
        return client

    def _hear(self, event: tuple[float, tuple[str, bool]]) -> None:
        name, going = event[1]
        if going and name in self._names.values():
            self._compiling.add(name)
        else:
            self._compiling.discard(name)


def _checked(address: str) -> str:
    """Refuse what is no address, or one where everybody could send what is run."""
    found = _ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found[3]) < 2**16:
        message = "must be local, tls://host:port, or tcp://127.0.0.1:port of a Dask scheduler"
        raise InvalidInputError.at(POINTER, message)
    if found[1] == "tcp" and not is_loopback(found[2]):
        message = f"tcp is for loopback alone, not for {found[2]}, where it is run: use tls"
        raise InvalidInputError.at(POINTER, message)
    return address


def _security(address: str) -> Any:
    try:
        make: Any = importlib.import_module("distributed.security").Security
    except ImportError:
        message = "needs hybridtof[cluster], which is not installed"
        raise InvalidInputError.at(POINTER, message) from None
    security = make()  # as Dask's own configuration says
    lacking = [
        name
        for name, value in (
            ("DASK_DISTRIBUTED__COMM__TLS__CA_FILE", security.tls_ca_file),
            ("DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT", security.tls_client_cert),
            ("DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY", security.tls_client_key),
        )
        if not value
    ]
    if address.startswith("tls") and lacking:
        raise InvalidInputError.at(POINTER, f"tls needs {', '.join(lacking)}")
    return security
