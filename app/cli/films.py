"""`roboprompt films`: what the simulated tasks look like."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from app.cli.checks import check_names


def films(
    out: Annotated[Path, typer.Option(help="folder of the page and its pictures")] = Path("docs/tasks"),
    task: Annotated[list[str] | None, typer.Option(help="may be repeated; default: all")] = None,
    seed: Annotated[int, typer.Option(min=0, help="of the scenes")] = 0,
) -> None:
    """Make a film strip of every task's expert, and a page of them."""
    # The simulator is an extra that `roboprompt serve` does without.
    from app.evaluation.task_pages import film_task, write_page
    from app.sim.tasks import TASKS

    check_names("--task", task or (), TASKS)
    console, made, failed = Console(), [], []
    for name in task or TASKS:
        film = film_task(name, seed, out)
        made.append(film)
        if not film.recorded.succeeded:
            failed.append(name)
        console.print(f"{name}: {film.recorded.failure or 'solved'}", markup=False)
    console.print(f"page: {write_page(made, seed, out)}", markup=False)
    if failed:
        raise typer.Exit(1)
