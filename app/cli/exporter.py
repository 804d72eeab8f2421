"""A task of a service -> its settings and its episodes, as they were uploaded."""

from collections.abc import Iterator
from typing import Any

from app.client.client import RoboPromptClient
from app.client.errors import ServiceProblemError
from app.datasets.recording import Parcel
from app.services.task_settings import TaskSettings

PAGE = 200
_IMAGES = ("rgb", "depth", "mask")


def task_settings(client: RoboPromptClient, task: str) -> dict[str, Any]:
    """What was set of the task.

    Raises:
        ServiceProblemError, ServiceUnreachableError.
    """
    document = client.get(f"/tasks/{task}")
    return {name: document[name] for name in TaskSettings.model_fields}


def episode_ids(client: RoboPromptClient, task: str) -> list[str]:
    """The ids of the task's episodes, oldest first.

    Raises:
        ServiceProblemError, ServiceUnreachableError.
    """
    ids: list[str] = []
    cursor: dict[str, int] = {}
    while True:
        page = client.get("/episodes", task=task, limit=PAGE, **cursor)
        ids += [item["id"] for item in page["episodes"]]
        if page["next_cursor"] is None:
            return ids[::-1]
        cursor = {"cursor": page["next_cursor"]}


def download(client: RoboPromptClient, ids: list[str]) -> Iterator[Parcel]:
    """The episodes in the given order, every byte as it was uploaded.

    Raises:
        ServiceProblemError, ServiceUnreachableError.
    """
    for episode_id in ids:
        address = f"/episodes/{episode_id}"
        metadata = client.get(f"{address}/metadata")
        files = {"trajectory": client.get_bytes(f"{address}/trajectory")}
        for camera in metadata["cameras"]:
            for kind in _IMAGES:
                if (data := _image(client, f"{address}/images/{camera['name']}/{kind}")) is not None:
                    files[f"{kind}_{camera['name']}"] = data
        yield Parcel(metadata, files)


def _image(client: RoboPromptClient, address: str) -> bytes | None:
    """The image as it was uploaded, or None if the camera has none of that kind."""
    try:
        return client.get_bytes(address, original=True)
    except ServiceProblemError as error:
        if error.status == 404:
            return None
        raise
