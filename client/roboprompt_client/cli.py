"""The thin script for a robot's computer: `roboprompt-robot --help`.

It uploads recorded episodes, asks for actions and prints them as JSON; with `--robot` it moves an arm.
"""

import argparse
import json
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

from roboprompt_client.arms.cell import open_robot
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.danger import OnDanger
from roboprompt_client.errors import InvalidInputError, RoboPromptError
from roboprompt_client.loop import run_closed_loop, run_task, show_nothing
from roboprompt_client.motion_limits import Box, MotionLimits, Pose
from roboprompt_client.record_command import add_commands
from roboprompt_client.robot import OBJECTS, observation_from_file
from roboprompt_client.terminal import Person
from roboprompt_client.trajectory_npz import trajectory_from_npz

ROBOT = "a cell's JSON file, or MODULE:FACTORY: a callable that returns a Robot"


def main() -> int:
    """Parse the command line, do what it says, and return the exit code."""
    arguments = _parser().parse_args()
    try:
        if (given := getattr(arguments, "objects", None)) is not None:
            observation_from_file("--objects", given)  # what is wrong with it is said before anybody is asked
        with RoboPromptClient(arguments.url) as client:
            if (offline := getattr(arguments, "offline", None)) is not None:
                return int(offline(client, arguments))
            client.ping()
            print(json.dumps(arguments.command(client, arguments), indent=2))  # noqa: T201
    except RoboPromptError as error:
        print(error, file=sys.stderr)  # noqa: T201
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)  # noqa: T201
        return 128 + signal.SIGINT
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="roboprompt-robot", description=__doc__)
    parser.add_argument("--url", default=DEFAULT_URL, help="where the service listens (default: %(default)s)")
    commands = parser.add_subparsers(required=True)

    upload = commands.add_parser("upload", help="store a recorded episode")
    _add_scene(upload)
    upload.add_argument("trajectory", type=Path, help=".npz with joint_velocities, end_effector_positions ...")
    upload.set_defaults(command=_upload)

    predict = commands.add_parser("predict", help="print the actions for a scene")
    _add_scene(predict)
    predict.add_argument("--model")
    predict.add_argument(
        "--end-effector",
        nargs=7,
        type=float,
        metavar=("X", "Y", "Z", "QX", "QY", "QZ", "QW"),
        help="where the arm is, metres and quaternion, world frame: needed where the task bounds steps",
    )
    predict.set_defaults(command=_predict)

    run = commands.add_parser("run", help="observe, ask and act with an arm")
    run.add_argument("--task", required=True)
    run.add_argument("--instruction", required=True)
    run.add_argument("--robot", required=True, metavar="ROBOT", help=ROBOT)
    run.add_argument("--confirm", action="store_true", help="show the plan, and ask before each motion")
    run.add_argument(
        "--workspace",
        nargs=6,
        type=float,
        metavar=("XMIN", "YMIN", "ZMIN", "XMAX", "YMAX", "ZMAX"),
        help="metres, world frame: refuse every action outside, too, whatever the service says",
    )
    run.add_argument(
        "--limits",
        type=Path,
        metavar="FILE",
        help='JSON: {"workspace": ..., "motion_limits": ...} as in GET /tasks/{name}, any bound may be left out: hold '
        "these, too, whatever the service says",
    )
    how = run.add_mutually_exclusive_group()
    how.add_argument("--stream", action="store_true", help="begin to move while the LLM still writes")
    how.add_argument("--closed-loop", action="store_true", help="observe and ask again before each action")
    how.add_argument(
        "--look-again",
        action="store_true",
        help="observe again before contact: actions follow the objects that they hang on, without asking again",
    )
    run.add_argument(
        "--on-danger",
        choices=get_args(OnDanger),
        help="where the service finds its answer dangerous (default: ask with --confirm, refuse without)",
    )
    run.set_defaults(command=_run)
    add_commands(commands, ROBOT)
    return parser


def _add_scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--task", required=True)
    parser.add_argument("--instruction", required=True)
    parser.add_argument(
        "--objects",
        required=True,
        type=Path,
        metavar="FILE",
        help=f"what the robot sees, {OBJECTS}",
    )


def _upload(client: RoboPromptClient, arguments: argparse.Namespace) -> dict[str, Any]:
    trajectory = trajectory_from_npz(arguments.trajectory.read_bytes())
    return client.upload(
        arguments.task, arguments.instruction, trajectory, observation_from_file("--objects", arguments.objects)
    )


def _predict(client: RoboPromptClient, arguments: argparse.Namespace) -> dict[str, Any]:
    options = {} if arguments.model is None else {"model": arguments.model}
    scene = observation_from_file("--objects", arguments.objects)
    if (arm := arguments.end_effector) is not None:
        scene = replace(scene, end_effector=Pose(tuple(arm[:3]), tuple(arm[3:])))
    return dict(client.predict(arguments.task, arguments.instruction, scene, **options).response)


def _run(client: RoboPromptClient, arguments: argparse.Namespace) -> dict[str, Any]:
    robot = open_robot(arguments.robot)
    person = Person(robot) if arguments.confirm else None
    confirm = None if person is None else person.confirm
    preview = show_nothing if person is None else person.preview
    what = (client, robot, arguments.task, arguments.instruction)
    pinned = _pinned(arguments)
    # Who ends this script ends it through `run_task`, which stops the arm.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    danger = arguments.on_danger
    if arguments.closed_loop:
        steps = run_closed_loop(*what, pinned=pinned, confirm=confirm, on_danger=danger, preview=preview)
        return {"steps": [step.response for step in steps]}
    how = {"stream": arguments.stream, "look_again": arguments.look_again, "on_danger": danger}
    return dict(run_task(*what, pinned=pinned, confirm=confirm, preview=preview, **how).response)


def _pinned(arguments: argparse.Namespace) -> MotionLimits:
    """The caller's own bounds, which hold together with the task's."""
    pinned = MotionLimits(hand_radius_m=0.0) if arguments.limits is None else _limits_in(arguments.limits)
    if arguments.workspace is None:
        return pinned
    low, high = tuple(arguments.workspace[:3]), tuple(arguments.workspace[3:])
    return pinned.intersection(MotionLimits(Box(low, high), hand_radius_m=0.0))


def _limits_in(path: Path) -> MotionLimits:
    try:
        document = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InvalidInputError(
            "--limits", f"{path}: {error}", "a JSON file with workspace, motion_limits or both"
        ) from error
    return MotionLimits.from_file(document)
