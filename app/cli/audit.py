"""`roboprompt audit`: the audit log, and whether it is intact."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from app.cli.shared import EnvFile, opened_store
from app.store import audit as log


def audit(
    data: Annotated[Path | None, typer.Option(help="folder of the database; default: ROBOPROMPT_DATA")] = None,
    env_file: EnvFile = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object a line")] = False,
    holds: Annotated[
        str | None, typer.Option(help="digest of an entry that was noted down: the log must still have it")
    ] = None,
) -> None:
    """Print the audit log, oldest first, and verify that no entry was changed, removed or inserted.

    The exit status is 1 if one was, and the first such entry is named. What was cut off at the end shows only by a
    digest that was kept elsewhere: --holds.
    """
    found = holds is None
    newest = log.FIRST
    number = 0
    with opened_store(data, env_file) as store, store.read() as connection:
        try:
            for entry in log.verified(log.entries(connection)):
                typer.echo(json.dumps({**asdict(entry), "at": entry.at.isoformat()}) if as_json else _line(entry))
                found = found or entry.digest == holds
                newest, number = entry.digest, entry.number
        except log.BrokenChainError as error:
            typer.echo(f"the log was changed: {error}", err=True)
            raise typer.Exit(1) from None
    if not found:
        typer.echo(f"the log was cut off or replaced: no entry has the digest {holds}", err=True)
        raise typer.Exit(1)
    typer.echo(f"{number} entries, unbroken; digest of the newest: {newest}", err=True)


def _line(entry: log.AuditEntry) -> str:
    who_what = "".join(
        sign if sign.isprintable() else "?" for sign in f"{entry.actor}  {entry.action}  {entry.subject}"
    )
    return f"{entry.number}  {entry.at:%Y-%m-%d %H:%M:%S}  {who_what}  {entry.details}"
