"""Around every request: its id, its line in the log, its metrics, and the headers of its answer for browsers."""

import logging
import re
import time
from http import HTTPMethod
from uuid import uuid4

from fastapi import FastAPI
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.access_rules import GUIDE
from app.services.measures import request_fields

logger = logging.getLogger(__name__)
REQUEST_ID = b"x-request-id"
_PLAIN_ID = re.compile(rb"[\w.-]{1,64}")
METHODS = frozenset(HTTPMethod)
_CSP = b"content-security-policy"
_NOTHING = b"default-src 'none'; frame-ancestors 'none'"
# The pages of Swagger UI and of the guide start by an inline script, and set styles.
_DOCUMENTATION = (
    b"default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    b"font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


class OuterMiddleware:
    """ASGI middleware: observes every request, and adds security headers that the route has not set.

    A request keeps the `X-Request-ID` that it came with, or gets one; the answer carries it. There is no CORS: scripts
    of other websites read no answer.

    Args:
        owner: whose `state.services` has the metrics.
    """

    def __init__(self, app: ASGIApp, owner: FastAPI) -> None:
        self._app = app
        self._owner = owner

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request_id = _request_id(scope)
        started = time.perf_counter()
        status = 500

        async def watched_send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*_completed(message["headers"], scope), (REQUEST_ID, request_id.encode())]
            await send(message)

        with request_fields(request_id):
            try:
                await self._app(scope, receive, watched_send)
            finally:
                self._observe(scope, status, time.perf_counter() - started)

    def _observe(self, scope: Scope, status: int, seconds: float) -> None:
        # An unknown method or path must not become a label: clients could invent any number of them.
        method = scope["method"] if scope["method"] in METHODS else "other"
        route = getattr(scope.get("route"), "path", "none")
        self._owner.state.services.metrics.observe_request(method, route, status, seconds)
        figures = {"method": method, "route": route, "status": status, "duration_ms": round(1000 * seconds, 2)}
        logger.info("%s %s %d", method, route, status, extra=figures)


def _completed(headers: list[tuple[bytes, bytes]], scope: Scope) -> list[tuple[bytes, bytes]]:
    """`headers` (lower-case names, as ASGI has them) with the security headers that they lack."""
    present = {name for name, _ in headers}
    policy = (_CSP, _DOCUMENTATION if scope["path"].endswith("/docs") or GUIDE in scope["path"] else _NOTHING)
    return [*headers, *(item for item in (*_HEADERS, policy) if item[0] not in present)]


def _request_id(scope: Scope) -> str:
    """The caller's if it is plain: it goes into the log and back into a header."""
    sent: bytes = dict(scope["headers"]).get(REQUEST_ID, b"")
    return sent.decode() if _PLAIN_ID.fullmatch(sent) else uuid4().hex
