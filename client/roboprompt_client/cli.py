"""The commands of `roboprompt-robot`, for the computer that drives an arm."""

import argparse
import json
import signal
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from roboprompt_client.answers import PlannedStep
from roboprompt_client.cell import closing_robot, open_robot
from roboprompt_client.client import DEFAULT_URL, RoboPromptClient
from roboprompt_client.commands.calibrate import add_calibrate
from roboprompt_client.commands.check import add_check
from roboprompt_client.commands.look import add_look
from roboprompt_client.commands.record import add_record, offer_correction
from roboprompt_client.commands.shared import (
    ROBOT,
    SEEN,
    Command,
    Person,
    add_find,
    find_in_pictures,
    recovered,
    require_same_base,
    task_document,
)
from roboprompt_client.errors import InvalidInputError, RoboPromptError, ServiceProblemError
from roboprompt_client.http import KEY_VARIABLE
from roboprompt_client.motion.limits import MotionLimits
from roboprompt_client.robot import Observation, Robot, observation_from_file
from roboprompt_client.runs.loop import run_plan, run_task
from roboprompt_client.types.trajectory import trajectory_from_file

DESCRIPTION = (
    "Teach a RoboPrompt service with recorded demonstrations, ask it for actions, and carry them out with an arm."
)
UNAUTHORIZED = 401
LIMITS = (
    'JSON: {"workspace": ..., "motion_limits": ...} as in GET /tasks/{name}, any bound may be left out: limits of your '
    "own, which hold beside the service's"
)


def main() -> int:
    """Parse the command line, do what it says, and return the exit status."""
    arguments = _parser().parse_args()
    sys.path.insert(0, "")  # for --robot MODULE:FACTORY
    try:
        with RoboPromptClient(arguments.url) as client:
            return int(arguments.command(client, arguments))
    except RoboPromptError as error:
        print(error, file=sys.stderr)
        if isinstance(error, ServiceProblemError) and error.status == UNAUTHORIZED:
            print(f"This computer takes the key from the environment: export {KEY_VARIABLE}=...", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 128 + signal.SIGINT


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="roboprompt-robot", description=DESCRIPTION)
    _add_url(parser, DEFAULT_URL)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, what: str, command: Command) -> ArgumentParser:
        added = commands.add_parser(name, help=what, description=f"{what[0].upper()}{what[1:]}.")
        added.set_defaults(command=command)
        _add_url(added, argparse.SUPPRESS)
        return added

    upload = add("upload", "store a recorded episode as a demonstration; print what was extracted from it", _upload)
    _add_task(upload)
    upload.add_argument("--objects", required=True, type=Path, metavar="FILE", help=SEEN)
    upload.add_argument("trajectory", type=Path, help=".npz with end_effector_positions, gripper_open ...")
    predict = add("predict", "print the actions for a scene; nothing moves", _predict)
    _add_task(predict)
    seen = predict.add_mutually_exclusive_group(required=True)
    seen.add_argument("--objects", type=Path, metavar="FILE", help=SEEN)
    seen.add_argument("--robot", metavar="ROBOT", help=f"ask for what it sees now: {ROBOT}")
    add_find(predict)
    predict.add_argument("--model", help="the LLM to ask (default: the service's)")
    _add_run(add("run", "observe the scene, ask for actions, and carry them out with an arm", _run))
    what = "acknowledge an arm's errors, so that it may move again, once somebody has looked at it"
    add("recover", what, _recover).add_argument("--robot", required=True, metavar="ROBOT", help=ROBOT)
    for add_command in (add_record, add_check, add_look, add_calibrate):
        add_command(add)
    return parser


def _add_url(parser: ArgumentParser, default: str) -> None:
    parser.add_argument("--url", default=default, help=f"where the service listens (default: {DEFAULT_URL})")


def _add_task(parser: ArgumentParser, *, required: bool = True) -> None:
    found = "" if required else "; default: the tasks that the instruction asks for, step by step"
    parser.add_argument("--task", required=required, help=f"the task's name at the service{found}")
    parser.add_argument("--instruction", required=True, help="what the robot is to do, in words")


