"""The credentials of a request, and the scopes that each address needs.

Addresses that are not listed have the strictest rule: reading needs `read`, changing `admin`. Which tasks and whose
predictions a key sees is decided by `app.services.api_keys.caller_from` and enforced by the store's queries.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
# Opening one takes dozens of requests for scripts and pictures, so that they do not count against the rate limit.
GUIDE = "/docs/guide/"
PAGES = ("/ui/", GUIDE)
READY = "/readyz"
HEALTH = frozenset({"/healthz", READY})
LOGIN, LOGOUT = "/ui/login", "/ui/logout"
# They hold no data: the way in, and what the pages are drawn with.
OPEN = HEALTH | {LOGIN, LOGOUT, "/favicon.ico", GUIDE.rstrip("/")}
OPEN_BELOW = ("/ui/static/", "/ui/swagger/", GUIDE)
_NAME = r"[^/]+"
_RULES = tuple(
    (method, re.compile(path), frozenset(scopes))
    for method, path, *scopes in (
        # a robot reads its limits of motion
        ("GET", f"/tasks/{_NAME}", "read", "predict"),
        # with `predict` alone: those that the key itself asked for
        ("GET", "/predictions", "read", "predict"),
        ("GET", f"/predictions/{_NAME}", "read", "predict"),
        ("GET", f"/predictions/{_NAME}/images/{_NAME}/overlay", "read", "predict"),
        # it asks an LLM
        ("GET", f"/tasks/{_NAME}/check", "predict"),
        ("POST", "/episodes", "upload"),
        # nothing is lost
        ("PATCH", f"/episodes/{_NAME}", "upload"),
        # whether an interrupted upload was stored
        ("GET", f"/uploads/{_NAME}", "read", "upload"),
        # keys that may upload may also teach
        ("POST", f"/tasks/{_NAME}/object_models/learn", "upload"),
        ("POST", f"/tasks/{_NAME}/labels", "upload"),
        ("POST", f"/tasks/{_NAME}/labels/preview", "upload"),
        ("POST", f"/tasks/{_NAME}/labels/learn", "upload"),
        ("POST", f"/tasks/{_NAME}/object_models/try", "upload"),
        ("DELETE", f"/tasks/{_NAME}/labels/{_NAME}", "upload"),
        ("POST", "/predict", "predict"),
        ("POST", "/plans", "predict"),
        # the page's dry run
        ("POST", "/ui/predict/prompt", "predict"),
        ("POST", "/poses", "predict"),
        ("POST", f"/predictions/{_NAME}/outcome", "predict"),
    )
)
_READ, _ADMIN = frozenset({"read"}), frozenset({"admin"})
COOKIE = "roboprompt_session"
Headers = Mapping[bytes, bytes]


def accepted_scopes(method: str, path: str) -> frozenset[str]:
    """Return the scopes of which a key needs one; empty if no key is needed.

    Args:
        path: of a request, or its template in the OpenAPI document.
    """
    if path in OPEN or path.startswith(OPEN_BELOW):
        return frozenset()
    for listed, pattern, scopes in _RULES:
        if method == listed and pattern.fullmatch(path):
            return scopes
    return _READ if method in SAFE_METHODS else _ADMIN


@dataclass(frozen=True)
class Credential:
    """A key, or a browser's session.

    Attributes:
        token: empty if the request carries neither.
        by_cookie: the browser sends it by itself, also where another website makes it ask.
    """

    token: str
    by_cookie: bool = False


def credential_of(headers: Headers) -> Credential:
    """A key as bearer or in `X-API-Key`, else the session in the cookie of the login page."""
    scheme, _, token = headers.get(b"authorization", b"").decode("latin-1").partition(" ")
    if scheme.lower() == "bearer":
        return Credential(token.strip())
    if key := headers.get(b"x-api-key", b"").decode("latin-1"):
        return Credential(key.strip())
    token = session_of(headers)
    return Credential(token, by_cookie=bool(token))


def session_of(headers: Headers) -> str:
    """Return the session in the cookie, or an empty text."""
    cookies = headers.get(b"cookie", b"").decode("latin-1")
    if COOKIE not in cookies:
        return ""
    try:
        morsel = SimpleCookie(cookies).get(COOKIE)
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value
