"""Ask for a prediction and watch it come.

The form is filled in from a task, an episode, or a prediction that is asked for again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, get_args
from urllib.parse import quote

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.body import read_body
from app.api.routes import Wired
from app.api.routes.predict import questioned
from app.pipeline.prompt import SYSTEM_PROMPTS
from app.pipeline.spans import prompt_spans
from app.services.extract import reading
from app.services.predict.question import Question
from app.services.predict.request import PredictOptions, Selection
from app.services.task_settings import PromptFormat, Representation, TaskSettings
from app.store import episodes, predictions, tasks
from app.store.filters import EpisodeFilter
from app.store.records import EpisodeRecord, TaskRecord
from app.store.values import CameraRecord, ImageKind, JsonObject, ObjectRecord
from app.web.page import HEADERS, PageRoute, render, render_part
from app.web.scene import scene

NUM_EPISODES = 100  # offered to take a scene from
UNSET = dict.fromkeys((*PredictOptions.model_fields, "end_effector"))
Id = Annotated[str, Query(max_length=64)]
router = APIRouter(route_class=PageRoute)
documents = APIRouter()


@dataclass(frozen=True)
class ObjectField:
    """An object's fields; `pose` is None where it is not known yet."""

    name: str
    pose: ObjectRecord | None
    mask_ids: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class PredictForm:
    """The page's fields.

    Attributes:
        from_episode: whose scene it is; None for the scene of `again`.
        again: id of the prediction that is tried again.
        settings: as a request names them; None follows the task, then the model.
    """

    task: TaskRecord
    task_settings: TaskSettings
    instruction: str
    objects: tuple[ObjectField, ...]
    cameras: tuple[CameraRecord, ...]
    instructions: tuple[str, ...]
    episodes: tuple[EpisodeRecord, ...]
    from_episode: EpisodeRecord | None
    again: str | None = None
    settings: Mapping[str, Any] = field(default_factory=UNSET.copy)

    @property
    def looks(self) -> bool:
        """Whether the task's objects are found in images."""
        return self.task_settings.pose_estimator != "given" or bool(self.task_settings.object_models)

    @property
    def camera_documents(self) -> Sequence[JsonObject]:
        """The cameras as a request names them."""
        return [camera.calibration for camera in self.cameras]


def form_again(connection: Connection, prediction_id: str) -> PredictForm:
    """The question of a recorded prediction, the objects where they were found.

    Raises:
        NotFoundError: if there is no such prediction.
    """
    record = predictions.get(connection, prediction_id)
    form = form_of_task(connection, record.task, None)
    asked = {item["name"]: tuple(item.get("mask_ids", ())) for item in record.request.get("objects", ())}
    objects = tuple(ObjectField(item.name, item, asked.get(item.name, ())) for item in record.objects)
    return replace(
        form,
        instruction=record.instruction,
        objects=objects or form.objects,
        cameras=record.cameras or form.cameras,
        from_episode=None,
        again=record.id,
        settings={**UNSET, **record.request, "model": record.model},
    )


def form_of_task(connection: Connection, name: str, episode_id: str | None) -> PredictForm:
    """The scene of an episode of the task, of its newest without an id.

    Raises:
        NotFoundError: if there is no such task or episode.
    """
    task = tasks.get(connection, name)
    listed = episodes.list_page(connection, EpisodeFilter(task=name), NUM_EPISODES).items
    chosen = episodes.get(connection, episode_id) if episode_id else next(iter(listed), None)
    objects = [ObjectField(each, None) for each in task.object_names or ()]
    if chosen is not None:
        mask_ids = {item["name"]: tuple(item["mask_ids"]) for item in chosen.given_objects}
        objects = [ObjectField(item.name, item, mask_ids.get(item.name, ())) for item in chosen.objects]
    return PredictForm(
        task,
        TaskSettings.model_validate(task.settings),
        "" if chosen is None else chosen.instruction,
        tuple(objects),
        () if chosen is None else chosen.cameras,
        episodes.instructions(connection, name),
        listed,
        chosen,
    )


@router.get("/ui/predict")
def predict_page(request: Request, services: Wired, task: Id = "", episode: Id = "", again: Id = "") -> Response:
    """The question: filled in from an episode, from a prediction, or from a task's newest episode."""
    with services.store.read() as connection:
        taught = [name for name, counts in tasks.counts(connection).items() if counts.episodes]
        if episode:
            task = episodes.get(connection, episode).task
        elif again:
            task = predictions.get(connection, again).task
    form, name = None, task or next(iter(taught), "")
    if name:
        with reading(services.store, name, strict=False) as now:
            form = form_again(now.connection, again) if again else form_of_task(now.connection, name, episode)
    return render(
        request,
        "predict.html",
        form=form,
        taught=taught,
        models=services.models.profiles(),
        default_model=services.default_model,
        representations=get_args(Representation),
        prompt_formats=get_args(PromptFormat),
        system_prompts=list(SYSTEM_PROMPTS),
        selections=get_args(Selection),
    )


@documents.get("/ui/predict/scenes/{episode_id}")
def episode_scene(services: Wired, episode_id: str) -> Response:
    """Cameras, addresses of images and mask ids of an episode's first frame, for a request that uses them again."""
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
        form = form_of_task(connection, record.task, episode_id)
    images = {
        f"{kind}_{camera.name}": f"/episodes/{episode_id}/images/{quote(camera.name, safe='')}/{kind}?original=true"
        for camera in record.cameras
        for kind in get_args(ImageKind)
        if camera.digest(kind) is not None
    }
    mask_ids = {item.name: item.mask_ids for item in form.objects}
    document = {"cameras": form.camera_documents, "images": images, "mask_ids": mask_ids}
    return JSONResponse(document, headers=HEADERS)


@documents.post("/ui/predict/prompt")
async def predict_prompt(request: Request, services: Wired) -> Response:
    """The prompt that a request to `/predict` would put to its LLM, in colors, and the scene; no LLM is asked."""
    body = await read_body(request)
    query, _ = await questioned(body, services)
    question = await services.predict_actions.prepare(query)
    return await run_in_threadpool(_prompt_part, request, services, question)


def _prompt_part(request: Request, services: Wired, question: Question) -> Response:
    prompt, style = question.prompt, question.known.style
    with services.store.read() as connection:
        shown = episodes.by_ids(connection, question.request.task, question.prefix.demonstration_ids)
    html = render_part(
        "prompt_part.html",
        root=request.scope.get("root_path", ""),
        question=question,
        system=prompt.system,
        spans=prompt_spans(prompt.user, style.representation, style.prompt_format),
        shown=shown,
    )
    observed = [ObjectRecord.of(pose) for pose in question.known.observed]
    demonstrated = [item for record in shown.values() for item in record.objects]
    drawn = scene(question.known.task.settings.workspace, observed, (), shown=demonstrated)
    return JSONResponse({"html": html, "scene": drawn}, headers=HEADERS)
