"""`roboprompt record`: a demonstration by hand, with the keys of the terminal and the simulated arm."""

import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.live import Live
from rich.table import Table

from app.cli.shared import URL_HELP, check_names, check_service
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.errors import ServiceUnreachableError
from roboprompt_client.recording.spool import Spool
from roboprompt_client.recording.teleop import MOVES, has_keyboard, keyboard
from roboprompt_client.robot import Observation

if TYPE_CHECKING:
    from app.sim.jog import JoggedPanda

RATE_HZ = 20.0
SHOWN_HZ = 10


def record(
    task: Annotated[str, typer.Option(help="a simulated task")] = "push_button",
    seed: Annotated[int, typer.Option(min=0, help="of the scene")] = 0,
    name: Annotated[str | None, typer.Option(help="of the task at the service; default: the simulated task's")] = None,
    url: Annotated[str, typer.Option(help=URL_HELP)] = DEFAULT_URL,
    spool: Annotated[Path, typer.Option(help="folder of recordings not yet uploaded")] = Path("recordings"),
) -> None:
    """Make a demonstration by hand: move the simulated Panda with the keyboard, and upload what it did.

    A key moves the hand while it is held. There is no picture: the table says where the objects are from the hand.
    """
    # The simulator is an extra that `roboprompt serve` does without.
    from app.sim.jog import JoggedPanda, drive
    from app.sim.sampler import TrajectorySampler
    from app.sim.tasks import TASKS, make_task

    check_names("--task", [task], TASKS)
    if not has_keyboard():
        raise typer.BadParameter("the keys come from a terminal of Linux or macOS, and standard input is none")
    check_service(url)
    recordings = _opened(spool)
    scene, console = make_task(task, seed), Console()
    arm, seen, recorders = JoggedPanda(scene), Observation(scene.object_poses()), []

    def begin() -> None:
        recorders.append(TrajectorySampler(arm, RATE_HZ))

    console.print(f"[bold]{scene.instruction}[/]\n{MOVES}   space: gripper   Enter: keep   x: give up")
    with keyboard() as pressed, Live(console=console, refresh_per_second=SHOWN_HZ) as live:
        kept = drive(arm, partial(pressed, 0.0), begin, _Pace(arm, live))
    console.print("solved" if scene.succeeded() else "not solved")
    if kept and recorders:
        folder = recordings.keep(
            name or task,
            scene.instruction,
            seen,
            recorders[0].trajectory("measured"),
            control_frequency_hz=RATE_HZ,
            extra={"seed": seed, "simulator": "mujoco", "by": "keyboard"},
        )
        _upload(url, recordings, folder)


class _Pace:
    """Keeps simulated time in step with the clock, and the table up to date."""

    def __init__(self, arm: "JoggedPanda", live: Live) -> None:
        self._arm, self._live = arm, live
        self._began_s, self._shown_s = time.monotonic() - arm.task.data.time, 0.0

    def __call__(self) -> None:
        now_s = float(self._arm.task.data.time)
        if now_s - self._shown_s > 1 / SHOWN_HZ:
            self._shown_s = now_s
            self._live.update(_table(self._arm))
        time.sleep(max(0.0, self._began_s + now_s - time.monotonic()))


def _table(arm: "JoggedPanda") -> Table:
    state = "open" if arm.gripper_commanded_open else "closed"
    table = Table("from the hand, cm", "away", "left", "up", title=f"gripper {state}", title_justify="left")
    for pose in arm.task.object_poses():
        table.add_row(pose.name, *(f"{100 * value:+.1f}" for value in pose.position_m - arm.hand.position_m))
    return table


def _opened(folder: Path) -> Spool:
    """Before anything is recorded, which could not be kept."""
    try:
        return Spool(folder)
    except OSError as error:
        raise typer.BadParameter(f"{error} (valid: a folder that can be written)", param_hint="--spool") from error


def _upload(url: str, spool: Spool, folder: Path) -> None:
    """Send what the spool keeps in `folder`; it stays there until the service has stored it."""
    errors = Console(stderr=True)
    try:
        with RoboPromptClient(url) as client:
            sent = spool.send(client, folder)
    except ServiceUnreachableError as error:
        later = f"roboprompt-robot --url {url} record --send-only --spool {folder.parent}"
        errors.print(f"{error}; kept in {folder}, to be uploaded by: {later}", markup=False, soft_wrap=True)
        raise typer.Exit(1) from error
    answer = sent.answer
    if not sent.stored:
        reason = answer.get("detail", answer.get("title"))
        errors.print(f"refused: {reason}; kept in {folder}", markup=False, soft_wrap=True)
        raise typer.Exit(1)
    spool.discard(folder)
    print(f"stored as {answer['id']}: {len(answer['keyframes'])} keyframes")  # noqa: T201
    for finding in answer["findings"]:
        print(f"  {finding['severity']} {finding['code']}: {finding['message']}")  # noqa: T201
