"""Ask for a prediction and watch it come."""

from typing import Annotated, get_args
from urllib.parse import quote

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.body import read_body
from app.api.image_work import image_work
from app.api.routes import Wired
from app.api.routes.predict import questioned
from app.pipeline.prompt import SYSTEM_PROMPTS
from app.pipeline.prompt_colours import prompt_spans
from app.services.predict.question import Question
from app.services.predict.select import Selection
from app.services.task_settings import PromptFormat, Representation
from app.store import episodes, tasks
from app.store.errors import NotFoundError
from app.store.values import ObjectRecord
from app.store.visibility import present
from app.web.page import HEADERS, PageRoute, render, render_part
from app.web.predict_form import ImageKind, form_again, form_of_task, image_digest
from app.web.scene import scene

Id = Annotated[str, Query(max_length=64)]
router = APIRouter(route_class=PageRoute)
documents = APIRouter()


@router.get("/ui/predict")
def predict_page(request: Request, services: Wired, task: Id = "", episode: Id = "", again: Id = "") -> Response:
    """The question: filled in from an episode, from a prediction, or from a task's newest episode."""
    with services.store.read() as connection:
        taught = [name for name, counts in tasks.counts(connection).items() if counts.episodes]
        if episode:
            task = episodes.get(connection, episode).task
        name = task or next(iter(taught), "")
        form = form_again(connection, again) if again else form_of_task(connection, name, episode) if name else None
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
    """What a request needs to look at an episode's first frame again."""
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
        form = form_of_task(connection, record.task, episode_id)
    images = {
        f"{kind}_{camera.name}": f"/ui/predict/scenes/{episode_id}/{quote(camera.name)}/{kind}"
        for camera in record.cameras
        for kind in get_args(ImageKind)
        if image_digest(camera, kind) is not None
    }
    mask_ids = {item.name: item.mask_ids for item in form.objects}
    document = {"cameras": form.camera_documents, "images": images, "mask_ids": mask_ids}
    return JSONResponse(document, headers=HEADERS)


@documents.get("/ui/predict/scenes/{episode_id}/{camera}/{kind}")
def episode_image(services: Wired, episode_id: str, camera: str, kind: ImageKind) -> Response:
    """An image of an episode's first frame, byte for byte as it was uploaded."""
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
    stored = next((item for item in record.cameras if item.name == camera), None)
    digest = None if stored is None else image_digest(stored, kind)
    if digest is None:
        raise NotFoundError(f"{kind} image of episode {episode_id}", camera)
    return Response(services.store.blobs.read(digest), media_type="application/octet-stream", headers=HEADERS)


@documents.post("/ui/predict/prompt")
async def predict_prompt(request: Request, services: Wired) -> Response:
    """The prompt that a request to `/predict` would put to its LLM, in colours, and the scene; no LLM is asked."""
    present().require_demonstrations()
    body = await read_body(request)
    async with image_work(request).room(request, body, services.limits) as decode:
        query, _ = await questioned(decode, body, services.limits)
        question = await services.predict_actions.prepare(query, {}, ask_meaning=False)
        del query
    return await run_in_threadpool(_prompt_part, request, services, question)


def _prompt_part(request: Request, services: Wired, question: Question) -> Response:
    prompt, style = question.prompt, question.style
    with services.store.read() as connection:
        shown = episodes.by_ids(connection, question.request.task, question.template.demonstration_ids)
    html = render_part(
        "prompt_part.html",
        root=request.scope.get("root_path", ""),
        question=question,
        system=prompt.system,
        spans=prompt_spans(prompt.user, style.representation, style.prompt_format),
        shown=shown,
    )
    observed = [ObjectRecord.of(pose) for pose in question.observed]
    demonstrated = [item for record in shown.values() for item in record.objects]
    drawn = scene(question.settings.workspace, observed, (), shown=demonstrated)
    return JSONResponse({"html": html, "scene": drawn}, headers=HEADERS)
