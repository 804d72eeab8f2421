"""Pictures for the eye: what was found in an image, drawn over it."""

from fastapi import APIRouter, Request, Response

from app.api.image_work import image_work
from app.api.routes import Wired, problems

PNG = "image/png"
_RESPONSES: dict[int | str, dict[str, object]] = {
    200: {"description": "the image with masks, outlines, axes and names", "content": {PNG: {}}}
}
router = APIRouter()


@router.get(
    "/episodes/{episode_id}/images/{camera}/overlay",
    operation_id="get_episode_overlay",
    tags=["episodes"],
    response_class=Response,
    responses=_RESPONSES | problems(_404="no such episode or camera, or no colour image"),
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
    responses=_RESPONSES | problems(_404="no such prediction or camera, or no colour image"),
)
async def prediction_overlay(request: Request, services: Wired, prediction_id: str, camera: str) -> Response:
    """What the robot saw when it asked, with the objects as they were found."""
    draw = services.draw_overlay.of_prediction
    return Response(await image_work(request).run(request, draw, prediction_id, camera), media_type=PNG)
