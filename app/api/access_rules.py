"""The key of a request, and the scope that each address needs.

Addresses that are not listed have the strictest rule: reading needs `read`, changing `admin`.
"""

import base64
import binascii
import re
from collections.abc import Mapping

SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
GUIDE = "/docs/guide/"
# Opening one takes dozens of requests for scripts and pictures, so that they do not count against the rate limit.
PAGES = ("/ui/", GUIDE)
HEALTH = frozenset({"/healthz", "/readyz"})
_NAME = r"[^/]+"
_RULES = tuple(
    (method, re.compile(path), scope)
    for method, path, scope in (
        ("GET", f"/tasks/{_NAME}/check", "predict"),  # it may ask an LLM
        ("POST", "/(predict|plans|poses)", "predict"),
        ("POST", "/ui/predict/prompt", "predict"),
        ("POST", f"/predictions/{_NAME}/(outcome|place)", "predict"),
        ("POST", "/episodes", "teach"),
        ("PATCH", f"/episodes/{_NAME}", "teach"),
        ("PUT", f"/tasks/{_NAME}", "teach"),
        ("POST", f"/tasks/{_NAME}/.+", "teach"),
        ("DELETE", f"/tasks/{_NAME}/labels/{_NAME}", "teach"),
    )
)
Headers = Mapping[bytes, bytes]


def scope_for(method: str, path: str) -> str | None:
    """Return the scope that a key needs; None if no key is needed.

    Args:
        path: of a request, or its template in the OpenAPI document.
    """
    if path in HEALTH:
        return None
    for methods, pattern, scope in _RULES:
        if re.fullmatch(methods, method) and pattern.fullmatch(path):
            return scope
    return "read" if method in SAFE_METHODS else "admin"


def key_of(headers: Headers) -> str:
    """The key of a request, or an empty text: as bearer from robots, as password of any user from browsers."""
    scheme, _, credentials = headers.get(b"authorization", b"").decode("latin-1").partition(" ")
    match scheme.lower():
        case "bearer":
            return credentials.strip()
        case "basic":
            return _password(credentials.strip())
    return ""


def _password(credentials: str) -> str:
    try:
        return base64.b64decode(credentials, validate=True).decode().partition(":")[2].strip()
    except (binascii.Error, ValueError):  # ValueError: letters beyond ASCII, or no UTF-8
        return ""
