"""Small pictures of episodes."""

from fastapi import APIRouter, Request
from starlette.responses import Response

from app.api.image_work import image_work
from app.api.routes import Wired
from app.services.container import Services
from app.store import episodes
from app.store.errors import NotFoundError
from app.web.thumbnails import thumbnail

HEADERS = {"Cache-Control": "private, max-age=31536000, immutable"}  # an episode's images never change
router = APIRouter()


@router.get("/ui/episodes/{episode_id}/thumbnails/{camera}")
async def episode_thumbnail(request: Request, services: Wired, episode_id: str, camera: str) -> Response:
    """A small picture of a camera's first image."""
    data = await image_work(request).run(request, _thumbnail, services, episode_id, camera)
    return Response(data, media_type="image/jpeg", headers=HEADERS)


def _thumbnail(services: Services, episode_id: str, camera: str) -> bytes:
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
    stored = next((item for item in record.cameras if item.name == camera), None)
    data = None if stored is None else thumbnail(services.store.blobs, stored)
    if data is None:
        raise NotFoundError(f"rgb image of episode {episode_id}", camera)
    return data
