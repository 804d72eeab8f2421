"""A page: a template and what it shows, with headers that let it load nothing from elsewhere; errors in words.

How pages write numbers, dates and shares. Lists show small pictures. Browsers keep our own style sheet and scripts.
"""

import hashlib
import json
import re
from collections.abc import Callable, Coroutine, Sequence
from datetime import UTC
from pathlib import Path
from typing import Any

import cv2
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse
from fastapi.routing import APIRoute
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from pydantic import BaseModel, ValidationError, model_validator
from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from app.api.access_rules import GUIDE
from app.api.problems import problem_of
from app.perception.images import decode_rgb
from app.pipeline.success_rate import SuccessRate
from app.store.blobs import BlobStore
from app.store.records import TaskCounts
from app.store.values import CameraRecord
from roboprompt_client.arms.named import TITLES
from roboprompt_client.errors import RoboPromptError

FOLDER = Path(__file__).parent / "static"
SITE = Path(__file__).parent / "site"  # built by `make docs`, and part of the wheel
FOREVER = "public, max-age=31536000, immutable"  # an address changes with its content
WIDTH_PX = 192  # twice what lists show, for dense screens
JPEG_QUALITY = 80
NOTHING = "\N{EN DASH}"
MAX_NAMED = 8  # objects of a task in a list
_PART = re.compile(r"[^/_]{1,24}[/_]*|[/_]+")
_ID = re.compile(r"\b([0-9a-f]{32})\b")
_WHOLE = Markup('<span class="part">{}</span>')
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
    ("Predict", "/ui/predict"),
    ("Predictions", "/ui/predictions"),
    ("API", "/docs"),
    *([("Guide", GUIDE)] if SITE.is_dir() else []),
)


# Equal for equal files, so that scripts that import each other stay of one version.
_CONTENT = b"".join(f"\0{path.name}\0".encode() + path.read_bytes() for path in sorted(FOLDER.iterdir()))
STATIC_ADDRESS = f"/ui/static/{hashlib.sha256(_CONTENT).hexdigest()[:12]}"


class _Immutable(StaticFiles):
    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["Cache-Control"] = FOREVER
        return response


def serve_assets(app: FastAPI) -> None:
    """Let `app` serve them and Swagger UI's under `/ui`, and the documentation at `/docs/guide`."""
    if SITE.is_dir():
        app.mount(GUIDE.rstrip("/"), StaticFiles(directory=SITE, html=True), name="guide")
    app.mount("/ui/swagger", StaticFiles(packages=[("fastapi_offline", "static")]), name="swagger")
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


def success_rate(counts: TaskCounts) -> float | None:
    """The share of successes among the predictions whose outcome was recorded; None without any."""
    recorded = counts.successes + counts.failures
    return counts.successes / recorded if recorded else None


def interval_text(successes: int, failures: int) -> str:
    """Wilson's 95 % interval of the rate of success, in whole percent; a dash without any trial."""
    if not (trials := successes + failures):
        return NOTHING
    low, high = SuccessRate(successes, trials).interval
    return f"{100 * low:.0f}{NOTHING}{100 * high:.0f}\N{NO-BREAK SPACE}%"


def plural(number: int, one: str, many: str = "") -> str:
    """``1 episode``, ``2 episodes``."""
    return f"{number:,} {one if number == 1 else many or one + 's'}"


def some(names: Sequence[str]) -> str:
    """The first of the names, and how many more there are."""
    rest = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + (f" and {rest} more" if rest > 0 else "")


def linked(text: str, root: str) -> Markup:
    """The text with each id of an episode as a link to its page; escaped."""
    link = Markup('<a class="mono" href="{root}/ui/episodes/{id}">{short}</a>')
    parts = _ID.split(text)
    return Markup("").join(
        link.format(root=root, id=part, short=part[:8]) if k % 2 else part for k, part in enumerate(parts)
    )


FILTERS: dict[str, Callable[..., Any]] = {
    "date": lambda moment: f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC",
    "number": "{:,}".format,
    "meters": lambda position_m: ", ".join(f"{value:z.3f}" for value in position_m),
    # a quaternion for a field: to a hundredth of a degree
    "rotation": lambda quaternion_xyzw: " ".join(f"{round(value, 5) + 0.0:g}" for value in quaternion_xyzw),
    "exact": lambda values: " ".join(str(value).removesuffix(".0") for value in values),
    # a name of several parts that a narrow column may break between them, and within long ones only; escaped
    "breakable": lambda name: Markup("<wbr>").join(_WHOLE.format(part) for part in _PART.findall(name)),
    "share": lambda share: NOTHING if share is None else f"{100 * share:.0f}\N{NO-BREAK SPACE}%",
    "success_rate": success_rate,
    "linked": linked,
    "plural": plural,
    "some": some,
    "fate": {"failure": "failed", "refused": "no actions", "unknown": "no outcome", "success": "succeeded"}.__getitem__,
}


# Templates escape everything: names, instructions, replies and errors are data.
_ENVIRONMENT = Environment(
    loader=PackageLoader("app.web"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
)
_ENVIRONMENT.policies["json.dumps_kwargs"] = {}  # members in their order: scripts compare settings as text
_ENVIRONMENT.filters.update(FILTERS)
_ENVIRONMENT.globals.update(
    navigation=NAVIGATION,
    interval=interval_text,
    pictured=pictured,
    arm_titles=TITLES,
)


def render(request: Request, template: str, status_code: int = 200, **shown: object) -> HTMLResponse:
    """The page that `template` makes of `shown`."""
    # Behind a proxy the service may live below a path of its host.
    root = request.scope.get("root_path", "")
    places = {"root": root, "static": root + STATIC_ADDRESS, "here": request.url.path}
    html = _ENVIRONMENT.get_template(template).render(**places, **shown)
    return HTMLResponse(html, status_code, HEADERS)


def render_part(template: str, **shown: object) -> str:
    """A part of a page, for its scripts to put in place."""
    return _ENVIRONMENT.get_template(template).render(**shown)


class FormQuery(BaseModel):
    """The query of a page's form, which sends its empty fields, too."""

    @model_validator(mode="before")
    @classmethod
    def _filled(cls, values: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in values.items() if value not in ("", [""])}


def query_of(request: Request) -> dict[str, str]:
    """What the page's form asked for, for links to other pages of the same list."""
    return {name: value for name, value in request.query_params.items() if value and name != "cursor"}


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
