"""`roboprompt export`: a task's episodes for other tools, or for another service.

A task of a service -> its settings and its episodes, as they were uploaded.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from app.cli.shared import AsJson, Url, counted, if_there, paged_items, service_at
from app.datasets.archive import write_archive
from app.datasets.lerobot_writer import write_lerobot
from app.datasets.parcel import Parcel
from app.services.task_settings import TaskSettings
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient

PAGE = 200
_IMAGES = ("rgb", "depth", "mask")


def task_settings(client: RoboPromptClient, task: str) -> dict[str, Any]:
    """Return the settings of the task.

    Raises:
        ServiceProblemError, ServiceUnreachableError.
    """
    document = client.get(f"/tasks/{task}")
    return {name: document[name] for name in TaskSettings.model_fields}


def episode_ids(client: RoboPromptClient, task: str, **only: bool) -> list[str]:
    """The ids of the task's episodes, oldest first; `left_out=False`: only those that prompts show.

    Raises:
        ServiceProblemError, ServiceUnreachableError.
    """
    return [item["id"] for item in paged_items(client, "/episodes", task=task, limit=PAGE, **only)][::-1]


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
                image = partial(client.get_bytes, f"{address}/images/{camera['name']}/{kind}", original=True)
                if (data := if_there(image)) is not None:
                    files[f"{kind}_{camera['name']}"] = data
        yield Parcel(metadata, files)


def export_data(
    task: Annotated[str, typer.Option(help="what to export")],
    archive: Annotated[Path | None, typer.Option(help="one file that `roboprompt import` reads, byte for byte")] = None,
    lerobot: Annotated[Path | None, typer.Option(help="folder of a LeRobot dataset, version 3.0")] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Export a task. Name --archive, --lerobot or both; none may exist yet."""
    console = Console(stderr=as_json)
    wanted = {"archive": archive, "lerobot": lerobot}
    targets = {name: path for name, path in wanted.items() if path is not None}
    if not targets:
        raise typer.BadParameter("name --archive, --lerobot or both", param_hint="--archive")
    with service_at(url) as client:
        client.ping()
        settings, ids = task_settings(client, task), episode_ids(client, task)
        writers: dict[str, Callable[[Path, Iterable[Parcel]], int]] = {
            "archive": lambda path, parcels: write_archive(path, task, settings, parcels),
            "lerobot": write_lerobot,
        }
        shown = episode_ids(client, task, left_out=False) if "lerobot" in targets else ids
        for name, path in targets.items():
            sent = shown if name == "lerobot" else ids  # policies are trained on what LeRobot reads
            parcels = counted(download(client, sent), len(sent), f"exporting to {name}", console)
            number = writers[name](path, parcels)
            out = f" without {len(ids) - number} that are left out of prompts" if number < len(ids) else ""
            console.print(f"{path}: {number} episodes of {task}{out}", markup=False, highlight=False, soft_wrap=True)
    if as_json:
        written = {name: str(path) for name, path in targets.items()}
        print(json.dumps({"task": task, "episodes": len(shown if targets.keys() == {"lerobot"} else ids), **written}))  # noqa: T201
