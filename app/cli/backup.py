"""`roboprompt backup` and `roboprompt restore`: everything that is stored in one file, and back."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from app.pipeline.errors import RoboPromptError

if TYPE_CHECKING:
    from app.store.backup import BackupSummary
    from app.store.store import Store

Data = Annotated[Path | None, typer.Option(help="folder of the database and images")]


def back_up(
    file: Annotated[Path, typer.Argument(help="to write; a file of that name is replaced")], data: Data = None
) -> None:
    """Write every task, episode, image and prediction to a file; the service may go on meanwhile."""
    from app.store.backup import back_up

    _run(data, lambda store: back_up(store, file))


def restore(file: Annotated[Path, typer.Argument(help="a backup", exists=True)], data: Data = None) -> None:
    """Put a backup into an empty store, of the same or another kind of database."""
    from app.store.backup import restore

    _run(data, lambda store: restore(store, file))


def _run(data: Path | None, work: "Callable[[Store], BackupSummary]") -> None:
    """Open the store that the settings name, do the work, and print what was done as one line of JSON."""
    from app.bootstrap import open_store
    from app.settings import Settings

    try:
        store = open_store(Settings() if data is None else Settings(data=data))
        try:
            summary = work(store)
        finally:
            store.close()
    except RoboPromptError as error:
        Console(stderr=True).print(str(error), markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    print(json.dumps(asdict(summary)))  # noqa: T201
