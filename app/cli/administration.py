"""Administration of the store: `roboprompt keys add | list | revoke`, `backup`."""

from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from app.cli.shared import Data, EnvFile, opened_store
from app.services.api_keys import create_key
from app.store import api_keys, backup

keys = typer.Typer(no_args_is_help=True, help="API keys: add, list, revoke.")


@keys.command("add")
def add_key(
    name: Annotated[str, typer.Argument(help="whose key it is, e.g. robot-1")],
    scope: Annotated[str, typer.Option(help="read, predict, teach or admin; each includes those before it")],
    data: Data = None,
    env_file: EnvFile = None,
) -> None:
    """Make a key and print it: it is stored as a digest only, and cannot be printed again."""
    with opened_store(data, env_file) as store:
        typer.echo(create_key(store, name, scope))


@keys.command("list")
def list_keys(data: Data = None, env_file: EnvFile = None) -> None:
    """Print every key's id, name and scope, when it was made, and whether it is valid."""
    with opened_store(data, env_file) as store, store.read() as connection:
        for key in api_keys.list_all(connection):
            state = "valid" if key.revoked_at is None else f"revoked {_minute(key.revoked_at)}"
            typer.echo("  ".join((key.id, key.name, key.scope, _minute(key.created_at), state)))


@keys.command("revoke")
def revoke_key(
    key_id: Annotated[str, typer.Argument(help="as `list` prints it")], data: Data = None, env_file: EnvFile = None
) -> None:
    """Revoke a key; a running service refuses it within 5 seconds."""
    with opened_store(data, env_file) as store, store.write() as connection:
        api_keys.revoke(connection, key_id)


def _minute(moment: datetime) -> str:
    return f"{moment:%Y-%m-%d %H:%M}"


def back_up(
    file: Annotated[Path, typer.Argument(help="the .tar file to write; an existing one is replaced")],
    data: Data = None,
    env_file: EnvFile = None,
) -> None:
    """Write the data folder of one moment to a tar file; the service may keep running.

    `tar -xf FILE -C FOLDER` unpacks it into an empty folder, for `roboprompt serve --data FOLDER`.
    """
    with opened_store(data, env_file) as store:
        num_blobs = backup.back_up(store, file)
    typer.echo(f"{file}: the database and {num_blobs} images")
