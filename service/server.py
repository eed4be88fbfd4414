"""The server: uvicorn, with limits on what clients may leave undone.

A connection costs memory for as long as it is open, so that each has a deadline at every step: for
the head of a request, for what is left of a body that was refused (a body that is read has its own,
`service.bodies`), and for every block of an answer (`service.border.gate`).
"""

import asyncio
import logging
from typing import Any

import h11
import uvicorn
from fastapi import FastAPI
from uvicorn._types import ASGISendEvent
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from service.errors import MalformedError, ServiceError, SlowClientError
from service.problems import response_of
from service.service_settings import ServiceSettings

__all__ = ["server_of"]

_MESSAGE = 2**17

_log = logging.getLogger("hybridtof")


class _Joined:
    """A transport by which the head of an answer goes out with what follows it at once.

    Two writes would be two calls of the system and two packets: a tenth of a small request's time.
    """

    def __init__(self, transport: asyncio.Transport, conn: h11.Connection) -> None:
        self.plain, self._conn = transport, conn
        self._loop = asyncio.get_running_loop()
        self._head = b""
        self._sending: asyncio.Handle | None = None
        self.begins = True

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plain, name)

    def write(self, data: bytes) -> None:
        if self._sending is not None:
            self._sending.cancel()
            self._sending, data = None, self._head + data
        elif self.begins and self._conn.our_state is h11.SEND_BODY:
            self.begins, self._head = False, data
            # what follows may be long in coming, as of a stream of events
            self._sending = self._loop.call_soon(self.write, b"")
            return
        self.plain.write(data)

    def close(self) -> None:
        self.write(b"")
        self.plain.close()


class _Bounded(H11Protocol):
    """One connection of a client that may be slow, or greedy."""

    most = 0
    client_s = 0.0

    _joined: _Joined
    _reading: asyncio.TimerHandle | None = None
    _writing: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        self._joined = _Joined(transport, self.conn)
        super().connection_made(self._joined)  # type: ignore[arg-type]  # it has all of a transport
        if len(self.connections) > self.most:
            _log.warning("a connection was closed: there are %d", self.most)
            transport.abort()
        else:
            self._reading = self.loop.call_later(self.client_s, self._late)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.conn.their_state is not h11.IDLE:
            if self.conn.our_state is not h11.DONE:  # a body that nobody reads keeps its deadline
                self._stop_reading_clock()
        elif self._reading is None and not self.transport.is_closing():
            self._reading = self.loop.call_later(self.client_s, self._late)

    def on_response_complete(self) -> None:
        self._joined.begins = True
        super().on_response_complete()
        if self.conn.their_state is h11.SEND_BODY and self._reading is None:
            self._reading = self.loop.call_later(self.client_s, self._late)

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        self.transport = self._joined.plain
        super().handle_websocket_upgrade(event)

    def pause_writing(self) -> None:
        super().pause_writing()
        self._writing = self.loop.call_later(self.client_s, self._stuck)

    def resume_writing(self) -> None:
        super().resume_writing()
        if self._writing is not None:
            self._writing.cancel()
            self._writing = None

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop_reading_clock()
        self.resume_writing()
        super().connection_lost(exc)

    def send_400_response(self, msg: str) -> None:
        self._refuse(MalformedError(msg.lower().rstrip(".")))

    def _stop_reading_clock(self) -> None:
        if self._reading is not None:
            self._reading.cancel()
            self._reading = None

    def _late(self) -> None:
        """Close a connection on which a request does not come to its end, or none begins."""
        self._reading = None
        if self.conn.trailing_data[0]:
            self._refuse(SlowClientError("the head of the request took too long"))
        else:
            self.transport.abort()

    def _stuck(self) -> None:
        _log.warning("an answer was given up: its client does not read")
        self.transport.abort()

    def _refuse(self, error: ServiceError) -> None:
        """Answer what never became a request."""
        if self.transport.is_closing():
            return
        if self.conn.our_state not in (h11.IDLE, h11.SEND_RESPONSE):
            self.transport.abort()
            return
        response = response_of(error)
        headers = [*response.raw_headers, (b"connection", b"close")]
        for event in (
            h11.Response(status_code=response.status_code, headers=headers),
            h11.Data(data=bytes(response.body)),
            h11.EndOfMessage(),
        ):
            self.transport.write(self.conn.send(event) or b"")
        self.transport.close()


class _Sockets(WebSocketsSansIOProtocol):
    """A WebSocket, or an answer by HTTP that there is none.

    uvicorn takes the latter for a handshake that was forgotten, and logs an error.
    """

    async def send(self, message: ASGISendEvent) -> None:
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and self.close_sent:
            self.handshake_complete = True


def server_of(app: FastAPI, settings: ServiceSettings, **more: Any) -> uvicorn.Server:
    """Return a server of an application, not yet running.

    Parameters
    ----------
    settings : ServiceSettings
        With the limits.
    **more
        Of `uvicorn.Config`.
    """
    limits = {"most": settings.connections, "client_s": settings.client_s}
    config = uvicorn.Config(
        app,
        http=type("Bounded", (_Bounded,), limits),
        # requests have a line of their own
        access_log=False,
        # nothing depends on who a proxy says that a client is
        proxy_headers=False,
        # a message is a line, or a few
        ws=_Sockets,
        ws_max_size=_MESSAGE,
        ws_per_message_deflate=False,
        # an open connection must not hold up the end
        timeout_graceful_shutdown=round(settings.shutdown_s),
        **more,
    )
    return uvicorn.Server(config)
