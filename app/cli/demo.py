"""`roboprompt demo`: teach the service tasks on a simulated arm, then test what it learned."""

import json
import os
import shlex
import shutil
import sys
import tempfile
import threading
import time
import webbrowser
from contextlib import closing, suppress
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console

from app.cli.shared import AsJson, check_models, check_names, progress_bars
from app.evaluation.ledger import Ledger
from app.evaluation.methods import methods_beside, with_poses
from app.evaluation.plan import Plan, evaluation_of
from app.evaluation.results import Evaluation
from app.evaluation.run import PlanRun, executor_of
from app.evaluation.server import running_server, service
from app.evaluation.tables import results_table, sweep_summary
from app.sim.tasks import TASKS
from app.sim.world import BASE_POSITION_M

DEMO_TASKS = ("push_button", "stack_cube", "open_drawer")


def demo(
    task: Annotated[list[str] | None, typer.Option(help="may be repeated")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="unseen scenes a task")] = 10,
    demos: Annotated[int, typer.Option(min=1, help="demonstrations a task")] = 10,
    model: Annotated[str | None, typer.Option(help="a name from GET /models; default: the service's")] = None,
    poses: Annotated[
        Literal["given", "vision"], typer.Option(help="vision: images only, by object models learned beforehand")
    ] = "given",
    compare: Annotated[
        bool, typer.Option(help="also a regression, the expert's replay and, with --model, the paper's format")
    ] = True,
    data: Annotated[
        Path | None, typer.Option(help="folder of the service, which is kept (default: reports/demo-TIME)")
    ] = None,
    open_pages: Annotated[
        bool, typer.Option("--open", help="then serve its pages, and show them where there is a browser, until Ctrl-C")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Record demonstrations on a simulated Panda, upload them, then predict and execute on unseen scenes.

    Starts the real service on a free port, with its embedded LLM. Its pages show each prompt, reply and scene.
    """
    check_names("--task", task or (), TASKS)
    check_models([] if model is None else [model])
    data = data or Path("reports") / f"demo-{datetime.now():%Y%m%d-%H%M%S}"
    if data.exists():
        raise typer.BadParameter(f"{data} exists (valid: a new folder)", param_hint="--data")
    console = Console(stderr=as_json)
    command = shlex.join(["roboprompt", *sys.argv[1:]])
    methods = with_poses(methods_beside(model)[: None if compare else 1], poses)
    arm = {"arm": "panda", "robot_base": BASE_POSITION_M}
    plan = Plan(tuple(task or DEMO_TASKS), methods, episodes, demos, command, images=True, settings=arm)
    started_s = time.monotonic()
    evaluation = _evaluation(plan, data, console)
    duration_s = time.monotonic() - started_s
    console.print(results_table(evaluation))
    for message, number in evaluation.errors():
        console.print(f"{number} trials could not be run: {message}", markup=False)
    console.print(f"{duration_s:.0f} s in all")
    if not open_pages:
        serve = _shell_command("serve", "--data", str(data.resolve()))
        console.print(f"Prompts, replies and scenes at http://127.0.0.1:8000/: {serve}", soft_wrap=True)
    if as_json:
        run = {"command": command, "duration_s": round(duration_s, 1), "data": str(data)}
        print(json.dumps({**run, **sweep_summary(evaluation)}))  # noqa: T201
    if open_pages:
        _show_pages(data, console)


def _evaluation(plan: Plan, data: Path, console: Console) -> Evaluation:
    """Run the plan on a new service whose folder `data` is kept."""
    with (
        tempfile.TemporaryDirectory(prefix="roboprompt-") as folder,
        Ledger(Path(folder) / "results.jsonl") as ledger,
        closing(executor_of(plan.world)) as executor,
        service(warm_up=plan.asks_default_model, data=data) as client,
        progress_bars(console) as progress,
    ):
        PlanRun(plan, ledger, client, executor, progress)()
        return evaluation_of(plan, ledger)


def _show_pages(data: Path, console: Console) -> None:
    """Serve the pages until Ctrl-C."""
    with running_server(data) as url, suppress(KeyboardInterrupt):
        console.print(f"Pages: {url}/ (Ctrl-C ends it)", soft_wrap=True)
        if sys.platform == "darwin" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
            webbrowser.open(url)  # elsewhere it might start one that takes over the terminal
        threading.Event().wait()


def _shell_command(*arguments: str) -> str:
    """Return a command that works in any shell: `roboprompt` alone needs an active environment."""
    program = shutil.which(sys.argv[0])
    started = [sys.executable, "-P", "-m", "app.cli"] if program is None else [str(Path(program).absolute())]
    return shlex.join([*started, *arguments])
