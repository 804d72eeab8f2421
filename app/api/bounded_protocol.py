"""uvicorn's fast HTTP protocol, with bounds on what a connection may cost, of which it has none.

100 MB of headers would stay in memory before a line of ours runs; connections that never finish a request, or never
read their answer, would stay open for good; and could use up all file descriptors.
"""

import asyncio

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

MAX_HEAD_BYTES = 65_536  # what uvicorn's slower protocol (h11) allows
HEAD_TIMEOUT_S = 10.0
# A body must have come after this and a second more for every so many bytes of it: 200 MB after 67 minutes.
BODY_TIMEOUT_S = 20.0
SLOWEST_BYTES_PER_S = 50_000
READER_TIMEOUT_S = 60.0  # for an answer's next piece, or its last
# Connections that are open although they are too many: they are answered so, by uvicorn's limit_concurrency.
REFUSED_CONNECTIONS = 100


class BoundedProtocol(HttpToolsProtocol):
    """Closes a connection whose request has too long a head or takes too long, or whose client reads no answer."""

    head_timeout_s = HEAD_TIMEOUT_S
    body_timeout_s = BODY_TIMEOUT_S
    reader_timeout_s = READER_TIMEOUT_S
    _in_head = False
    _head_bytes = 0
    _body_bytes = 0
    _body_since_s = 0.0
    _deadline: asyncio.TimerHandle | None = None
    _reader_deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A first request must come, if there is room."""
        super().connection_made(transport)
        if self.limit_concurrency is not None and len(self.connections) > self.limit_concurrency + REFUSED_CONNECTIONS:
            transport.abort()
            return
        self._deadline = self.loop.call_later(self.head_timeout_s, transport.abort)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nothing is waited for."""
        self._wait_no_longer()
        self._reader_is_awake()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Count what comes before the head is complete."""
        super().data_received(data)
        if self._in_head:
            self._head_bytes += len(data)
            if self._head_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
                self._in_head = False
                self.send_400_response(f"The request's headers are longer than {MAX_HEAD_BYTES} bytes.")
        if self._deadline is None and self.cycle is not None and self.cycle.response_complete:
            # uvicorn waits no longer as soon as anything comes, be it a line break before a request that never begins
            self._deadline = self.loop.call_later(self.head_timeout_s, self.transport.abort)

    def on_message_begin(self) -> None:
        """A head begins."""
        self._wait_no_longer()
        self._deadline = self.loop.call_later(self.head_timeout_s, self.transport.abort)
        self._in_head, self._head_bytes = True, 0
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        """The head is complete, and a body may begin."""
        self._wait_no_longer()
        self._in_head, self._body_bytes, self._body_since_s = False, 0, self.loop.time()
        self._deadline = self.loop.call_later(self.body_timeout_s, self._check_body)
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """A piece of the body."""
        self._body_bytes += len(body)
        super().on_body(body)

    def on_message_complete(self) -> None:
        """The body is complete."""
        self._wait_no_longer()
        super().on_message_complete()

    def pause_writing(self) -> None:
        """The client does not read as fast as the answer is written."""
        self._reader_is_awake()
        self._reader_deadline = self.loop.call_later(self.reader_timeout_s, self.transport.abort)
        super().pause_writing()

    def resume_writing(self) -> None:
        """The client has read on."""
        self._reader_is_awake()
        super().resume_writing()

    def timeout_keep_alive_handler(self) -> None:
        """Nothing more came: what is left of the answer must be read."""
        if not self.transport.is_closing():
            self._reader_is_awake()
            self._reader_deadline = self.loop.call_later(self.reader_timeout_s, self.transport.abort)
        super().timeout_keep_alive_handler()

    def _check_body(self) -> None:
        """Close the connection, unless the body comes fast enough to be worth waiting for."""
        allowed_s = self.body_timeout_s + self._body_bytes / SLOWEST_BYTES_PER_S
        left_s = self._body_since_s + allowed_s - self.loop.time()
        if left_s <= 0:
            self.transport.abort()
        else:
            self._deadline = self.loop.call_later(left_s, self._check_body)

    def _wait_no_longer(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _reader_is_awake(self) -> None:
        if self._reader_deadline is not None:
            self._reader_deadline.cancel()
            self._reader_deadline = None
