"""uvicorn's fast HTTP protocol, with bounds on a request's head, which it reads without any.

100 MB of headers would stay in memory before a line of ours runs, and connections that never finish a head would stay
open for good.
"""

import asyncio

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

MAX_HEAD_BYTES = 65_536  # what uvicorn's slower protocol (h11) allows
HEAD_TIMEOUT_S = 10.0


class BoundedHeadProtocol(HttpToolsProtocol):
    """Closes connections whose request line and headers are too long, or take too long."""

    _in_head = False
    _head_bytes = 0
    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A first request must come."""
        super().connection_made(transport)
        self._deadline = self.loop.call_later(HEAD_TIMEOUT_S, transport.close)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nothing is waited for."""
        self._wait_no_longer()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Count what comes before the head is complete."""
        super().data_received(data)
        if self._in_head:
            self._head_bytes += len(data)
            if self._head_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
                self._in_head = False
                self.send_400_response(f"The request's headers are longer than {MAX_HEAD_BYTES} bytes.")

    def on_message_begin(self) -> None:
        """A head begins."""
        self._wait_no_longer()
        self._deadline = self.loop.call_later(HEAD_TIMEOUT_S, self.transport.close)
        self._in_head, self._head_bytes = True, 0
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        """The head is complete."""
        self._wait_no_longer()
        self._in_head = False
        super().on_headers_complete()

    def _wait_no_longer(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
