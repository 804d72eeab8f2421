"""`roboprompt-robot viewpoints`: poses from which cameras in the hand look, taught by guiding the arm."""

import sys
from argparse import Namespace
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.cell import read_cell, write_cell
from roboprompt_client.arms.driver import Guidable
from roboprompt_client.cameras.cell import MAX_VIEWPOINTS
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.look_command import CELL, AddCommand, seeing_arm
from roboprompt_client.terminal import ask, ask_yes

KEEP = "Guide the hand to a place from which its camera sees the objects. Enter: viewpoint {}, q: done "


def add_viewpoints(add: AddCommand) -> None:
    """Add `viewpoints` to the script's commands."""
    what = "teach from where a camera in the hand looks: one camera then sees the scene from several sides"
    viewpoints = add("viewpoints", what, run_viewpoints)
    viewpoints.add_argument("--robot", required=True, metavar="CELL", help=CELL)


def run_viewpoints(_: RoboPromptClient, arguments: Namespace) -> int:
    """Write the poses that the person guides the hand to into the cell's file; 1 where none was kept."""
    path = Path(arguments.robot)
    with seeing_arm(arguments.robot) as arm:
        assert arm.cameras is not None
        if not any(camera.in_hand for camera in arm.cameras.cameras):
            raise InvalidInputError("cameras", "none is in the hand", "a camera with camera_to_hand")
        yields = isinstance(arm.driver, Guidable) and ask_yes("Shall the arm yield to your hand? Hold it. [y/N] ")
        with arm.guided() if yields else nullcontext():
            kept = _kept(arm)
    if not kept:
        return 1
    write_cell(path, {**read_cell(path), "viewpoints": kept})
    _print(f"written to {path}; next: roboprompt-robot look --robot {path}")
    return 0


def _kept(arm: Arm) -> list[dict[str, Any]]:
    kept: list[dict[str, Any]] = []
    while len(kept) < MAX_VIEWPOINTS and ask(KEEP.format(len(kept) + 1)) not in ("q", None):
        state = arm.state()
        place, turn = state.position_m.round(4).tolist(), state.quaternion_xyzw.tolist()
        kept.append({"position": place, "quaternion_xyzw": turn})
        _print(f"  {place} m")
    return kept


def _print(text: str) -> None:
    print(text, file=sys.stdout, flush=True)  # noqa: T201
