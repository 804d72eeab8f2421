"""The list of tasks with their success, a task's settings, and the list of episodes with small pictures.

What a task's demonstrations make of each other is a page of its own, because it takes seconds.
"""

from collections import Counter
from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from app.api.check_document import check_document
from app.api.frames import decoded
from app.api.routes import Wired
from app.api.schemas.lists import EpisodesQuery
from app.llm.computed import YARDSTICKS
from app.services.container import Services
from app.services.extract import reading
from app.services.task_settings import TaskSettings
from app.store import episodes, prediction_lists, tasks
from app.store.errors import NotFoundError
from app.store.filters import EpisodeFilter, PredictionFilter
from app.store.records import EpisodeRecord, TaskCounts, TaskRecord
from app.web.page import FormQuery, PageRoute, query_of, render, thumbnail
from app.web.scene import scene

router = APIRouter(route_class=PageRoute)
MAX_DRAWN = 200  # demonstrations, and predictions, the newest
HEADERS = {"Cache-Control": "private, max-age=31536000, immutable"}  # an episode's images never change
documents = APIRouter()


@dataclass(frozen=True)
class TaskRow:
    """A task as the list shows it; the picture of its newest episode, if it has one, stands for it."""

    record: TaskRecord
    counts: TaskCounts
    newest: EpisodeRecord | None


@router.get("/ui/tasks")
def tasks_page(
    request: Request, services: Wired, containing: Annotated[str, Query(alias="q", max_length=64)] = ""
) -> Response:
    """Every task whose name or objects contain the text."""
    with services.store.read() as connection:
        counts = tasks.counts(connection)
        newest = episodes.newest_by_task(connection)
        records = tasks.list_all(connection)
    rows = [
        TaskRow(record, counts[record.name], newest.get(record.name))
        for record in records
        if _contains(record, containing)
    ]
    return render(request, "tasks.html", rows=rows, containing=containing, num_tasks=len(records))


def _contains(record: TaskRecord, text: str) -> bool:
    return any(text.casefold() in name.casefold() for name in (record.name, *(record.object_names or ())))


@router.get("/ui/tasks/{name}")
def task_page(request: Request, services: Wired, name: str, applied: bool = False) -> Response:
    """Where the task was shown and asked, and its settings as a form."""
    with reading(services.store, name, strict=False) as (connection, task, _):
        settings = TaskSettings.read(connection, task)
        newer = episodes.list_page(connection, EpisodeFilter(task=name), MAX_DRAWN).items
        asked = prediction_lists.list_page(connection, PredictionFilter(task=name), MAX_DRAWN).items
        success = prediction_lists.counts_by_configuration(connection, name)
    newest = next(iter(newer), None)
    pictured = next((record for record in newer if any(camera.has_rgbd for camera in record.cameras)), None)
    workspace = settings.workspace
    shown = [item for record in newer for item in record.objects]
    own = {"min": workspace.min, "max": workspace.max}
    stored = settings.model_dump(mode="json", include={"arm", "robot_base", "robot_base_yaw_deg", "num_demonstrations"})
    stored["aliases"] = {each: settings.aliases[each] for each in task.object_names or () if each in settings.aliases}
    stored["workspace"] = {"preset": workspace.preset} if workspace.preset else own
    stored["motion_limits"] = {"keep_out": task.settings["motion_limits"]["keep_out"]}
    return render(
        request,
        "task.html",
        task=task,
        settings=settings,
        newest=newest,
        pictured=pictured,
        stored=stored,
        applied=applied,
        num_shown=len(newer),
        success=success,
        yardsticks=YARDSTICKS,
        fates=Counter(item.fate for item in asked),
        scene=scene(workspace, () if newest is None else newest.objects, (), shown=shown, asked=asked),
    )


@router.get("/ui/tasks/{name}/check")
async def check_page(request: Request, services: Wired, name: str) -> Response:
    """What demonstrations share, and each held against the others."""
    return render(request, "check.html", checked=check_document(await services.check_task(name)))


class _Listed(FormQuery, EpisodesQuery):
    """What the list of episodes is asked for in its address."""


@router.get("/ui/episodes")
def episodes_page(request: Request, services: Wired, query: Annotated[_Listed, Query()]) -> Response:
    """Episodes, newest first, of a task or of all."""
    task = query.task or ""
    with services.store.read() as connection:
        counts = tasks.counts(connection)
        chosen = tasks.get(connection, task) if task else None
        page = episodes.list_page(connection, query.filter(), query.limit, query.cursor)
        num_left_out = episodes.number_of(connection, task, left_out=True) if task else 0
    return render(
        request,
        "episodes.html",
        page=page,
        names=list(counts),
        listed=query.filter(),
        query=query_of(request),
        chosen=chosen,
        settings=None if chosen is None else TaskSettings.model_validate(chosen.settings),
        counts=counts[task] if task else TaskCounts(sum(item.episodes for item in counts.values())),
        task=task,
        num_left_out=num_left_out,
        first=query.cursor is None,
    )


@documents.get("/ui/episodes/{episode_id}/thumbnails/{camera}")
async def episode_thumbnail(services: Wired, episode_id: str, camera: str) -> Response:
    """A small picture of a camera's first image."""
    data = await decoded(services, _thumbnail, services, episode_id, camera)
    return Response(data, media_type="image/jpeg", headers=HEADERS)


def _thumbnail(services: Services, episode_id: str, camera: str) -> bytes:
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
    stored = next((item for item in record.cameras if item.name == camera), None)
    data = None if stored is None else thumbnail(services.store.blobs, stored)
    if data is None:
        raise NotFoundError(f"rgb image of episode {episode_id}", camera)
    return data
