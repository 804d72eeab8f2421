"""Episodes: upload, list, read, correct and delete."""

from functools import partial
from typing import Annotated, Any

import anyio.to_thread
from fastapi import APIRouter, Header, Query, Request, Response
from fastapi import Body as FromBody
from fastapi.responses import JSONResponse
from starlette.concurrency import run_in_threadpool

from app.api.body import Body, read_body
from app.api.decoding import StrictJsonRoute
from app.api.documents import episode_document, metadata_document
from app.api.frames import decode_frames, decoded, split_images
from app.api.routes import Wired, body_of, problems
from app.api.schemas.lists import EpisodesQuery
from app.api.schemas.requests import EpisodeEdit, EpisodeJson, EpisodeMetadata
from app.api.schemas.responses import EpisodeOut, EpisodePage
from app.perception.images import as_image
from app.pipeline.episode import Episode
from app.services.container import Services
from app.services.extract import read_episode, read_episodes
from app.services.images import stored_image
from app.services.teach.edit import edit_episode
from app.services.teach.upload_checks import Upload
from app.store import episodes, tasks, trajectories
from app.store.store import Store
from app.store.values import ImageKind, JsonObject
from app.untrusted_arrays import trajectory_from_npz
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.types.trajectory import Trajectory, npz_from_trajectory, trajectory_from_arrays

router = APIRouter(tags=["episodes"], route_class=StrictJsonRoute)


@router.post(
    "/episodes",
    status_code=201,
    response_model=EpisodeOut,
    openapi_extra=body_of(EpisodeJson, EpisodeMetadata, "trajectory"),
    responses=problems(
        _409="the idempotency key came with other content",
        _415="neither multipart nor JSON",
        _422="a value is not valid, or the objects are not those of the task",
    ),
)
async def upload_episode(
    request: Request,
    services: Wired,
    idempotency_key: Annotated[
        str | None,
        Header(min_length=1, max_length=200, description="what is sent again with the same key is stored once"),
    ] = None,
) -> Response:
    """Store a demonstration, find its keyframes and estimate its objects' poses.

    Multipart: a part `metadata` (JSON), a part `trajectory` (.npz, no pickles) and per camera NAME the parts `rgb_NAME`
    (PNG, JPEG or .npy), `depth_NAME` (16-bit PNG, or .npy in meters) and `mask_NAME` (16-bit PNG or .npy of ids) of the
    first frame. Or one JSON document with the same names, arrays inline, files in base64. The first episode of a task
    creates it.
    """
    body = await read_body(request)
    async with services.teaching:  # before the trajectory is unpacked, which may be a thousand times as large then
        upload = await decoded(services, _read_upload, body, idempotency_key)
        document = await run_in_threadpool(_uploaded, services, upload)
    services.prefix_warmer.changed(document["task"])
    return JSONResponse(document, 201, {"Location": f"/episodes/{document['id']}"})


def _read_upload(body: Body, idempotency_key: str | None) -> Upload:
    """Return the upload, checked and decoded."""
    document, parts = dict(body.document), dict(body.parts)
    if (npz := parts.pop("trajectory", None)) is not None:
        metadata = EpisodeMetadata.model_validate(document)
        trajectory = trajectory_from_npz(npz)
    else:
        metadata, trajectory = _from_json(document)
    images = split_images(metadata.cameras, parts)
    frames = decode_frames(metadata.cameras, images)
    episode = Episode(metadata.instruction, trajectory, frames, metadata.control_frequency_hz, metadata.extra)
    objects = tuple(item.query() for item in metadata.objects)
    said = metadata.model_dump(include={"prediction_id", "corrects", "left_out", "note", "uploaded_instruction"})
    return Upload(metadata.task, episode, objects, images, body.digest(), idempotency_key, **said)


def _from_json(document: JsonObject) -> tuple[EpisodeMetadata, Trajectory]:
    """The two halves of a JSON upload; the arrays are checked by Trajectory, once."""
    arrays: Any = document.get("trajectory")
    if not isinstance(arrays, dict):
        remedy = "a .npz part named trajectory, or a JSON object of arrays"
        raise InvalidInputError("trajectory", "is missing", remedy)
    if unknown := set(document) - {"metadata", "trajectory"}:
        raise InvalidInputError(sorted(unknown)[0], "is not known", "metadata, trajectory, rgb_/depth_/mask_NAME")
    return EpisodeMetadata.model_validate(document.get("metadata")), trajectory_from_arrays(arrays)


