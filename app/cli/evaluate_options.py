"""The options of `roboprompt eval`."""

from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import typer

SWEEP_NAMES = (
    "main, formats, keyframes, demonstrations, selection, system_prompts, noise, poses, experts, loop, models,"
    " unseen, moving, composition, paper"
)
METHOD_NAMES = "default, nearest, regression, replay, expert, voxposer, voxposer-oracle"
TABLE_NAMES = "I, II, III, IV, 3a, 3b, 3c, 4a, 4b, 4c"
PAPER = "paper"
EPISODES = 25

Sweep = Annotated[str, typer.Option(help=SWEEP_NAMES)]
Tasks = Annotated[list[str] | None, typer.Option(help="may be repeated; default: all of the sweep")]
Episodes = Annotated[
    int | None, typer.Option(min=1, help="unseen scenes a task (default: 25; of --sweep paper: as in its tables)")
]
Demos = Annotated[int, typer.Option(min=1, max=100, help="demonstrations in a prompt")]
Models = Annotated[
    list[str] | None, typer.Option(help="a name from GET /models; may be repeated; default: the service's")
]
Poses = Annotated[
    Literal["given", "vision"], typer.Option(help="vision: images only, by object models learned beforehand")
]
Methods = Annotated[
    list[str] | None,
    typer.Option(help=f"a label of the sweep, or one of {METHOD_NAMES}; may be repeated; default: all of the sweep"),
]
Recordings = Annotated[
    Literal["rests", "continuous"],
    typer.Option(help="demonstrations that rest at every pose, or pass them as a person does"),
]
Seed = Annotated[
    int,
    typer.Option(
        min=0,
        help="of the first unseen scene, others follow: other than 100000 gives other scenes than the published"
        " ones. Demonstrations keep their seeds, 0, 1, 2, ..., but for those that are tested",
    ),
]
Noise = Annotated[
    float | None,
    typer.Option(min=0, help="on given poses, in multiples of 1.68 cm and 4.61 degrees; default: the sweep's own"),
]
NoiseOn = Annotated[Literal["both", "test"], typer.Option(help="noise on demonstrations and tests, or on tests alone")]
Shift = Annotated[
    float | None,
    typer.Option(
        help="metres: move the free objects after the answer, and test with and without looking again"
        " (methods `default` and `look again`; default: nobody moves anything)"
    ),
]
Out = Annotated[Path | None, typer.Option(help="folder of the results (default: reports/eval-SWEEP-TIME)")]
Ray = Annotated[
    str | None, typer.Option(help="run on the Ray cluster at this address, 'auto', or 'local' to start one")
]
Url = Annotated[str | None, typer.Option(help="of a running service, instead of one of its own")]
AtOnce = Annotated[int, typer.Option(min=1, help="predictions asked for at a time")]
Report = Annotated[bool, typer.Option(help="a page with prompt, reply and pictures of failures")]
AsJson = Annotated[bool, typer.Option("--json", help="one JSON object as the last line")]
Tables = Annotated[
    list[str] | None,
    typer.Option("--table", help=f"of --sweep paper: {TABLE_NAMES} (a figure's charts); may be repeated; default: all"),
]
PriceIn = Annotated[
    list[float] | None,
    typer.Option(min=0, help="of --sweep paper: for a million tokens read; once, or once for each --model"),
]
PriceOut = Annotated[
    list[float] | None, typer.Option(min=0, help="of --sweep paper: for a million tokens written, as --price-in")
]
Budget = Annotated[
    float | None,
    typer.Option(help="of --sweep paper: stop before the trial that may exceed it, in the prices' currency, this run"),
]
Yes = Annotated[bool, typer.Option("--yes", help="of --sweep paper: ask the LLM without a question beforehand")]


@dataclass(frozen=True)
class Asked:
    """What the command line says; names as there."""

    sweep: str
    task: tuple[str, ...]
    episodes: int | None
    demos: int
    model: tuple[str, ...]
    poses: Literal["given", "vision"]
    method: tuple[str, ...]
    recordings: Literal["rests", "continuous"]
    seed: int
    noise: float | None
    noise_on: Literal["both", "test"]
    shift: float | None
    out: Path | None
    ray: str | None
    url: str | None
    at_once: int
    report: bool
    table: tuple[str, ...]
    price_in: tuple[float, ...]
    price_out: tuple[float, ...]
    budget: float | None
    yes: bool
    words: tuple[str, ...]

    @cached_property
    def folder(self) -> Path:
        """Where results go."""
        return self.out or Path("reports") / f"eval-{self.sweep}-{datetime.now():%Y%m%d-%H%M%S}"
