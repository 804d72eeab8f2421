"""`roboprompt keys create | list | revoke`: who may use the service."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli.opened_store import EnvFile, opened_store

application = typer.Typer(no_args_is_help=True, help="API keys: create, list, revoke.")
Data = Annotated[Path | None, typer.Option(help="folder of the database; default: ROBOPROMPT_DATA")]


@application.command()
def create(
    name: Annotated[str, typer.Argument(help="whose key it is, e.g. robot-1")],
    scope: Annotated[list[str], typer.Option(help="read, upload, predict or admin; may be repeated")],
    data: Data = None,
    env_file: EnvFile = None,
) -> None:
    """Make a key and print it: it is stored as a digest only, and cannot be printed again."""
    from app.services.api_keys import create_key

    with opened_store(data, env_file) as store:
        typer.echo(create_key(store, name, scope))


@application.command("list")
def list_keys(data: Data = None, env_file: EnvFile = None) -> None:
    """Print every key's id, name, scopes and dates."""
    from app.store import api_keys

    with opened_store(data, env_file) as store, store.read() as connection:
        for key in api_keys.list_all(connection):
            revoked = f"revoked {key.revoked_at:%Y-%m-%d %H:%M}" if key.revoked_at else "valid"
            typer.echo(f"{key.id}  {key.name}  {','.join(key.scopes)}  {key.created_at:%Y-%m-%d %H:%M}  {revoked}")


@application.command()
def revoke(
    key_id: Annotated[str, typer.Argument(help="as `list` prints it")], data: Data = None, env_file: EnvFile = None
) -> None:
    """Take a key back; a running service refuses it within 5 seconds."""
    from app.store import api_keys

    with opened_store(data, env_file) as store, store.write() as connection:
        api_keys.revoke(connection, key_id)
