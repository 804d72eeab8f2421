"""`roboprompt backup` and `roboprompt restore`: everything that is stored in one file, and back."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.shared import EnvFile, opened_store

if TYPE_CHECKING:
    from app.store.backup import BackupSummary
    from app.store.store import Store

Data = Annotated[Path | None, typer.Option(help="folder of the database and images")]


def back_up(
    file: Annotated[Path, typer.Argument(help="the file to write; an existing one is replaced")],
    data: Data = None,
    env_file: EnvFile = None,
) -> None:
    """Write every task, episode, image and prediction to a file; the service may keep running."""
    from app.store.backup import back_up

    _run(data, env_file, lambda store: back_up(store, file))


def restore(
    file: Annotated[Path, typer.Argument(help="a backup", exists=True, dir_okay=False)],
    data: Data = None,
    with_keys: Annotated[
        bool, typer.Option("--with-keys", help="also restore its API keys, those revoked since then included")
    ] = False,
    env_file: EnvFile = None,
) -> None:
    """Put a backup into an empty store, of the same or another kind of database. Its API keys are left out."""
    from app.store.backup import restore

    _run(data, env_file, lambda store: restore(store, file, with_keys=with_keys))


def _run(data: Path | None, env_file: Path | None, work: "Callable[[Store], BackupSummary]") -> None:
    """Open the store that the settings name, do the work, and print what was done as one line of JSON."""
    with opened_store(data, env_file) as store:
        summary = work(store)
    print(json.dumps(asdict(summary)))  # noqa: T201
