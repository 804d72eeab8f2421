"""`roboprompt export`: a task's episodes for other tools, or for another service."""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from app.cli.checks import URL_HELP, check_service, the_url
from app.cli.exporter import download, episode_ids, task_settings
from app.cli.progress import counted
from app.client.client import DEFAULT_URL, RoboPromptClient
from app.client.errors import ServiceProblemError, ServiceUnreachableError
from app.datasets.archive import write_archive
from app.datasets.bounds import DatasetError
from app.datasets.lerobot.writer import write_lerobot
from app.datasets.recording import Parcel
from app.datasets.rerun import write_rerun

Target = Annotated[Path | None, typer.Option()]


def export_data(
    task: Annotated[str, typer.Option(help="what to export")],
    archive: Annotated[Path | None, typer.Option(help="one file that `roboprompt import` reads, byte for byte")] = None,
    lerobot: Annotated[Path | None, typer.Option(help="folder of a LeRobot dataset, version 3.0")] = None,
    rerun: Annotated[Path | None, typer.Option(help=".rrd file for the rerun viewer (pip install rerun-sdk)")] = None,
    url: Annotated[str | None, typer.Option(help=f"{URL_HELP} [default: {DEFAULT_URL}]")] = None,
    server: Annotated[str | None, typer.Option(hidden=True)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object as the last line")] = False,
) -> None:
    """Export a task. Name at least one of --archive, --lerobot and --rerun; none may exist yet."""
    console = Console(stderr=as_json)
    wanted = {"archive": archive, "lerobot": lerobot, "rerun": rerun}
    targets = {name: path for name, path in wanted.items() if path is not None}
    if not targets:
        raise typer.BadParameter("name at least one of --archive, --lerobot, --rerun", param_hint="--archive")
    address = the_url(url, server)
    check_service(address)
    try:
        with RoboPromptClient(address) as client:
            settings, ids = task_settings(client, task), episode_ids(client, task)
            writers: dict[str, Callable[[Path, Iterable[Parcel]], int]] = {
                "archive": lambda path, parcels: write_archive(path, task, settings, parcels),
                "lerobot": write_lerobot,
                "rerun": write_rerun,
            }
            for name, path in targets.items():
                parcels = counted(download(client, ids), len(ids), f"exporting to {name}", console)
                number = writers[name](path, parcels)
                console.print(f"{path}: {number} episodes of {task}", markup=False, highlight=False, soft_wrap=True)
    except (DatasetError, ServiceProblemError, ServiceUnreachableError) as error:
        console.print(str(error), markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    if as_json:
        written = {name: str(path) for name, path in targets.items()}
        print(json.dumps({"task": task, "episodes": len(ids), **written}))  # noqa: T201