def _add_run(run: ArgumentParser) -> None:
    _add_task(run, required=False)
    add_find(run)
    run.add_argument("--robot", required=True, metavar="ROBOT", help=ROBOT)
    asks = run.add_mutually_exclusive_group()
    asks.add_argument("--confirm", action="store_true", help="ask before each motion (default: before the first)")
    asks.add_argument(
        "--yes", action="store_true", help="do not ask before motions; a danger is asked about all the same"
    )
    run.add_argument("--limits", type=Path, metavar="FILE", help=LIMITS)
    what = "observe again before contact, and follow objects that were moved without asking the LLM again"
    run.add_argument("--look-again", action="store_true", help=what)


def _upload(client: RoboPromptClient, arguments: Namespace) -> int:
    scene = observation_from_file("--objects", arguments.objects)
    trajectory = trajectory_from_file(arguments.trajectory)
    client.ping()
    return _print_json(client.upload(arguments.task, arguments.instruction, trajectory, scene))


def _predict(client: RoboPromptClient, arguments: Namespace) -> int:
    options = {} if arguments.model is None else {"model": arguments.model}
    client.ping()
    if arguments.robot is None:
        scene = observation_from_file("--objects", arguments.objects)
    else:
        scene = _seen(client, arguments)
    return _print_json(client.predict(arguments.task, arguments.instruction, scene, **options).response)


def _seen(client: RoboPromptClient, arguments: Namespace) -> Observation:
    """Return what a robot sees now."""
    with closing_robot(open_robot(arguments.robot)) as robot:
        find_in_pictures(robot, client, arguments.task, arguments.find)
        return robot.observe()


def _run(client: RoboPromptClient, arguments: Namespace) -> int:
    client.ping()
    pinned = _pinned(arguments)
    with closing_robot(open_robot(arguments.robot)) as robot:
        return _run_with(client, robot, pinned, arguments)


def _run_with(client: RoboPromptClient, robot: Robot, pinned: MotionLimits | None, arguments: Namespace) -> int:
    person = Person(robot, client.url.rstrip("/"))
    find_in_pictures(robot, client, arguments.task, arguments.find)
    # A termination leaves through `run_task`, which stops the arm.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    how: dict[str, Any] = {"pinned": pinned, "look_again": arguments.look_again}
    how |= {"on_danger": person.allow_danger, "preview": person.preview}
    if not arguments.yes:
        how["confirm"] = person.confirm if arguments.confirm else person.confirm_plan
    if arguments.task is None:
        return _run_steps(client, robot, person, arguments, how)
    task, instruction = arguments.task, arguments.instruction
    require_same_base(robot, task, task_document(client, task))
    predicted = run_task(client, robot, task, instruction, on_outcome=person.outcome, **how)
    _print_json(predicted.response)
    if person.said is None or person.said.success:
        return 0
    offer_correction(client, robot, task, instruction, predicted.id)
    return 1


def _run_steps(
    client: RoboPromptClient, robot: Robot, person: Person, arguments: Namespace, how: dict[str, Any]
) -> int:
    """Carry out a sentence over several tasks."""

    def confirm_steps(steps: Sequence[PlannedStep]) -> bool:
        for task in dict.fromkeys(step.task for step in steps):
            require_same_base(robot, task, task_document(client, task))
        return arguments.yes or person.confirm_steps(steps)

    on_outcome = None if arguments.yes else person.outcome
    steps = run_plan(client, robot, arguments.instruction, confirm_steps=confirm_steps, on_outcome=on_outcome, **how)
    return _print_json({"steps": [step.response for step in steps]})


def _recover(_: RoboPromptClient, arguments: Namespace) -> int:
    with closing_robot(open_robot(arguments.robot, cameras=False)) as robot:
        return int(not recovered(robot))


def _print_json(document: object) -> int:
    print(json.dumps(document, indent=2))
    return 0


def _pinned(arguments: Namespace) -> MotionLimits | None:
    """Return the caller's own limits, which hold together with the task's; None without `--limits`."""
    if (path := arguments.limits) is None:
        return None
    try:
        return MotionLimits.from_file(json.loads(path.read_text()))
    except InvalidInputError:
        raise
    except (OSError, ValueError) as error:
        valid = "a JSON file with workspace, motion_limits or both"
        raise InvalidInputError("--limits", f"{path}: {error}", valid) from error
