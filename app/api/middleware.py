"""Around every request: its metrics, the headers of its answer, and how large its body may be."""

import time
from http import HTTPMethod

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.access_rules import GUIDE
from app.api.problems import http_problem
from app.services.measures import timings_of_its_own

METHODS = frozenset(HTTPMethod)
_CSP = b"content-security-policy"
_NOTHING = b"default-src 'none'; frame-ancestors 'none'"
# The pages of the guide start by an inline script, and set styles.
_GUIDE = (
    b"default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    b"font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)

MAX_DOCUMENT_BYTES = 1_000_000  # of a body without images or trajectory, which is decoded on the event loop
# What robots send with images. In JSON an upload has its trajectory inline, too: 13,000 frames, 11 minutes at 20 Hz.
WITH_IMAGES = ("/episodes", "/predict", "/poses", "/labels", "/labels/preview", "/ui/predict/prompt")


class OuterMiddleware:
    """ASGI middleware: observes every request, and adds security headers that the route has not set.

    There is no CORS: scripts of other websites read no answer. HEAD is answered as GET; the server leaves out the body.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        if scope["method"] == "HEAD":  # FastAPI's routes, unlike Starlette's, do not know it
            scope = {**scope, "method": "GET"}
        started = time.perf_counter()
        status = 500

        async def watched_send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = _completed(message["headers"], scope)
            await send(message)

        with timings_of_its_own():
            try:
                await self._app(scope, receive, watched_send)
            finally:
                _observe(scope, status, time.perf_counter() - started)


def _observe(scope: Scope, status: int, seconds: float) -> None:
    # An unknown method or path must not become a label: clients could invent any number of them.
    method = scope["method"] if scope["method"] in METHODS else "other"
    route = getattr(scope.get("route"), "path", "none")
    scope["app"].state.services.metrics.observe_request(method, route, status, seconds)


def _completed(headers: list[tuple[bytes, bytes]], scope: Scope) -> list[tuple[bytes, bytes]]:
    """Return `headers` (lower-case names, as in ASGI) with the missing security headers added."""
    present = {name for name, _ in headers}
    policy = (_CSP, _GUIDE if GUIDE in scope["path"] else _NOTHING)
    return [*headers, *(item for item in (*_HEADERS, policy) if item[0] not in present)]


class BodyLimit:
    """ASGI middleware that refuses a body with 413 as soon as it turns out too large.

    Args:
        largest: in bytes, of a body with images or a trajectory.
    """

    def __init__(self, app: ASGIApp, largest: int) -> None:
        self._app = app
        self._largest = largest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        images = scope["method"] == "POST" and scope["path"].endswith(WITH_IMAGES)
        most = self._largest if images else min(self._largest, MAX_DOCUMENT_BYTES)
        too_large = HTTPException(413, f"a request of this kind may have at most {most} bytes")
        received = 0

        async def limited_receive() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > most:
                raise too_large
            return message

        if int(dict(scope["headers"]).get(b"content-length", b"0")) > most:
            await http_problem(too_large)(scope, receive, send)
            return
        await self._app(scope, limited_receive, send)
