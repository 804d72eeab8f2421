"""Around every request: its id, log line and metrics, the headers of its answer; and how large its body may be."""

import logging
import re
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from http import HTTPMethod
from uuid import uuid4

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.access_rules import GUIDE
from app.api.decoding import MAX_VALUES, JsonBudget
from app.api.problems import http_problem
from app.services.measures import request_fields

logger = logging.getLogger(__name__)
REQUEST_ID = b"x-request-id"
_PLAIN_ID = re.compile(rb"[\w.-]{1,64}")
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

MULTIPART, JSON, MSGPACK = "multipart/form-data", "application/json", "application/msgpack"
# What robots send with images. In JSON an upload has its trajectory inline, too: 13,000 frames, 11 minutes at 20 Hz.
UPLOAD = "/episodes"
WITH_IMAGES = (UPLOAD, "/predict", "/poses", "/labels", "/labels/preview", "/ui/predict/prompt")
MAX_UPLOAD_VALUES = 250_000


class OuterMiddleware:
    """ASGI middleware: observes every request, and adds security headers that the route has not set.

    A request keeps the `X-Request-ID` that it came with, or gets one; the answer carries it. There is no CORS: scripts
    of other websites read no answer. HEAD is answered as GET; the server leaves out the body.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        if scope["method"] == "HEAD":  # FastAPI's routes, unlike Starlette's, do not know it
            scope = {**scope, "method": "GET"}
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
                _observe(scope, status, time.perf_counter() - started)


def _observe(scope: Scope, status: int, seconds: float) -> None:
    # An unknown method or path must not become a label: clients could invent any number of them.
    method = scope["method"] if scope["method"] in METHODS else "other"
    route = getattr(scope.get("route"), "path", "none")
    scope["app"].state.services.metrics.observe_request(method, route, status, seconds)
    figures = {"method": method, "route": route, "status": status, "duration_ms": round(1000 * seconds, 2)}
    logger.info("%s %s %d", method, route, status, extra=figures)


def _completed(headers: list[tuple[bytes, bytes]], scope: Scope) -> list[tuple[bytes, bytes]]:
    """Return `headers` (lower-case names, as in ASGI) with the missing security headers added."""
    present = {name for name, _ in headers}
    policy = (_CSP, _GUIDE if GUIDE in scope["path"] else _NOTHING)
    return [*headers, *(item for item in (*_HEADERS, policy) if item[0] not in present)]


def _request_id(scope: Scope) -> str:
    """Return the caller's id if it has only plain characters, because it is logged and sent back."""
    sent: bytes = dict(scope["headers"]).get(REQUEST_ID, b"")
    return sent.decode() if _PLAIN_ID.fullmatch(sent) else uuid4().hex


@dataclass(frozen=True)
class BodyLimits:
    """How large bodies may be, in bytes.

    Attributes:
        largest: of any; reached only with images as multipart or MessagePack.
        inline: of a JSON document with images in base64, or with a trajectory as lists of numbers.
        document: of any other document, and of the parts that are neither image nor trajectory.
        held: of all requests together that one process handles at a time.
    """

    largest: int = 200_000_000
    inline: int = 32_000_000
    document: int = 1_000_000
    held: int = 1_000_000_000

    def of(self, method: str, path: str, content_type: str) -> tuple[int, JsonBudget | None]:
        """Return the largest number of bytes, and the budget of values if the body is JSON."""
        images = method == "POST" and path.endswith(WITH_IMAGES)
        if images and content_type in (MULTIPART, MSGPACK):
            return self.largest, None
        values = MAX_UPLOAD_VALUES if path.endswith(UPLOAD) else MAX_VALUES
        budget = None if content_type in (MULTIPART, MSGPACK) else JsonBudget(values)
        return min(self.largest, self.inline if images else self.document), budget


def content_type_of(headers: Iterable[tuple[bytes, bytes]]) -> str:
    """Return the content type without parameters, or an empty text. Of several headers the first counts."""
    first = next((value for name, value in headers if name == b"content-type"), b"")
    return first.decode("latin-1").partition(";")[0].strip().lower()


class BodyLimit:
    """ASGI middleware that refuses a body as soon as it turns out too large: 413, or 503 where memory is short."""

    def __init__(self, app: ASGIApp, limits: BodyLimits) -> None:
        self._app = app
        self._limits = limits
        self._held = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        most, budget = self._limits.of(scope["method"], scope["path"], content_type_of(scope["headers"]))
        declared = int(headers.get(b"content-length", b"0"))
        received = 0

        async def limited_receive() -> Message:
            nonlocal received
            message = await receive()
            if piece := message.get("body", b""):
                received += len(piece)
                self._held += len(piece)
                self._check(max(received, declared), most)
                if budget is not None:
                    budget.feed(piece)
            return message

        refused = _too_large(most) if declared > self._limits.largest else _encoded(headers)
        if refused is not None:  # also where no route would read it
            await http_problem(refused)(scope, receive, send)
            return
        try:
            await self._app(scope, limited_receive, send)
        finally:
            self._held -= received

    def _check(self, received: int, most: int) -> None:
        if received > most:
            raise _too_large(most)
        if self._held > self._limits.held:
            detail = f"requests under way hold more than {self._limits.held} bytes already: try again"
            raise HTTPException(503, detail, {"Retry-After": "1"})


def _encoded(headers: Mapping[bytes, bytes]) -> HTTPException | None:
    """Return an error for a compressed body, which nothing here unpacks."""
    encoding = headers.get(b"content-encoding", b"identity").decode("latin-1").strip()
    if encoding.lower() in ("", "identity"):
        return None
    return HTTPException(415, f"content encoding {encoding!r:.100}: send the body uncompressed")


def _too_large(most: int) -> HTTPException:
    return HTTPException(413, f"a request of this kind may have at most {most} bytes")
