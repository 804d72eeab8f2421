"""Shared by commands: checks before any work starts, store and service, a progress bar, the distribution's extras.

Each refusal names the option and what would be valid.
"""

import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from importlib.metadata import PackageNotFoundError, distribution, requires
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from app.settings import Settings, load_env_file
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import RoboPromptError, ServiceProblemError
from roboprompt_client.http import MAX_PORT

if TYPE_CHECKING:
    from app.store.store import Store

INTERRUPTED = 130  # the exit status of a program that Ctrl-C ended
DOT_ENV = Path(".env")
Url = Annotated[str, typer.Option(help="address of the running service")]
Data = Annotated[Path | None, typer.Option(help="folder of the database and images; default: ROBOPROMPT_DATA")]
AsJson = Annotated[bool, typer.Option("--json", help="one JSON object as the last line")]
EnvFile = Annotated[
    Path | None,
    typer.Option(exists=True, dir_okay=False, help="lines NAME=VALUE of settings; the environment overrides them"),
]
T = TypeVar("T")
REQUIREMENT = re.compile(r"([\w.-]+)[^;]*;.*extra == ['\"]([\w-]+)['\"]")
PACE_S = 60.0


def check_names(option: str, given: Sequence[str], known: Collection[str]) -> None:
    """Refuse a name that is not known, naming those that are."""
    for name in given:
        if name not in known:
            raise typer.BadParameter(f"{name!r} is not one of {', '.join(known)}", param_hint=option)


def check_port(port: int) -> int:
    """Return the port, or refuse it."""
    if not 1 <= port <= MAX_PORT:
        raise typer.BadParameter(f"{port} is not a port (valid: 1 to {MAX_PORT})")
    return port


def check_models(names: Sequence[str]) -> None:
    """Refuse a model that does not exist or cannot be used here, with this environment's settings."""
    from app.llm.base import LanguageModelError
    from app.llm.registry import ModelRegistry

    registry = ModelRegistry(Settings())
    for name in dict.fromkeys(names):
        try:
            registry.profile(name)
        except LanguageModelError as error:
            raise typer.BadParameter(str(error), param_hint="--model") from error


@contextmanager
def service_at(url: str) -> Iterator[RoboPromptClient]:
    """Yield a client of the service. An error inside is printed in a sentence, and the exit status is 1."""
    with errors_printed(), RoboPromptClient(url) as client:
        yield client


def if_there(asked: Callable[[], T]) -> T | None:
    """Return the service's answer, or None if it is 404."""
    try:
        return asked()
    except ServiceProblemError as error:
        if error.status == 404:
            return None
        raise


def paged_items(client: RoboPromptClient, path: str, **query: object) -> Iterator[dict[str, Any]]:
    """Yield every item of a list that has pages; None in the query is left out."""
    asked = {name: value for name, value in query.items() if value is not None}
    while True:
        page = client.get(path, **asked)
        yield from page[path.removeprefix("/")]
        if page["next_cursor"] is None:
            return
        asked["cursor"] = page["next_cursor"]


def settings_of(data: Path | None, env_file: Path | None) -> Settings:
    """The settings of the environment and of the file, if one is named.

    Args:
        data: instead of the data folder that they name.
    """
    if env_file is not None:
        load_env_file(env_file)
    elif DOT_ENV.is_file():  # a user who relies on it must learn that it has no effect
        typer.echo("the file .env in this folder is not read: if it is yours, say --env-file .env", err=True)
    return Settings() if data is None else Settings(data=data)


@contextmanager
def errors_printed() -> Iterator[None]:
    """Print an error inside in a sentence, and exit with status 1."""
    try:
        yield
    except (RoboPromptError, OSError) as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(1) from None


@contextmanager
def opened_store(data: Path | None, env_file: Path | None) -> "Iterator[Store]":
    """Yield the store. An error inside is printed in a sentence, and the exit status is 1."""
    from app.bootstrap import open_store

    with errors_printed(), closing(open_store(settings_of(data, env_file))) as store:
        yield store


def progress_bars(console: Console, pace_s: float = PACE_S) -> Progress:
    """Return progress bars whose time left follows from the pace of the last `pace_s` seconds."""
    described = TextColumn("{task.description:<30}")
    columns = (described, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    return Progress(*columns, console=console, speed_estimate_period=pace_s)


def counted(items: Iterable[T], total: int, doing: str, console: Console) -> Iterator[T]:
    """Yield the items while a progress bar counts them."""
    with progress_bars(console) as progress:
        bar = progress.add_task(doing, total=total)
        for item in items:
            yield item
            progress.advance(bar)


def packages_of_extras() -> Mapping[str, list[str]]:
    """The packages that each extra installs; empty where RoboPrompt runs from a folder, without being installed."""
    found: dict[str, list[str]] = defaultdict(list)
    try:
        lines = requires("roboprompt") or []
    except PackageNotFoundError:
        return found
    for package, extra in (match.groups() for line in lines if (match := REQUIREMENT.match(line))):
        found[extra].append(package)
    return found


def is_installed(package: str) -> bool:
    """Whether a distribution of this name is installed."""
    try:
        distribution(package)
    except PackageNotFoundError:
        return False
    return True


def extra_with(module: str) -> str | None:
    """Return the extra that installs a module, or None."""
    package = module.partition(".")[0].replace("_", "-")
    return next((extra for extra, packages in packages_of_extras().items() if package in packages), None)
