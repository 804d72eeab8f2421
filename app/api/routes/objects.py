"""Objects in images: poses, overlays, and labels from which the estimator `registered` learns.

Another instance of the service, or any other client, may ask this one's estimators for poses. Labels are masks.
"""

from enum import Enum
from functools import partial
from typing import Annotated

import anyio.to_thread
from fastapi import APIRouter, Query, Request, Response
from fastapi import Body as FromBody
from fastapi.responses import JSONResponse
from starlette.concurrency import run_in_threadpool

from app.api.body import Body, read_body
from app.api.decoding import StrictJsonRoute
from app.api.documents import answer
from app.api.frames import decode_frames, decoded, split_images
from app.api.routes import Wired, body_of, problems
from app.api.schemas.objects import (
    LabelBody,
    LabelList,
    LabelOut,
    LabelPreviewOut,
    LearnedLabelsOut,
    LearnLabelsBody,
    PosesBody,
    PosesOut,
)
from app.perception.frame_checks import check_rgbd
from app.perception.images import decode_mask
from app.perception.poses_wire import poses_document
from app.perception.registered.marks import Marks, outlines
from app.services.poses import find_poses, overlay_of
from app.services.teach import learn
from app.services.teach.labels import LabelDraft
from app.store import labels
from app.store.blobs import BlobStore
from app.store.labels import LabelRecord
from app.store.values import JsonObject
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.names import checked_object_name

router = APIRouter(route_class=StrictJsonRoute)
LABELS: list[str | Enum] = ["labels"]
FEW_VIEWS = 3  # with fewer, advice asks for more
PATH = "/tasks/{name}/labels"
_REFUSED = problems(
    _404="no such task or episode",
    _415="neither multipart nor JSON",
    _422="a value is not valid, or no mask follows from it",
)
PNG = "image/png"
_RESPONSES: dict[int | str, dict[str, object]] = {
    200: {"description": "the image with masks, outlines, axes and names", "content": {PNG: {}}}
}


@router.post(
    "/poses",
    operation_id="find_poses",
    tags=["poses"],
    response_model=PosesOut,
    openapi_extra=body_of(PosesBody),
    responses=problems(
        _415="neither multipart nor JSON",
        _422="a value is not valid, an object is not in view, or its pose is not certain",
    ),
)
async def poses(request: Request, services: Wired) -> Response:
    """Find objects in calibrated RGB-D images; nothing is stored.

    The protocol of the pose estimator `remote`: another instance's `object_models` may name this address. Multipart: a
    part `metadata` with `objects` and `cameras`, and the cameras' images as in an upload.
    """
    body = await read_body(request)
    return JSONResponse(await decoded(services, _find, body, services.store.blobs))


def _find(body: Body, blobs: BlobStore) -> JsonObject:
    asked = PosesBody.model_validate(body.document)
    frames = decode_frames(asked.cameras, split_images(asked.cameras, body.parts))
    return poses_document(find_poses([item.query() for item in asked.objects], frames, blobs))


@router.get(
    "/episodes/{episode_id}/images/{camera}/overlay",
    operation_id="get_episode_overlay",
    tags=["episodes"],
    response_class=Response,
    responses=_RESPONSES | problems(_404="no such episode or camera, or no color image"),
)
async def episode_overlay(services: Wired, episode_id: str, camera: str) -> Response:
    """A camera's first image with the found objects drawn into it."""
    png = await decoded(services, overlay_of, services.store, "episode", episode_id, camera)
    return Response(png, media_type=PNG)


@router.get(
    "/predictions/{prediction_id}/images/{camera}/overlay",
    operation_id="get_prediction_overlay",
    tags=["predictions"],
    response_class=Response,
    responses=_RESPONSES | problems(_404="no such prediction or camera, or no color image"),
)
async def prediction_overlay(services: Wired, prediction_id: str, camera: str) -> Response:
    """A camera's image of the request, with the found objects drawn into it."""
    png = await decoded(services, overlay_of, services.store, "prediction", prediction_id, camera)
    return Response(png, media_type=PNG)


@router.post(
    PATH, tags=LABELS, status_code=201, response_model=LabelOut, openapi_extra=body_of(LabelBody), responses=_REFUSED
)
async def label_object(request: Request, services: Wired, name: str) -> Response:
    """Mark an object in the images of an episode, or in images that are sent with the request.

    One click is enough: the mask grows from it by depth above the table, and by color where the object touches others;
    the masks of the other cameras follow. The task changes only when the object is learned.
    """
    body = await read_body(request)
    draft = await decoded(services, _draft, name, body)
    record = await run_in_threadpool(services.label_objects, draft)
    return JSONResponse(label_document(record), 201)


