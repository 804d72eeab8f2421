"""`roboprompt teach-objects`: colours and sizes from demonstrations, so that nobody types them in."""

import json
from typing import Annotated

import typer
from rich.console import Console

from app.cli.shared import URL_HELP, check_service
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.errors import ServiceProblemError, ServiceUnreachableError


def teach_objects(
    task: Annotated[str, typer.Argument(help="a task with labelled episodes: RGB-D images with masks or poses")],
    url: Annotated[str, typer.Option(help=URL_HELP)] = DEFAULT_URL,
    episodes: Annotated[int, typer.Option(min=1, max=100, help="learn from at most so many, the task's first")] = 10,
    objects: Annotated[list[str] | None, typer.Option("--object", help="may be repeated; default: all")] = None,
) -> None:
    """Let the service learn what a task's objects look like; from then on it finds them in images.

    Prints the learned object models as JSON, and of the objects that cannot be learned the reason.
    """
    console = Console(stderr=True)
    check_service(url)
    try:
        with RoboPromptClient(url) as client:
            learned = client.learn_object_models(task, objects, episodes)
    except (ServiceProblemError, ServiceUnreachableError) as error:
        console.print(str(error), markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    for name, reason in learned["refused"].items():
        console.print(f"{name}: {reason}", markup=False, soft_wrap=True)
    print(json.dumps(learned))  # noqa: T201
    if not learned["object_models"]:
        raise typer.Exit(1)
