"""The tasks: what there is, how much of it, and how it fares."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Query, Request
from starlette.responses import Response

from app.api.routes import Wired
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.store.records import EpisodeRecord, TaskCounts, TaskRecord
from app.web.page import PageRoute, render
from app.web.thumbnails import pictured

router = APIRouter(route_class=PageRoute)


@dataclass(frozen=True)
class TaskRow:
    """A task as the list shows it.

    Attributes:
        newest: its newest episode, if it has one, and the camera whose picture stands for it.
    """

    record: TaskRecord
    settings: TaskSettings
    counts: TaskCounts
    newest: EpisodeRecord | None

    @property
    def camera(self) -> str | None:
        """Whose picture of the newest episode stands for the task."""
        return None if self.newest is None else pictured(self.newest.cameras)


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
        TaskRow(record, TaskSettings.model_validate(record.settings), counts[record.name], newest.get(record.name))
        for record in records
        if _contains(record, containing)
    ]
    return render(request, "tasks.html", rows=rows, containing=containing, num_tasks=len(records))


def _contains(record: TaskRecord, text: str) -> bool:
    return any(text.casefold() in name.casefold() for name in (record.name, *(record.object_names or ())))
