"""`roboprompt doctor`: what is missing or wrong on this machine, and how to mend it."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from app.cli.shared import DOT_ENV, EnvFile, check_port
from roboprompt_client.version import VERSION

COLORS = {"ok": "green", "missing": "yellow", "wrong": "yellow"}


def doctor(
    port: Annotated[int, typer.Option(callback=check_port, help="that `roboprompt serve` is to listen on")] = 8000,
    data: Annotated[Path | None, typer.Option(help="folder of the database and images")] = None,
    env_file: EnvFile = None,
) -> None:
    """Look at what RoboPrompt needs on this machine; nothing is changed but the cache of weights.

    The exit status is 1 where something fails that `roboprompt serve` needs.
    """
    from app.cli.doctor_machine import look_at_machine
    from app.cli.doctor_service import look_at_service
    from app.settings import load_env_file

    if env_file is not None:
        load_env_file(env_file)
    console = Console()
    python = ".".join(map(str, sys.version_info[:3]))
    console.print(f"RoboPrompt {VERSION}, Python {python}, {sys.platform}", highlight=False)
    table = Table(box=None, pad_edge=False)
    for name in ("", "needed", "state", "what was seen, and what to do"):
        table.add_column(name, overflow="fold")
    failed = 0
    for row in (*look_at_service(data), *look_at_machine(port)):
        fails = row.required and row.state != "ok"
        failed += fails
        color = "red" if fails else COLORS[row.state]
        said = row.seen if row.state == "ok" else f"{row.seen}\n-> {row.remedy}"
        needed = "yes" if row.required else "no"
        table.add_row(escape(row.name), needed, f"[{color}]{row.state}[/]", escape(said))
    console.print(table)
    if DOT_ENV.is_file() and env_file is None:
        console.print("The file .env in this folder is not read: if it is yours, say --env-file .env")
    if failed:
        console.print(f"{failed} needed {'thing is' if failed == 1 else 'things are'} missing or wrong.")
        raise typer.Exit(1)
