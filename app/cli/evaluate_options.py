"""The options of `roboprompt eval`, each in one place: its name, type, help and default."""

import shlex
import sys
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import typer

SWEEP_NAMES = (
    "main, formats, keyframes, demonstrations, selection, system_prompts, noise, poses, experts, models,"
    " moving, outside, composition"
)
METHOD_NAMES = "default, nearest, regression, sums, replay, expert"
OUTSIDE = "outside"
EPISODES = 25
Option = typer.Option


@dataclass(frozen=True)
class EvaluateOptions:
    """What the command line says."""

    sweep: Annotated[str | None, Option(help=f"{SWEEP_NAMES}; default: main, with --world outside")] = None
    task: Annotated[list[str] | None, Option(help="may be repeated; default: all of the sweep")] = None
    episodes: Annotated[int, Option(min=1, help="unseen scenes per task")] = EPISODES
    demos: Annotated[int, Option(min=1, max=100, help="demonstrations in a prompt")] = 10
    model: Annotated[
        list[str] | None, Option(help="a name from GET /models; may be repeated; default: the service's")
    ] = None
    poses: Annotated[
        Literal["given", "vision"], Option(help="vision: images only, by object models learned beforehand")
    ] = "given"
    cameras: Annotated[int, Option(min=1, max=3, help="that take images, of the simulated Panda")] = 2
    method: Annotated[
        list[str] | None,
        Option(help=f"a label of the sweep, or one of {METHOD_NAMES}; may be repeated; default: all of the sweep"),
    ] = None
    recordings: Annotated[
        Literal["rests", "continuous"],
        Option(help="demonstrations that rest at every pose, or pass them as a person does"),
    ] = "rests"
    record_hz: Annotated[
        float | None, Option(min=1, help="rate of the recordings (default: 20; of another world: its own)")
    ] = None
    world: Annotated[
        str | None,
        Option(help="module with a WORLD, e.g. benchmarks.metaworld.world; default: the simulated Panda"),
    ] = None
    settings: Annotated[
        str | None, Option(help='JSON for PUT /tasks of every task, e.g. {"keyframes": {"rule": "merged"}}')
    ] = None
    seed: Annotated[
        int | None,
        Option(
            min=0,
            help="of the first unseen scene, others follow (default: 100000; of another world: its own). Other seeds"
            " give other scenes than the published ones. Demonstrations keep their seeds, 0, 1, 2, ..., but for those"
            " that are tested",
        ),
    ] = None
    noise: Annotated[
        float | None,
        Option(min=0, help="on given poses, in multiples of 1.68 cm and 4.61 degrees; default: the sweep's own"),
    ] = None
    noise_on: Annotated[
        Literal["both", "test"], Option(help="noise on demonstrations and tests, or on tests alone")
    ] = "both"
    shift: Annotated[
        float | None,
        Option(
            help="meters: move the free objects after the answer, and test with and without looking again"
            " (methods `default` and `look again`; default: they stay)"
        ),
    ] = None
    out: Annotated[Path | None, Option(help="folder of the results (default: reports/eval-SWEEP-TIME)")] = None
    url: Annotated[str | None, Option(help="of a running service, instead of one of its own")] = None
    report: Annotated[bool, Option(help="a page with prompt, reply and pictures of failures")] = True
    as_json: Annotated[bool, Option("--json", help="one JSON object as the last line")] = False

    @property
    def sweep_name(self) -> str:
        """The sweep that is asked for, or that suits the world."""
        return self.sweep or ("main" if self.world is None else OUTSIDE)

    @cached_property
    def folder(self) -> Path:
        """Where results go."""
        return self.out or Path("reports") / f"eval-{self.sweep_name}-{datetime.now():%Y%m%d-%H%M%S}"

    @property
    def command(self) -> str:
        """The command line that continues the run."""
        return shlex.join(["roboprompt", *sys.argv[1:], *([] if self.out else ["--out", str(self.folder)])])
