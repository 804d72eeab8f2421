"""Tasks: settings, statistics, deletion, checks of their demonstrations, and object models."""

from functools import partial
from typing import Annotated

import anyio.to_thread
from fastapi import APIRouter, Body, Query, Response
from fastapi.openapi.models import Example
from fastapi.responses import JSONResponse

from app.api.check_document import check_document
from app.api.decoding import StrictJsonRoute
from app.api.documents import stats_document, task_document
from app.api.frames import decoded
from app.api.routes import Wired, problems
from app.api.schemas import examples
from app.api.schemas.checks import TaskCheckOut
from app.api.schemas.objects import LearnBody, LearnedOut, TriedModelOut, TryModelBody
from app.api.schemas.tasks import TaskList, TaskOut, TaskStatsOut
from app.perception.poses_wire import poses_document
from app.services.container import Services
from app.services.extract import reading
from app.services.task_settings import TaskSettings
from app.services.teach import learn
from app.services.teach.learn import Tried, try_model
from app.store import episodes, prediction_lists, tasks
from app.store.values import JsonObject

_EXAMPLES: dict[str, Example] = {"press": {"value": examples.TASK}}
_EVERYTHING = LearnBody()
Model = Annotated[str | None, Query(min_length=1, max_length=200, description="name of an LLM to ask as well")]

router = APIRouter(tags=["tasks"], route_class=StrictJsonRoute)


@router.get("/tasks", response_model=TaskList)
def list_tasks(services: Wired) -> Response:
    """Every task."""
    with services.store.read() as connection:
        numbers = tasks.num_episodes(connection)
        documents = [
            task_document(record, TaskSettings.read(connection, record), numbers.get(record.name, 0))
            for record in tasks.list_all(connection)
        ]
    return JSONResponse({"tasks": documents})


@router.get("/tasks/{name}", response_model=TaskOut, responses=problems(_404="no such task"))
def get_task(services: Wired, name: str) -> Response:
    """A task's settings; a workspace `auto` with the box that follows from the present demonstrations."""
    return JSONResponse(_document(services, name))


@router.put(
    "/tasks/{name}",
    response_model=TaskOut,
    responses=problems(_409="the task changed meanwhile", _422="a setting is not valid"),
)
async def configure_task(
    services: Wired,
    name: str,
    changes: Annotated[TaskSettings, Body(openapi_examples=_EXAMPLES)],
    version: Annotated[
        int | None,
        Query(ge=1, description="version of the task that the change is based on; 409 if the task has another by now"),
    ] = None,
) -> Response:
    """Set the named settings and keep the others; create the task if it is new.

    Where the keyframe rule, the pose estimator or the object models change, each stored episode is extracted again when
    it is next read. One that cannot be extracted is an error of the request that needs it, e.g. of a prediction.
    """
    configure = partial(services.configure_task, name, changes.model_dump(exclude_unset=True), version=version)
    await anyio.to_thread.run_sync(configure, limiter=services.teaching)
    services.prefix_warmer.changed(name)
    return JSONResponse(await anyio.to_thread.run_sync(_document, services, name))


@router.delete("/tasks/{name}", status_code=204, responses=problems(_404="no such task"))
def delete_task(services: Wired, name: str) -> Response:
    """Delete a task with all that it holds: episodes, predictions, outcomes, answers to repeated requests.

    Images that nothing else uses are deleted later. Requests under way for the task fail or create it again.
    """
    with services.store.write() as connection:
        tasks.remove(connection, name)
    return Response(status_code=204)


@router.get("/tasks/{name}/stats", response_model=TaskStatsOut, responses=problems(_404="no such task"))
def get_task_stats(services: Wired, name: str) -> Response:
    """Success rates of the task's predictions by model and configuration, most reliable first.

    They count outcomes that robots reported; the interval is Wilson's, 95 %.
    """
    with services.store.read() as connection:
        tasks.get(connection, name)
        counted = prediction_lists.counts_by_configuration(connection, name)
    return JSONResponse(stats_document(name, counted))


@router.get(
    "/tasks/{name}/check",
    response_model=TaskCheckOut,
    responses=problems(
        _404="no such task",
        _409="the task has no episodes yet",
        _422="an episode cannot be extracted with the task's settings",
    ),
)
async def check_task(services: Wired, name: str) -> Response:
    """Hold each demonstration against the others before a robot moves; the findings say what to mend.

    They are those of the task's uploads and predictions.
    """
    return JSONResponse(check_document(await services.check_task(name)))


@router.post(
    "/tasks/{name}/object_models/learn",
    response_model=LearnedOut,
    responses=problems(
        _404="no such task",
        _409="the task has no episodes, or changed meanwhile",
        _422="no episode has labels and images",
    ),
)
async def learn_object_models(services: Wired, name: str, body: Annotated[LearnBody, Body()] = _EVERYTHING) -> Response:
    """Learn colors, sizes and shapes of the objects from stored episodes, and use them to find the objects.

    This needs episodes with RGB-D images and with masks or poses. Afterwards uploads and requests need only images and
    names. Stored episodes are extracted again when they are next read.
    """
    asked = (services.store, services.configure_task, name, body.objects, body.episodes)
    learned = await anyio.to_thread.run_sync(learn.learn_object_models, *asked, limiter=services.teaching)
    services.prefix_warmer.changed(name)
    document = {
        "object_models": dict(learned.object_models),
        "refused": {name: str(error).removeprefix(f"{error.field}: ") for name, error in learned.refused.items()},
        "episode_ids": list(learned.episode_ids),
    }
    return JSONResponse(document)


@router.post(
    "/tasks/{name}/object_models/try",
    response_model=TriedModelOut,
    responses=problems(_404="no such task or episode", _422="the model is not valid"),
)
async def try_object_model(services: Wired, name: str, body: Annotated[TryModelBody, Body()]) -> Response:
    """Find an object by a model in the images of stored episodes; nothing is stored."""
    asked = (name, body.object, body.model, body.episode_ids)
    tried = await decoded(services, try_model, services.store, services.pose_servers, *asked)
    return JSONResponse({"episodes": [_tried_document(item) for item in tried]})


def _tried_document(tried: Tried) -> JsonObject:
    refusal = tried.refusal
    return {
        "episode_id": tried.episode_id,
        "pose": None if tried.pose is None else poses_document([tried.pose])["poses"][0],
        "refusal": None if refusal is None else {"message": refusal.message, "valid": refusal.valid},
    }


def _document(services: Services, name: str) -> dict[str, object]:
    with reading(services.store, name, strict=False) as (connection, task, _):
        settings = TaskSettings.read(connection, task)
        number, unseen = episodes.number_of(connection, name), episodes.number_unseen(connection, name)
    return task_document(task, settings, number, unseen)
