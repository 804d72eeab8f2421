"""What images show, apart from episodes and predictions: poses alone, and pictures of what was found, drawn over.

Another instance of the service, or any other client, may ask this one's estimators for poses.
"""

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from app.api.body import Body, read_body
from app.api.image_work import decode_frames, image_work, split_images
from app.api.routes import Wired, body_of, problems
from app.api.schemas.objects import PosesBody, PosesOut
from app.perception.poses_wire import PoseQuestion, poses_document
from app.services.limits import Limits
from app.services.pose_servers import find_poses
from app.store.blobs import BlobStore
from app.store.values import JsonObject

router = APIRouter()
PNG = "image/png"
_RESPONSES: dict[int | str, dict[str, object]] = {
    200: {"description": "the image with masks, outlines, axes and names", "content": {PNG: {}}}
}


@router.post(
    "/poses",
    operation_id="find_poses",
    tags=["poses"],
    response_model=PosesOut,
    openapi_extra=body_of(PosesBody, PosesBody),
    responses=problems(
        _400="the body cannot be read",
        _413="the body is too large",
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
    async with image_work(request).room(request, body, services.limits) as decode:
        return JSONResponse(await decode(_find, body, services.limits, services.store.blobs))


def _find(body: Body, limits: Limits, blobs: BlobStore) -> JsonObject:
    asked = PosesBody.model_validate(body.document)
    limits.check_views([item.name for item in asked.objects], [item.name for item in asked.cameras])
    frames = decode_frames(asked.cameras, split_images(asked.cameras, body.parts), limits.max_image_pixels)
    questions = [PoseQuestion(item.name, item.mask_ids, item.model) for item in asked.objects]
    return poses_document(find_poses(questions, frames, blobs))


@router.get(
    "/episodes/{episode_id}/images/{camera}/overlay",
    operation_id="get_episode_overlay",
    tags=["episodes"],
    response_class=Response,
    responses=_RESPONSES | problems(_404="no such episode or camera, or no color image"),
)
async def episode_overlay(request: Request, services: Wired, episode_id: str, camera: str) -> Response:
    """A camera's first image with the objects as they were found."""
    draw = services.draw_overlay.of_episode
    return Response(await image_work(request).run(request, draw, episode_id, camera), media_type=PNG)


@router.get(
    "/predictions/{prediction_id}/images/{camera}/overlay",
    operation_id="get_prediction_overlay",
    tags=["predictions"],
    response_class=Response,
    responses=_RESPONSES | problems(_404="no such prediction or camera, or no color image"),
)
async def prediction_overlay(request: Request, services: Wired, prediction_id: str, camera: str) -> Response:
    """What the robot saw when it asked, with the objects as they were found."""
    draw = services.draw_overlay.of_prediction
    return Response(await image_work(request).run(request, draw, prediction_id, camera), media_type=PNG)
