"""No request larger than the operator allows, whether it tells its length or not."""

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.access_rules import LOGIN, LOGOUT
from app.api.problems import Kind, problem

MAX_LOGIN_BYTES = 10_000


class _TooLargeError(Exception):
    pass


class BodyLimit:
    """ASGI middleware that answers 413 as soon as a body turns out larger than `max_bytes`."""

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        # Anybody may log in: nobody needs a large body for that.
        max_bytes = MAX_LOGIN_BYTES if scope["path"].endswith((LOGIN, LOGOUT)) else self._max_bytes
        headers = dict(scope["headers"])
        declared = headers.get(b"content-length", b"0")
        received = 0
        started = False

        async def limited_receive() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > max_bytes:
                raise _TooLargeError
            return message

        async def watched_send(message: Message) -> None:
            nonlocal started
            started = True
            await send(message)

        try:
            if int(declared) > max_bytes:
                raise _TooLargeError
            await self._app(scope, limited_receive, watched_send)
        except _TooLargeError:
            if started:
                raise
            kind = Kind(413, "too-large", "The request is too large")
            await problem(kind, f"a request may have at most {max_bytes} bytes")(scope, receive, send)
