"""A page: a template and what it shows, with headers that let it load nothing from elsewhere; errors in words."""

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse
from fastapi.routing import APIRoute
from jinja2 import Environment, PackageLoader, StrictUndefined
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response

from app.api.access_rules import COOKIE
from app.api.problems import problem_of
from app.pipeline.errors import RoboPromptError
from app.web.assets import PLOTLY_ADDRESS, STATIC_ADDRESS
from app.web.formats import FILTERS, interval_text
from app.web.thumbnails import pictured

# plotly.js sets style attributes and draws pictures of its own; scripts come from this server only, none is inline.
CONTENT_SECURITY_POLICY = "; ".join((
    "default-src 'none'",
    "script-src 'self'",
    "style-src 'self' 'unsafe-inline'",
    "img-src 'self' data: blob:",
    "connect-src 'self'",
    "base-uri 'none'",
    "form-action 'self'",
    "frame-ancestors 'none'",
))  # fmt: skip
HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
    "Cache-Control": "no-store",  # what is shown may change with the next upload
}
NAVIGATION = (
    ("Tasks", "/ui/tasks"),
    ("Episodes", "/ui/episodes"),
    ("Upload", "/ui/upload"),
    ("Predict", "/ui/predict"),
    ("Predictions", "/ui/predictions"),
    ("Now", "/ui/live"),
    ("API", "/docs"),
)


def _environment() -> Environment:
    """Templates that escape everything: names, instructions, replies and errors are data."""
    environment = Environment(
        loader=PackageLoader("app.web"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(FILTERS)
    environment.globals.update(navigation=NAVIGATION, interval=interval_text, pictured=pictured)
    return environment


_ENVIRONMENT = _environment()


def render(request: Request, template: str, status_code: int = 200, **shown: object) -> HTMLResponse:
    """The page that `template` makes of `shown`."""
    # Behind a proxy the service may live below a path of its host.
    root = request.scope.get("root_path", "")
    places = {"root": root, "static": root + STATIC_ADDRESS, "plotly": root + PLOTLY_ADDRESS, "here": request.url.path}
    html = _ENVIRONMENT.get_template(template).render(**places, may_log_out=COOKIE in request.cookies, **shown)
    return HTMLResponse(html, status_code, HEADERS)


def render_part(template: str, **shown: object) -> str:
    """A part of a page, for its scripts to put in place."""
    return _ENVIRONMENT.get_template(template).render(**shown)


class PageRoute(APIRoute):
    """A route whose errors are pages that say in words what the API says as a problem."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """As FastAPI asks for it."""
        answer = super().get_route_handler()

        async def answer_in_words(request: Request) -> Response:
            try:
                return await answer(request)
            except (RoboPromptError, RequestValidationError, ValidationError, HTTPException) as error:
                response = problem_of(request, error)
                problem = json.loads(bytes(response.body))
                page = render(request, "problem.html", response.status_code, problem=problem)
                page.headers.update({k: v for k, v in response.headers.items() if k == "retry-after"})
                return page

        return answer_in_words
