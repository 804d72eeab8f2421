"""Access control before the body is read: API keys, scopes, rate limit, and no scripts of other websites.

A rate is limited by a token bucket for each key, or for each address where there is no key.
"""

import logging
import math
import re
import time
from collections import OrderedDict
from dataclasses import dataclass
from urllib.parse import quote, urlsplit

from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.access_rules import (
    HEALTH,
    PAGES,
    SAFE_METHODS,
    Headers,
    key_of,
    scope_for,
)
from app.api.problems import Kind, problem, store_problem
from app.services.api_keys import Caller
from app.services.container import Services
from app.store.errors import StoreError
from roboprompt_client.http import is_loopback

BURST = 40  # requests of one caller at once: a page and what it fetches
MAX_QUERY_CHARS = 2000  # of an address
MAX_CALLERS = 10_000  # the callers with the latest requests; a forgotten one starts again with a full bucket
_UNAUTHENTICATED = Kind(401, "unauthenticated", "An API key is needed")
_FORBIDDEN = Kind(403, "forbidden", "This is not allowed")
_TOO_MANY = Kind(429, "too-many-requests", "Too many requests")
_MALFORMED = Kind(400, "http", "The request cannot be read")
_TOO_LONG = Kind(414, "address-too-long", "The address is too long")
_HOST = re.compile(r"(\[[\da-f:.]+\]|[\w.~-]+)(:\d*)?", re.ASCII | re.IGNORECASE)
# The first makes browsers ask for a password.
_CHALLENGES = ('Basic realm="RoboPrompt", charset="UTF-8"', 'Bearer realm="RoboPrompt"')
CHANGES = "roboprompt.changes"  # the logger of who changed what, a line for each request that did
changes = logging.getLogger(CHANGES)
HOW = "send `Authorization: Bearer KEY`, or the key as password; `roboprompt keys add` makes one"


class RateLimit:
    """Token buckets of one process: with several workers each has its own.

    Args:
        requests_per_s: in the long run; 0: no limit.
    """

    def __init__(self, requests_per_s: float) -> None:
        self._rate = requests_per_s
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def wait_s(self, caller: str) -> float:
        """Take a token. Return 0 if there was one, else the seconds until there is one."""
        if not self._rate:
            return 0.0
        now = time.monotonic()
        tokens, since = self._buckets.pop(caller, (float(BURST), now))
        tokens = min(BURST, tokens + (now - since) * self._rate)
        allowed = tokens >= 1
        self._buckets[caller] = (tokens - 1 if allowed else tokens, now)
        if len(self._buckets) > MAX_CALLERS:
            self._buckets.popitem(last=False)
        return 0.0 if allowed else (1 - tokens) / self._rate


@dataclass(frozen=True)
class Access:
    """The operator's rules for requests.

    Attributes:
        key_required: of all but health checks.
        local_only: without keys, accept only requests for this machine's own names (localhost, 127.0.0.1). This keeps
            out a website that lets its name resolve to 127.0.0.1 (DNS rebinding).
        requests_per_s: of each caller, see RateLimit.
    """

    key_required: bool = False
    local_only: bool = False
    requests_per_s: float = 0.0


