"""A page: a template and what it shows, with headers that let it load nothing from elsewhere; errors in words.

Lists show small pictures. Browsers keep our own style sheet and scripts.
"""

import hashlib
import json
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

import cv2
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse
from fastapi.routing import APIRoute
from jinja2 import Environment, PackageLoader, StrictUndefined
from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from app.api.access_rules import COOKIE, GUIDE
from app.api.problems import problem_of
from app.perception.images import decode_rgb
from app.store.blobs import BlobStore
from app.store.values import CameraRecord
from app.web.scene_picture import picture_of_episode, picture_of_prediction
from app.web.texts import FILTERS, interval_text
from roboprompt_client.errors import RoboPromptError

FOLDER = Path(__file__).parent / "static"
SITE = Path(__file__).parent / "site"  # built by `make docs`, and part of the wheel
FOREVER = "public, max-age=31536000, immutable"  # an address changes with its content
WIDTH_PX = 192  # twice what lists show, for dense screens
JPEG_QUALITY = 80
# Swagger UI sets style attributes; scripts come from this server only, none is inline.
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
    "Cache-Control": "no-store",  # what is shown may change with the next upload
}
NAVIGATION = (
    ("Tasks", "/ui/tasks"),
    ("Episodes", "/ui/episodes"),
    ("Upload", "/ui/upload"),
    ("Predict", "/ui/predict"),
    ("Predictions", "/ui/predictions"),
    ("Now", "/ui/live"),
    ("API", "/ui/api"),
    ("Guide", GUIDE),
)


def _digest() -> str:
    """Equal for equal files: part of their addresses, so that scripts that import each other stay of one version."""
    digest = hashlib.sha256()
    for path in sorted(FOLDER.iterdir()):
        digest.update(f"\0{path.name}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:12]


STATIC_ADDRESS = f"/ui/static/{_digest()}"


class _Immutable(StaticFiles):
    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["Cache-Control"] = FOREVER
        return response


def serve_assets(app: FastAPI) -> None:
    """Let `app` serve them under `/ui`, and the documentation at `/docs/guide`."""
    if SITE.is_dir():
        app.mount(GUIDE.rstrip("/"), StaticFiles(directory=SITE, html=True), name="guide")
    app.mount(STATIC_ADDRESS, _Immutable(directory=FOLDER), name="ui-static")


def thumbnail(blobs: BlobStore, camera: CameraRecord) -> bytes | None:
    """A JPEG of the camera's color image; None if it has none.

    Raises:
        CorruptDataError, StoreUnavailableError: if the image cannot be read.
    """
    if camera.rgb_digest is None:
        return None
    rgb = decode_rgb(f"rgb_{camera.name}", blobs.read(camera.rgb_digest))
    height, width = rgb.shape[:2]
    size = (WIDTH_PX, max(1, round(height * WIDTH_PX / width)))
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small[..., ::-1], (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))[1].tobytes()


def pictured(cameras: tuple[CameraRecord, ...]) -> str | None:
    """The name of the first camera with a color image."""
    return next((camera.name for camera in cameras if camera.rgb_digest is not None), None)


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
    environment.globals.update(picture_of_episode=picture_of_episode, picture_of_prediction=picture_of_prediction)
    return environment


_ENVIRONMENT = _environment()


def render(request: Request, template: str, status_code: int = 200, **shown: object) -> HTMLResponse:
    """The page that `template` makes of `shown`."""
    # Behind a proxy the service may live below a path of its host.
    root = request.scope.get("root_path", "")
    places = {"root": root, "static": root + STATIC_ADDRESS, "here": request.url.path}
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
