"""How a browser gets in where keys are required: a session for its key, in a cookie that no script can read."""

from string import Template
from typing import Annotated

from fastapi import APIRouter, Form, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from app.api.access_rules import COOKIE, LOGIN, LOGOUT, session_of
from app.api.routes import Wired
from app.services.errors import ExpiredKeyError

HOME = "/ui"
_PAGE = Template("""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Log in · RoboPrompt</title>
<style>body { font: 16px system-ui, sans-serif; max-width: 24rem; margin: 15vh auto; padding: 0 1rem; }
input, button { font: inherit; padding: .5rem; width: 100%; box-sizing: border-box; margin-top: .5rem; }</style>
<main>
<h1>RoboPrompt</h1>
<form method="post">
<label>API key <input name="key" type="password" autocomplete="current-password" required autofocus></label>
<button>Log in</button>
</form>
<p role="alert">$said</p>
</main>
</html>
""")
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'",
    "Cache-Control": "no-store",
}
router = APIRouter(include_in_schema=False)


@router.get(LOGIN)
async def login_page() -> Response:
    """The page that asks for a key."""
    return _page("")


@router.post(LOGIN)
async def login(
    request: Request,
    services: Wired,
    key: Annotated[str, Form(max_length=200)] = "",
    next: str = HOME,  # noqa: A002
) -> Response:
    """Begin a session, if it is a key."""
    try:
        caller = await services.keys.recognize(key.strip())
    except ExpiredKeyError:
        return _page("This key has expired.", 401)
    if caller is None:
        return _page("This key is not known, or was revoked.", 401)
    token = await services.sessions.begin(caller)
    response = RedirectResponse(next if _is_local(next) else HOME, 303)
    secure = request.url.scheme == "https"
    response.set_cookie(COOKIE, token, httponly=True, samesite="strict", secure=secure)
    return response


@router.post(LOGOUT)
async def logout(request: Request, services: Wired) -> Response:
    """End the session: its token is worth nothing from now on, wherever a copy of it is."""
    if token := session_of(dict(request.scope["headers"])):  # as the door reads it
        await services.sessions.end(token)
    response = RedirectResponse(LOGIN, 303)
    response.delete_cookie(COOKIE, httponly=True, samesite="strict")
    return response


def _page(said: str, status_code: int = 200) -> Response:
    return HTMLResponse(_PAGE.substitute(said=said), status_code, _HEADERS)


def _is_local(path: str) -> bool:
    """Whether it leads to this service: browsers take `//host` and `/\\host` for other ones."""
    return path.startswith("/") and path[1:2] not in ("/", "\\") and path.isprintable()