class AccessControl:
    """ASGI middleware, by the keys of the application's `state.services`."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app = app
        self._access = access
        self._rate = RateLimit(access.requests_per_s)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        refusal, caller = await self._admitted(scope)
        if refusal is not None:
            await refusal(scope, receive, send)
            return

        async def noting_send(message: Message) -> None:
            if message["type"] == "http.response.start":
                _note_change(scope, caller, message)
            await send(message)

        await self._app(scope, receive, send if scope["method"] in SAFE_METHODS else noting_send)

    async def _admitted(self, scope: Scope) -> tuple[Response | None, Caller | None]:
        """Return the refusal or None, and the caller or None if no keys are required."""
        method, path = scope["method"], scope["path"].removeprefix(scope.get("root_path", ""))
        headers = dict(scope["headers"])
        if (host := _host_of(headers.get(b"host", b"").decode("latin-1"))) is None:
            return problem(_MALFORMED, "its header Host names no host"), None
        if path in HEALTH:
            return None, None
        if len(scope["query_string"]) > MAX_QUERY_CHARS:
            return problem(_TOO_LONG, f"its query may have at most {MAX_QUERY_CHARS} characters"), None
        if (refusal := self._foreign(method, host, headers)) is not None:
            return refusal, None
        try:
            caller = await _caller(scope, headers) if self._access.key_required else None
        except StoreError as error:
            return store_problem(error), None
        address = scope["client"][0] if scope["client"] else ""
        welcome = caller is not None or not self._access.key_required
        is_page = welcome and method in SAFE_METHODS and path.startswith(PAGES)
        if not is_page and (wait_s := self._rate.wait_s(address if caller is None else caller.key_id)):
            seconds = str(math.ceil(wait_s))
            return problem(_TOO_MANY, f"try again in {seconds} s", headers={"Retry-After": seconds}), None
        return _unwelcome(scope_for(method, path), headers, caller) if self._access.key_required else None, caller

    def _foreign(self, method: str, host: str, headers: Headers) -> Response | None:
        """Refuse what another website's scripts send, with the user's password or from the user's own machine.

        Browsers say `Sec-Fetch-Site` over https and to this machine alone; `Origin` they send everywhere.

        Args:
            host: without its port; empty if the request names none.
        """
        if self._access.local_only and host and not is_loopback(host):
            remedy = "a service that others reach by name says ROBOPROMPT_AUTH=on, or off"
            return problem(_FORBIDDEN, f"the request names the host {host[:100]!r}, not this machine: {remedy}")
        site, origin = headers.get(b"sec-fetch-site"), headers.get(b"origin")
        if site is not None:
            own = site in (b"same-origin", b"none")
        else:  # other programs than browsers send neither
            own = origin is None or (bool(host) and _authority_of(origin) == headers[b"host"])
        if own or method in SAFE_METHODS:
            return None
        return problem(_FORBIDDEN, "pages of other websites may not change anything here (a proxy must pass Host on)")


def _unwelcome(needed: str | None, headers: Headers, caller: Caller | None) -> Response | None:
    """Return the refusal if the caller may not do what needs this scope, else None."""
    if needed is None or (caller is not None and caller.may(needed)):
        return None
    if caller is not None:
        return problem(_FORBIDDEN, f"the key {caller.name!r} has the scope {caller.scope}; this needs {needed}")
    said = "the key is not known, or was revoked" if key_of(headers) else "there is no key"
    refusal = problem(_UNAUTHENTICATED, f"{said}: {HOW}")
    for challenge in _CHALLENGES:
        refusal.headers.append("WWW-Authenticate", challenge)
    return refusal


async def _caller(scope: Scope, headers: Headers) -> Caller | None:
    services: Services = scope["app"].state.services
    key = key_of(headers)
    return await services.keys.recognize(key) if key else None


def _note_change(scope: Scope, caller: Caller | None, start: Message) -> None:
    """Log who changed what, if the answer that starts says that something was changed."""
    if start["status"] >= 400:
        return
    key = "-" if caller is None else f"{caller.name} ({caller.key_id})"
    made = dict(start["headers"]).get(b"location", b"-").decode("latin-1")
    changes.info(
        "key=%s method=%s path=%s status=%d made=%s", key, scope["method"], quote(scope["path"]), start["status"], made
    )


def _host_of(authority: str) -> str | None:
    """Return the host in a header Host without its port; empty for an empty header, None for a malformed one."""
    if not authority:
        return ""
    return match[1].strip("[]").lower() if (match := _HOST.fullmatch(authority)) else None


def _authority_of(origin: bytes) -> bytes:
    """Return the host and port of an Origin, as in the Host of its own pages; empty if it is malformed."""
    try:
        return urlsplit(origin.decode("latin-1")).netloc.encode("latin-1")
    except ValueError:
        return b""
