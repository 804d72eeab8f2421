"""The pages by subject, all under `/ui`; each reads the API's services, and only its scripts write, through the API."""

from fastapi import APIRouter, FastAPI
from fastapi.responses import RedirectResponse
from starlette.exceptions import HTTPException
from starlette.responses import Response

from app.web.page import PageRoute, serve_assets
from app.web.routes import episode, live, predict, predictions, tasks

HOME = "/ui/tasks"
_entrances = APIRouter(route_class=PageRoute)
_ROUTERS = (
    _entrances,
    tasks.router,
    episode.router,
    episode.documents,
    predict.router,
    predict.documents,
    predictions.router,
    predictions.documents,
    live.router,
    live.documents,
    tasks.pictures,
)


def install_pages(app: FastAPI) -> None:
    """Let `app` serve the pages; they are no part of the API that its OpenAPI document describes."""
    serve_assets(app)
    for router in (*_ROUTERS, _elsewhere):
        app.include_router(router, include_in_schema=False)


@_entrances.get("/")
@_entrances.get("/ui")
@_entrances.get("/ui/")
def enter() -> RedirectResponse:
    """To the first page."""
    return RedirectResponse(HOME)


_elsewhere = APIRouter(route_class=PageRoute)


@_elsewhere.get("/ui/{path:path}")
def elsewhere(path: str) -> Response:
    """No page of ours."""
    raise HTTPException(404, f"there is no page /ui/{path}")
