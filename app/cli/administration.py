"""Administration of the store: `roboprompt keys add | list | revoke`, `backup`."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated

import typer

from app.cli.shared import Data, EnvFile, opened_store
from app.services.api_keys import create_key
from app.store import api_keys, backup

keys = typer.Typer(no_args_is_help=True, help="API keys: add, list, revoke.")
_PERIOD = re.compile(r"(\d{1,5})([hdw])", re.ASCII)
_UNITS = {"h": timedelta(hours=1), "d": timedelta(days=1), "w": timedelta(weeks=1)}
_EXPIRES = "30d, 12h or 2w from now, or an ISO date or time such as 2027-01-31 or 2027-01-31T18:00+01:00"


def expiry(text: str, now: datetime) -> datetime:
    """Return the time that `30d` (from `now`) or an ISO date or time means; UTC if it names no zone.

    Raises:
        typer.BadParameter: if it is neither.
    """
    try:
        if match := _PERIOD.fullmatch(text.strip()):
            return now + int(match[1]) * _UNITS[match[2]]
        moment = datetime.fromisoformat(text.strip())
        return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    except (ValueError, OverflowError):
        raise typer.BadParameter(f"{text!r} is not a time, expected {_EXPIRES}") from None


@keys.command("add")
def add_key(
    name: Annotated[str, typer.Argument(help="whose key it is, e.g. robot-1")],
    scope: Annotated[list[str], typer.Option(help="read, upload, predict or admin; may be repeated")],
    task: Annotated[
        list[str] | None, typer.Option(help="only for this task; may be repeated; default: for all")
    ] = None,
    expires: Annotated[str | None, typer.Option(help=f"{_EXPIRES} (a date: as it begins, UTC); default: never")] = None,
    data: Data = None,
    env_file: EnvFile = None,
) -> None:
    """Make a key and print it: it is stored as a digest only, and cannot be printed again."""
    expires_at = None if expires is None else expiry(expires, datetime.now(UTC))
    with opened_store(data, env_file) as store:
        typer.echo(create_key(store, name, scope, task, expires_at))


@keys.command("list")
def list_keys(data: Data = None, env_file: EnvFile = None) -> None:
    """Print every key's id, name, scopes, tasks, when it was made, whether it is valid, and when it was last used."""
    with opened_store(data, env_file) as store, store.read() as connection:
        for key in api_keys.list_all(connection):
            tasks = "all tasks" if key.tasks is None else f"only {', '.join(key.tasks)}"
            used = "never used" if key.last_used_at is None else f"last used {_minute(key.last_used_at)}"
            made, state = _minute(key.created_at), _state(key, datetime.now(UTC))
            typer.echo("  ".join((key.id, key.name, ",".join(key.scopes), tasks, made, state, used)))


@keys.command("revoke")
def revoke_key(
    key_id: Annotated[str, typer.Argument(help="as `list` prints it")], data: Data = None, env_file: EnvFile = None
) -> None:
    """Revoke a key; a running service refuses it within 5 seconds, and ends its browsers' sessions at once."""
    with opened_store(data, env_file) as store, store.write() as connection:
        api_keys.revoke(connection, key_id)


def _state(key: api_keys.ApiKeyRecord, now: datetime) -> str:
    if key.revoked_at is not None:
        return f"revoked {_minute(key.revoked_at)}"
    if key.expires_at is None:
        return "valid"
    return f"{'expired' if key.expires_at <= now else 'valid until'} {_minute(key.expires_at)}"


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
