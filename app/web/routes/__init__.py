"""The pages by subject, all under `/ui`; each reads the API's services, and only its scripts write, through the API."""

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import RedirectResponse
from starlette.exceptions import HTTPException
from starlette.responses import Response

from app.api.access_rules import GUIDE
from app.web.page import PageRoute, render, serve_assets
from app.web.routes import episode, predict, predictions, tasks

HOME = "/ui/tasks"
_others = APIRouter(route_class=PageRoute)


def install_pages(app: FastAPI) -> None:
    """Let `app` serve the pages; they are no part of the API that its OpenAPI document describes."""
    serve_assets(app)
    subjects = (tasks, episode, predict, predictions)
    routers = [router for subject in subjects for router in (subject.router, subject.documents)]
    for router in (*routers, _others):
        app.include_router(router, include_in_schema=False)


@_others.get("/")
@_others.get("/ui")
@_others.get("/ui/")
def enter() -> RedirectResponse:
    """To the first page."""
    return RedirectResponse(HOME)


@_others.get("/docs")
def api_page(request: Request) -> Response:
    """Swagger UI within the pages: what programs can ask for."""
    return render(request, "api.html")


@_others.get(f"{GUIDE}{{path:path}}")
def guide_that_is_not_built(path: str) -> Response:
    """The answer where a checkout has no built documentation; a wheel has it."""
    raise HTTPException(404, "the documentation is not built here: make docs")


@_others.get("/ui/{path:path}")
def elsewhere(path: str) -> Response:
    """The answer to an address under `/ui` that is not a page."""
    raise HTTPException(404, f"there is no page /ui/{path}")
