"""Teaching an object by what it looks like: clicks in an episode's pictures, and where it is found in the others."""

from fastapi import APIRouter, Request
from starlette.responses import Response

from app.api.routes import Wired
from app.services.task_settings import TaskSettings
from app.store import episodes, tasks
from app.web.page import PageRoute, render

MAX_TRIED = 100  # episodes in which the page looks for an object, the newest
router = APIRouter(route_class=PageRoute)
documents = APIRouter()


@router.get("/ui/episodes/{episode_id}/object")
def object_page(request: Request, services: Wired, episode_id: str, name: str = "") -> Response:
    """Where an object is shown in the pictures of an episode."""
    with services.store.read() as connection:
        record = episodes.get(connection, episode_id)
        task = tasks.get(connection, record.task)
        ids = episodes.list_ids(connection, record.task)[::-1]
        older, newer = episodes.neighbours(connection, record)
    names = task.object_names or ()
    return render(
        request,
        "object.html",
        episode=record,
        cameras=[camera for camera in record.cameras if camera.has_rgbd],
        names=names,
        chosen=name if name in names else names[0],
        settings=TaskSettings.model_validate(task.settings),
        older=older,
        newer=newer,
        page={"task": record.task, "episode": record.id, "episodes": ids[:MAX_TRIED], "num_episodes": len(ids)},
    )