@router.post(
    PATH + "/preview", tags=LABELS, response_model=LabelPreviewOut, openapi_extra=body_of(LabelBody), responses=_REFUSED
)
async def preview_label(request: Request, services: Wired, name: str) -> Response:
    """The mask that a label would give the object in every camera. Nothing is stored."""
    body = await read_body(request)
    draft = await decoded(services, _draft, name, body)
    masks, yaw_deg = await run_in_threadpool(services.label_objects.preview, draft)
    cameras = [
        {"name": camera, "num_pixels": int(mask.sum()), "outlines": outlines(mask)} for camera, mask in masks.items()
    ]
    return JSONResponse({"cameras": cameras, "yaw_deg": yaw_deg})


@router.get(PATH, tags=LABELS, response_model=LabelList, responses=problems(_404="no such task"))
def list_labels(
    services: Wired,
    name: str,
    of: Annotated[str | None, Query(alias="object", max_length=64, description="only of this object")] = None,
) -> Response:
    """The labels of a task's objects."""
    with services.store.read() as connection:
        records = labels.all_of(connection, name, of)
    return JSONResponse({"labels": [label_document(record) for record in records]})


@router.delete(PATH + "/{label_id}", tags=LABELS, status_code=204, responses=problems(_404="no such task or label"))
def delete_label(services: Wired, name: str, label_id: str) -> Response:
    """Delete a label. An object model that was learned from it stays until the object is learned again."""
    with services.store.write() as connection:
        labels.remove(connection, name, label_id)
    return Response(status_code=204)


@router.post(
    PATH + "/learn",
    tags=LABELS,
    response_model=LearnedLabelsOut,
    responses=problems(
        _404="no such task",
        _409="the task changed meanwhile",
        _422="the labels do not give a template, or an episode cannot be extracted with it",
    ),
)
async def learn_from_labels(services: Wired, name: str, body: Annotated[LearnLabelsBody, FromBody()]) -> Response:
    """Learn what an object looks like from its last ten labels, and use that to find it.

    Every stored episode is extracted again; if one cannot be, nothing changes. `left_out` in the model says which views
    did not fit, and why.
    """
    asked = (services.store, services.configure_task, name, body.object, body.symmetric)
    learning = partial(learn.learn_from_labels, yaw_may_be_unknown=body.yaw_may_be_unknown, dry_run=body.dry_run)
    model = await anyio.to_thread.run_sync(learning, *asked, limiter=services.teaching)
    if not body.dry_run:
        services.prefix_warmer.changed(name)
    number = len(model["views"])
    views = "1 view" if number == 1 else f"{number} views"
    advice = "" if number >= FEW_VIEWS else f"{views}: enough to try, three to rely on"
    return JSONResponse({"object": body.object, "model": model, "advice": advice})


def label_document(record: LabelRecord) -> JsonObject:
    """A `LabelOut`."""
    pixels = [{"name": item.name, "num_pixels": record.num_pixels.get(item.name, 0)} for item in record.cameras]
    return answer(LabelOut, record, cameras=pixels)


def _draft(task: str, body: Body) -> LabelDraft:
    """A label, checked and decoded."""
    asked = LabelBody.model_validate(body.document)
    checked_object_name("object", asked.object)
    if (asked.episode_id is None) != bool(asked.cameras):
        remedy = "episode_id, or cameras with their images"
        raise InvalidInputError("episode_id", "and cameras are both given, or neither is", remedy)
    if asked.episode_id is None:
        images = split_images(asked.cameras, body.parts)
        frames = decode_frames(asked.cameras, images)
        for frame in frames:
            check_rgbd(frame)
        masks = {frame.camera.name: frame.mask for frame in frames if frame.mask is not None}
    else:
        images, frames = {}, ()
        masks = {}
        for part, data in body.parts.items():
            if not part.startswith("mask_"):
                raise InvalidInputError(part, "is not a part of a label of an episode", "metadata, mask_NAME")
            masks[part.removeprefix("mask_")] = decode_mask(part, data)
    return LabelDraft(
        task,
        asked.object,
        asked.episode_id,
        frames,
        images,
        masks,
        asked.mask_ids,
        asked.polygons,
        Marks(asked.clicks, asked.clicks_off, asked.boxes),
        asked.arrows,
        asked.yaw_deg,
    )
