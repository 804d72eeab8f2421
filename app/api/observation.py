"""How long requests take, for the metrics and the log, and no API key in the log.

Somebody may put one into an address by mistake.
"""

import logging
import re
import time
from http import HTTPMethod
from uuid import uuid4

from fastapi import FastAPI
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.services.measures import request_fields

logger = logging.getLogger(__name__)
REQUEST_ID = b"x-request-id"
_PLAIN_ID = re.compile(rb"[\w.-]{1,64}")
METHODS = frozenset(HTTPMethod)
_KEY = re.compile(r"rps?_[0-9a-f]{12}_[\w-]{8,}")
_HIDDEN = "rp_(hidden)"


class ObserveRequests:
    """ASGI middleware that tells the services' metrics and the log of every answer.

    A request keeps the `X-Request-ID` that it came with, or gets one; the answer carries it.

    Args:
        owner: whose `state.services` has them.
    """

    def __init__(self, app: ASGIApp, owner: FastAPI) -> None:
        self._app = app
        self._owner = owner

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request_id = _request_id(scope)
        with request_fields(request_id):
            await self._observed(scope, receive, send, request_id)

    async def _observed(self, scope: Scope, receive: Receive, send: Send, request_id: str) -> None:
        started = time.perf_counter()
        status = 500

        async def watched_send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message["headers"], (REQUEST_ID, request_id.encode())]
            await send(message)

        try:
            await self._app(scope, receive, watched_send)
        finally:
            # What nobody has foreseen must not become a label: anyone could invent any number of them.
            method = scope["method"] if scope["method"] in METHODS else "other"
            route = getattr(scope.get("route"), "path", "none")
            metrics = self._owner.state.services.metrics
            seconds = time.perf_counter() - started
            metrics.observe_request(method, route, status, seconds)
            figures = {"method": method, "route": route, "status": status, "duration_ms": round(1000 * seconds, 2)}
            logger.info("%s %s %d", method, route, status, extra=figures)


def _request_id(scope: Scope) -> str:
    """The caller's if it is plain: it goes into the log and back into a header."""
    sent: bytes = dict(scope["headers"]).get(REQUEST_ID, b"")
    return sent.decode() if _PLAIN_ID.fullmatch(sent) else uuid4().hex


class HideKeys(logging.Filter):
    """Hides what looks like an API key in a record's message and arguments."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Let every record pass, without keys."""
        if isinstance(record.msg, str):
            record.msg = without_keys(record.msg)
        if isinstance(record.args, tuple):
            record.args = tuple(without_keys(item) if isinstance(item, str) else item for item in record.args)
        return True


def hide_keys_in_access_log() -> None:
    """Install the filter where addresses are logged."""
    logger = logging.getLogger("uvicorn.access")
    if not any(isinstance(item, HideKeys) for item in logger.filters):
        logger.addFilter(HideKeys())


def without_keys(text: str) -> str:
    """`text` with a placeholder for every API key in it."""
    return _KEY.sub(_HIDDEN, text)
