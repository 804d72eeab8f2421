"""The store that the settings name, for a command."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from app.pipeline.errors import RoboPromptError
from app.settings import Settings, load_env_file
from app.store.store import Store

DOT_ENV = Path(".env")
EnvFile = Annotated[
    Path | None,
    typer.Option(
        exists=True, dir_okay=False, help="lines NAME=VALUE of settings; what the environment says goes first"
    ),
]


def settings_of(data: Path | None, env_file: Path | None) -> Settings:
    """The settings of the environment and of the file, if one is named.

    Args:
        data: instead of the data folder that they name.
    """
    if env_file is not None:
        load_env_file(env_file)
    elif DOT_ENV.is_file():  # whoever relies on it must learn that it has no effect
        typer.echo("the file .env in this folder is not read: if it is yours, say --env-file .env", err=True)
    return Settings() if data is None else Settings(data=data)


@contextmanager
def opened_store(data: Path | None, env_file: Path | None) -> Iterator[Store]:
    """The store; what it refuses is said in a sentence, and the exit status is 1."""
    from app.bootstrap import open_store

    try:
        store = open_store(settings_of(data, env_file))
        try:
            yield store
        finally:
            store.close()
    except RoboPromptError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from None
