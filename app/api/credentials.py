"""What a request carries to say who sends it."""

from collections.abc import Mapping
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie

COOKIE = "roboprompt_session"
Headers = Mapping[bytes, bytes]


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
    """The session in the cookie; empty if there is none."""
    cookies = headers.get(b"cookie", b"").decode("latin-1")
    if COOKIE not in cookies:
        return ""
    try:
        morsel = SimpleCookie(cookies).get(COOKIE)
    except CookieError:
        return ""
    return "" if morsel is None else morsel.value
