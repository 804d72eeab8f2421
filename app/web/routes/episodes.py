"""The list of episodes."""

from typing import Annotated

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from app.api.routes import Cursor, Wired
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import TaskCounts
from app.web.page import PageRoute, render
from app.web.thumbnails import pictured

PAGE_SIZE = 50
router = APIRouter(route_class=PageRoute)


@router.get("/ui/episodes")
def episodes_page(
    request: Request,
    services: Wired,
    task: Annotated[str, Query(max_length=64)] = "",
    containing: Annotated[str, Query(alias="q", max_length=500)] = "",
    cursor: Cursor = None,
) -> Response:
    """Episodes, newest first, of a task or of all."""
    with services.store.read() as connection:
        counts = tasks.counts(connection)
        chosen = tasks.get(connection, task) if task else None
        page = episodes.list_page(connection, task or None, PAGE_SIZE, cursor, containing)
    return render(
        request,
        "episodes.html",
        page=page,
        cameras={record.id: pictured(record.cameras) for record in page.items},
        names=list(counts),
        chosen=chosen,
        settings=None if chosen is None else TaskSettings.model_validate(chosen.settings),
        counts=counts[task] if task else TaskCounts(sum(item.episodes for item in counts.values())),
        task=task,
        containing=containing,
        first=cursor is None,
    )
