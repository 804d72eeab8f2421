"""Poses alone: what another instance of the service, or anybody else, asks of this one's estimators."""

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from app.api.body import Body, read_body
from app.api.frames import decode_frames, split_images
from app.api.image_work import image_work
from app.api.openapi import body_of
from app.api.routes import Wired, problems
from app.api.schemas.poses import PosesBody, PosesOut
from app.perception.poses_wire import PoseQuestion, poses_document
from app.services.pose_servers import find_poses
from app.services.request_limits import Limits
from app.store.values import JsonObject

router = APIRouter(tags=["poses"])


@router.post(
    "/poses",
    operation_id="find_poses",
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
        return JSONResponse(await decode(_find, body, services.limits))


def _find(body: Body, limits: Limits) -> JsonObject:
    asked = PosesBody.model_validate(body.document)
    limits.check_views([item.name for item in asked.objects], [item.name for item in asked.cameras])
    frames = decode_frames(asked.cameras, split_images(asked.cameras, body.parts), limits.max_image_pixels)
    questions = [PoseQuestion(item.name, item.mask_ids, item.model) for item in asked.objects]
    return poses_document(find_poses(questions, frames))