@router.get("/episodes", response_model=EpisodePage, responses=problems(_404="no such task"))
def list_episodes(services: Wired, query: Annotated[EpisodesQuery, Query()]) -> Response:
    """Episodes, newest first."""
    with services.store.read() as connection:
        if query.task is not None:
            tasks.get(connection, query.task)
        page = episodes.list_page(connection, query.filter(), query.limit, query.cursor)
    documents = [episode_document(*item) for item in read_episodes(services.store, page.items)]
    return JSONResponse({"episodes": documents, "next_cursor": page.next_cursor})


@router.get(
    "/episodes/{episode_id}",
    response_model=EpisodeOut,
    responses=problems(_404="no such episode", _422="it cannot be extracted with the task's settings"),
)
def get_episode(services: Wired, episode_id: str) -> Response:
    """One episode with its keyframes and object poses, as the task's settings want them."""
    return JSONResponse(episode_document(*read_episode(services.store, episode_id, strict=True)))


def _uploaded(services: Services, upload: Upload) -> JsonObject:
    return _document(services.store, services.upload_episode(upload).id)


def _document(store: Store, episode_id: str) -> JsonObject:
    return episode_document(*read_episode(store, episode_id))


@router.get(
    "/episodes/{episode_id}/metadata", response_model=EpisodeMetadata, responses=problems(_404="no such episode")
)
def get_metadata(services: Wired, episode_id: str) -> Response:
    """The metadata of the episode's upload; with its trajectory and images it can be uploaded elsewhere."""
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
    return JSONResponse(metadata_document(record))


@router.patch(
    "/episodes/{episode_id}",
    operation_id="edit_episode",
    response_model=EpisodeOut,
    responses=problems(
        _404="no such episode",
        _422="a value is not valid, the instruction names no object",
    ),
)
async def edit(services: Wired, episode_id: str, body: Annotated[EpisodeEdit, FromBody()]) -> Response:
    """Correct the instruction, leave the episode out of prompts or show it again, or change its note.

    The first instruction is kept as `uploaded_instruction`. An episode that is shown again is extracted with the task's
    present settings.
    """
    change = partial(_edited, services.store, episode_id, body.changes())
    document = await anyio.to_thread.run_sync(change, limiter=services.teaching)
    services.prefix_warmer.changed(document["task"])
    return JSONResponse(document)


def _edited(store: Store, episode_id: str, changes: JsonObject) -> JsonObject:
    return _document(store, edit_episode(store, episode_id, changes).id)


@router.delete("/episodes/{episode_id}", status_code=204, responses=problems(_404="no such episode"))
def delete_episode(services: Wired, episode_id: str) -> Response:
    """Delete an episode; its images go with the next sweep."""
    with services.store.write() as connection:
        task = episodes.remove(connection, episode_id)
    services.prefix_warmer.changed(task)
    return Response(status_code=204)


@router.get(
    "/episodes/{episode_id}/trajectory",
    response_class=Response,
    responses={
        200: {"description": "the .npz file", "content": {"application/octet-stream": {}}},
        **problems(_404="no such episode"),
    },
)
def get_trajectory(services: Wired, episode_id: str) -> Response:
    """The trajectory as a .npz file with the arrays of the upload."""
    with services.store.read() as connection:
        trajectory = trajectories.get_trajectory(connection, episode_id)
    headers = {"Content-Disposition": f'attachment; filename="{episode_id}.npz"'}
    return Response(npz_from_trajectory(trajectory), media_type="application/octet-stream", headers=headers)


@router.get(
    "/episodes/{episode_id}/images/{camera}/{kind}",
    response_class=Response,
    responses={
        200: {
            "description": "the image as uploaded; depth and mask arrays as a 16-bit PNG",
            "content": {"image/png": {}, "image/jpeg": {}, "application/octet-stream": {}},
        },
        **problems(_404="no such episode, camera or image", _422="no such kind of image"),
    },
)
async def get_image(
    request: Request,
    services: Wired,
    episode_id: str,
    camera: str,
    kind: ImageKind,
    original: Annotated[bool, Query(description="the very bytes that were uploaded, also of an array")] = False,
) -> Response:
    """A camera's image of the first frame."""
    return await decoded(services, _image, services, episode_id, camera, kind, original)


def _image(services: Services, episode_id: str, camera: str, kind: ImageKind, original: bool) -> Response:
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
    stored, digest = stored_image(record.cameras, camera, kind, f"episode {episode_id}")
    data = services.store.blobs.read(digest)
    if original:
        return Response(data, media_type="application/octet-stream")
    data, media_type = as_image(data, kind, stored.camera().depth_scale)
    return Response(data, media_type=media_type)
