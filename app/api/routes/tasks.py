"""Tasks: their settings and what is stored of them."""

from typing import Annotated

from fastapi import APIRouter, Body, Query, Response
from fastapi.openapi.models import Example
from fastapi.responses import JSONResponse

from app.api.check_document import check_document
from app.api.documents import job_document, stats_document, task_document
from app.api.routes import Wired, problems
from app.api.schemas import examples
from app.api.schemas.checks import TaskCheckOut
from app.api.schemas.poses import LearnBody, LearnedOut
from app.api.schemas.responses import JobOut, TaskList, TaskOut, TaskStatsOut
from app.api.unique_keys import UniqueKeysRoute
from app.services.container import Services
from app.services.predict.evidence import task_stats
from app.services.task_settings import TaskSettings
from app.store import episodes, erasure, tasks
from app.store.records import JobRecord, TaskRecord

_EXAMPLES: dict[str, Example] = {"press": {"value": examples.TASK}}
_ACCEPTED: dict[int | str, dict[str, object]] = {202: {"model": JobOut, "description": "a job extracts the episodes"}}
_EVERYTHING = LearnBody()
Model = Annotated[str | None, Query(min_length=1, max_length=200, description="an LLM to ask, by its name")]
router = APIRouter(tags=["tasks"], route_class=UniqueKeysRoute)


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
    responses=_ACCEPTED
    | problems(
        _409="the task changed meanwhile, or a job extracts its episodes again",
        _422="a setting is not valid, or a stored episode cannot be extracted with it",
    ),
)
def configure_task(
    services: Wired, name: str, changes: Annotated[TaskSettings, Body(openapi_examples=_EXAMPLES)]
) -> Response:
    """Set what the body names and keep the rest; creates the task if it is new.

    A change of the keyframe rule, the pose estimator or the object models extracts every stored episode again. Where
    there are many, a job does it (202, see `Location`): until it is done the task stays as it is.
    """
    outcome = services.configure_task.at_once_or_as_job(name, changes.model_dump(exclude_unset=True))
    if isinstance(outcome, JobRecord):
        return JSONResponse(job_document(outcome), 202, {"Location": f"/jobs/{outcome.id}"})
    services.prefix_warmer.changed(name)
    return JSONResponse(_document(services, outcome))


@router.delete("/tasks/{name}", operation_id="delete_task", status_code=204, responses=problems(_404="no such task"))
def delete_task(services: Wired, name: str) -> Response:
    """Delete a task with all that it holds: episodes, predictions, outcomes, jobs, answers to repeated requests.

    Images go with a later sweep, if nothing else has them. What is under way for it fails, or creates it again.
    """
    with services.store.write() as connection:
        erasure.erase_task(connection, name)
    return Response(status_code=204)


@router.get(
    "/tasks/{name}/stats",
    operation_id="get_task_stats",
    response_model=TaskStatsOut,
    responses=problems(_404="no such task"),
)
def get_task_stats(services: Wired, name: str) -> Response:
    """Success rates of the task's predictions by model and configuration, the surest first.

    They count outcomes that robots reported; the interval is Wilson's, 95 %.
    """
    return JSONResponse(stats_document(name, task_stats(services.store, name)))


@router.get(
    "/tasks/{name}/check",
    operation_id="check_task",
    response_model=TaskCheckOut,
    responses=problems(
        _404="no such task",
        _409="the task has no episodes yet",
        _422="there is no such model",
        _502="the LLM failed",
        _503="the model or the store is not available",
        _504="the LLM did not answer in time",
    ),
)
async def check_task(services: Wired, name: str, model: Model = None) -> Response:
    """Predict each demonstration from the others, before a robot moves, and say what would go wrong and what to do.

    The first 30 demonstrations are checked, without an LLM in seconds. With `model` that LLM is asked as well for what
    each of the first ten does, shown the others; these predictions are not recorded.
    """
    return JSONResponse(check_document(await services.check_task(name, model)))


@router.post(
    "/tasks/{name}/object_models/learn",
    operation_id="learn_object_models",
    response_model=LearnedOut,
    responses=problems(
        _404="no such task",
        _409="the task has no episodes, or changed meanwhile",
        _422="no episode has labels and images, or one cannot be extracted with what was learned",
    ),
)
def learn_object_models(services: Wired, name: str, body: Annotated[LearnBody, Body()] = _EVERYTHING) -> Response:
    """Learn colours, sizes and shapes of the objects from stored episodes, and find the objects by them from now on.

    Episodes with RGB-D images and masks, poses or both teach; afterwards uploads and requests need images and names
    only. Every stored episode is extracted again; if one cannot be, nothing changes.
    """
    learned = services.learn_object_models(name, body.objects, body.episodes)
    services.prefix_warmer.changed(name)
    document = {
        "object_models": dict(learned.object_models),
        "refused": {name: str(error).removeprefix(f"{error.field}: ") for name, error in learned.refused.items()},
        "episode_ids": list(learned.episode_ids),
    }
    return JSONResponse(document)


def _document(services: Services, record: TaskRecord) -> dict[str, object]:
    with services.store.read() as connection:
        return task_document(record, episodes.number_of(connection, record.name))
