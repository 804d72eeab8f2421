"""What a command checks before any work starts; each refusal names the option and what would be valid."""

from collections.abc import Collection, Sequence

import typer
from rich.console import Console

from app.client.client import DEFAULT_URL, RoboPromptClient
from app.client.errors import ServiceProblemError, ServiceUnreachableError

MAX_PORT = 65535
URL_HELP = "of the running service"


def check_names(option: str, given: Sequence[str], known: Collection[str]) -> None:
    """Refuse a name that is not known, naming those that are."""
    for name in given:
        if name not in known:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(known)}", param_hint=option)


def check_port(port: int) -> int:
    """The port, if it is one."""
    if not 1 <= port <= MAX_PORT:
        raise typer.BadParameter(f"{port} is no port (valid: 1 to {MAX_PORT})")
    return port


def check_models(names: Sequence[str], url: str | None = None) -> None:
    """Refuse a model that there is not, or that cannot be used here.

    Args:
        url: of the service that shall ask them; None: one of the command's own, with this environment's settings.
    """
    for name in dict.fromkeys(names):
        if (reason := _why_not(name) if url is None else _why_not_there(name, url)) is not None:
            raise typer.BadParameter(reason, param_hint="--model")


def check_service(url: str) -> None:
    """End the command with one line where nobody listens, or somebody else."""
    try:
        with RoboPromptClient(url) as client:
            client.ping()
    except (ServiceUnreachableError, ServiceProblemError) as error:
        Console(stderr=True).print(str(error), markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(1) from error


def the_url(url: str | None, server: str | None) -> str:
    """The service's address, by `--url` or by `--server`, as it was called once."""
    if url is not None and server is not None and url != server:
        raise typer.BadParameter("is another address than --url", param_hint="--server")
    return url or server or DEFAULT_URL


def _why_not(name: str) -> str | None:
    from app.bootstrap import llm_settings
    from app.llm.base import LanguageModelError
    from app.llm.registry import ModelRegistry
    from app.settings import Settings

    try:
        ModelRegistry(llm_settings(Settings())).profile(name)
    except LanguageModelError as error:
        return str(error)
    return None


def _why_not_there(name: str, url: str) -> str | None:
    """Backends take further names than the service lists, so that those are left to it."""
    with RoboPromptClient(url) as client:
        offered = {model["name"]: model for model in client.get("/models")["models"]}
    if name in offered:
        model = offered[name]
        return None if model["available"] else f"{name}: {model['reason']}"
    backend, slash, _ = name.partition("/")
    if slash and any(other.startswith(f"{backend}/") for other in offered):
        return None
    return f"there is no model {name!r}; there are {', '.join(offered)}"
