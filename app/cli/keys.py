"""`roboprompt keys add | list | revoke`: who may use the service."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.shared import EnvFile, opened_store

if TYPE_CHECKING:
    from app.store.api_keys import ApiKeyRecord

application = typer.Typer(no_args_is_help=True, help="API keys: add, list, revoke.")
Data = Annotated[Path | None, typer.Option(help="folder of the database; default: ROBOPROMPT_DATA")]
_PERIOD = re.compile(r"(\d{1,5})([hdw])", re.ASCII)
_UNITS = {"h": timedelta(hours=1), "d": timedelta(days=1), "w": timedelta(weeks=1)}
_EXPIRES = "30d, 12h or 2w from now, or an ISO date or time such as 2027-01-31 or 2027-01-31T18:00+01:00"


def expiry(text: str, now: datetime) -> datetime:
    """The moment that `30d` from `now`, or an ISO date or time, stands for; UTC where it names no zone.

    Raises:
        typer.BadParameter: if it is neither.
    """
    try:
        if match := _PERIOD.fullmatch(text.strip()):
            return now + int(match[1]) * _UNITS[match[2]]
        moment = datetime.fromisoformat(text.strip())
        return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    except (ValueError, OverflowError):
        raise typer.BadParameter(f"{text!r} is no time, expected {_EXPIRES}") from None


@application.command("add")
def add(
    name: Annotated[str, typer.Argument(help="whose key it is, e.g. robot-1")],
    scope: Annotated[list[str], typer.Option(help="read, upload, predict, operate or admin; may be repeated")],
    task: Annotated[
        list[str] | None, typer.Option(help="only for this task; may be repeated; default: for all")
    ] = None,
    expires: Annotated[str | None, typer.Option(help=f"{_EXPIRES} (a date: as it begins, UTC); default: never")] = None,
    data: Data = None,
    env_file: EnvFile = None,
) -> None:
    """Make a key and print it: it is stored as a digest only, and cannot be printed again."""
    from app.services.api_keys import create_key

    expires_at = None if expires is None else expiry(expires, datetime.now(UTC))
    with opened_store(data, env_file) as store:
        typer.echo(create_key(store, name, scope, task, expires_at))


@application.command("list")
def list_keys(data: Data = None, env_file: EnvFile = None) -> None:
    """Print every key's id, name, scopes, tasks, when it was made, whether it is valid, and when it was last used."""
    from app.store import api_keys

    with opened_store(data, env_file) as store, store.read() as connection:
        for key in api_keys.list_all(connection):
            typer.echo(_line(key, datetime.now(UTC)))


@application.command()
def revoke(
    key_id: Annotated[str, typer.Argument(help="as `list` prints it")], data: Data = None, env_file: EnvFile = None
) -> None:
    """Revoke a key; a running service refuses it within 5 seconds, and ends its browsers' sessions at once."""
    from app.store import api_keys

    with opened_store(data, env_file) as store, store.write() as connection:
        api_keys.revoke(connection, key_id)


def _line(key: "ApiKeyRecord", now: datetime) -> str:
    tasks = "all tasks" if key.tasks is None else f"only {', '.join(key.tasks)}"
    used = "never used" if key.last_used_at is None else f"last used {_minute(key.last_used_at)}"
    return "  ".join((key.id, key.name, ",".join(key.scopes), tasks, _minute(key.created_at), _state(key, now), used))


def _state(key: "ApiKeyRecord", now: datetime) -> str:
    if key.revoked_at is not None:
        return f"revoked {_minute(key.revoked_at)}"
    if key.expires_at is None:
        return "valid"
    return f"{'expired' if key.expires_at <= now else 'valid until'} {_minute(key.expires_at)}"


def _minute(moment: datetime) -> str:
    return f"{moment:%Y-%m-%d %H:%M}"
