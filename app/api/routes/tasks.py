"""Tasks: their settings and what is stored of them."""

from typing import Annotated

from fastapi import APIRouter, Body, Response
from fastapi.openapi.models import Example
from fastapi.responses import JSONResponse

from app.api.documents import task_document
from app.api.routes import Wired, problems
from app.api.schemas import examples
from app.api.schemas.responses import TaskList, TaskOut
from app.services.container import Services
from app.services.task_settings import TaskSettings
from app.store import tasks
from app.store.records import TaskRecord

_EXAMPLES: dict[str, Example] = {"press": {"value": examples.TASK}}
router = APIRouter(tags=["tasks"])


@router.get("/tasks", operation_id="list_tasks", response_model=TaskList)
def list_tasks(services: Wired) -> Response:
    """Every task."""
    with services.store.read() as connection:
        counts = tasks.counts(connection)
        documents = [task_document(record, counts[record.name].episodes) for record in tasks.list_all(connection)]
    return JSONResponse({"tasks": documents})


@router.get("/tasks/{name}", operation_id="get_task", response_model=TaskOut, responses=problems(_404="no such task"))
def get_task(services: Wired, name: str) -> Response:
    """A task's settings."""
    with services.store.read() as connection:
        record = tasks.get(connection, name)
    return JSONResponse(_document(services, record))


@router.put(
    "/tasks/{name}",
    operation_id="configure_task",
    response_model=TaskOut,
    responses=problems(
        _409="the task changed meanwhile",
        _422="a setting is not valid, or a stored episode cannot be extracted with it",
    ),
)
def configure_task(
    services: Wired, name: str, changes: Annotated[TaskSettings, Body(openapi_examples=_EXAMPLES)]
) -> Response:
    """Set what the body names and keep the rest; creates the task if it is new.

    A change of the keyframe rule or of the pose estimator extracts every stored episode again.
    """
    record = services.configure_task(name, changes.model_dump(exclude_unset=True))
    return JSONResponse(_document(services, record))


def _document(services: Services, record: TaskRecord) -> dict[str, object]:
    with services.store.read() as connection:
        counts = tasks.counts(connection)
    return task_document(record, counts[record.name].episodes)
