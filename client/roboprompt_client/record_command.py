"""`roboprompt-robot record` and `roboprompt-robot check`: what happens at the arm before a prediction."""

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from roboprompt_client.arm_check import ArmCheck, CheckResult
from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.cell import closing_robot, open_robot
from roboprompt_client.arms.driver import Guidable
from roboprompt_client.arrays import finite_array
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import CameraError, InvalidInputError, MotionError, ServiceUnreachableError
from roboprompt_client.live_recording import record_live
from roboprompt_client.look_command import AddCommand, add_find, find_in_pictures
from roboprompt_client.recorder import RATE_HZ, HasState
from roboprompt_client.robot import OBJECTS, Observation, Robot, observation_from_file
from roboprompt_client.spool import JOURNAL, Sent, Spool
from roboprompt_client.terminal import Person, ask, ask_yes

SPOOL = Path("recordings")
MARKS = {True: "ok  ", False: "FAIL", None: "look"}


def add_record(add: AddCommand, robot_help: str) -> None:
    """Add `record` to the script's commands."""
    what = "record demonstrations while a person moves the arm, and upload them"
    record = add("record", what, run_record)
    record.add_argument("--robot", metavar="ROBOT", help=robot_help)
    record.add_argument("--task", help="needed unless --send-only")
    record.add_argument("--instruction", help="needed unless --send-only")
    record.add_argument(
        "--objects", type=Path, metavar="FILE", help=f"what the robot sees, unless it says so, {OBJECTS}"
    )
    add_find(record)
    record.add_argument("--spool", type=Path, default=SPOOL, help="folder (default: %(default)s)")
    record.add_argument("--rate-hz", type=float, default=RATE_HZ, help="at least 20 (default: %(default)g)")
    led = record.add_mutually_exclusive_group()
    led.add_argument(
        "--guide", action="store_true", help="let the arm carry its own weight and yield to your hand (Franka)"
    )
    led.add_argument("--teleop", choices=("keyboard", "spacemouse"), help="steer the hand from here while it records")
    record.add_argument("--send-only", action="store_true", help="upload what is waiting, and record nothing")


def add_check(add: AddCommand, robot_help: str) -> None:
    """Add `check` to the script's commands."""
    check = add(
        "check", "see whether an arm does what the Robot Protocol says; without --move nothing moves", run_check
    )
    check.add_argument("--robot", metavar="ROBOT", required=True, help=robot_help)
    check.add_argument("--move", action="store_true", help="3 cm up, a turn by 10 degrees, gripper, stop; asks first")
    check.add_argument(
        "--touch",
        nargs=3,
        type=float,
        action="append",
        default=[],
        metavar=("X", "Y", "Z"),
        help="meters, world frame: a place, such as a corner of the ChArUco board, to which you guide the fingers by "
        "hand; says how far off the arm takes itself to be (may be repeated)",
    )


def run_record(client: RoboPromptClient, arguments: Namespace) -> int:
    """Record until the person has enough; what the service does not take now waits in the spool.

    Returns 1 where the service refused a recording or did not answer, else 0.
    """
    try:
        spool = Spool(arguments.spool)
    except OSError as error:
        raise InvalidInputError("--spool", str(error), "a folder of this user's that can be written") from error
    failed = 0
    if not arguments.send_only:
        for name in ("robot", "task", "instruction"):
            if getattr(arguments, name) is None:
                raise InvalidInputError(f"--{name}", "is missing", "needed unless --send-only")
        if arguments.objects is not None:
            observation_from_file("--objects", arguments.objects)  # what is wrong with it is said before the recording
        with closing_robot(open_robot(arguments.robot)) as robot:
            failed = _record_all(client, robot, spool, arguments)
    return failed | _send_all(client, spool)


def _record_all(client: RoboPromptClient, robot: Robot, spool: Spool, arguments: Namespace) -> int:
    """Recordings until the person ends; 1 where the service refused one or did not answer."""
    if not hasattr(robot, "state"):
        raise InvalidInputError("--robot", "cannot be recorded", "a robot with state(), such as a cell's Arm")
    find_in_pictures(robot, client, arguments.task, arguments.find)
    if isinstance(robot, Arm):
        robot.confirm_viewpoint = Person(robot).confirm_viewpoint
    failed = 0
    while ask("Enter to record, q to end: ") not in ("q", None):
        _record_one(robot, spool, arguments)
        failed |= _send_all(client, spool)
    return failed


def offer_correction(client: RoboPromptClient, robot: Robot, task: str, instruction: str) -> None:
    """After a run that failed: record how it is done, where the person wants to show it."""
    if not hasattr(robot, "state") or not ask_yes("Show how it is done? Put the scene back first. [y/N] "):
        return
    spool = Spool(SPOOL)
    guide = isinstance(robot, Arm) and isinstance(robot.driver, Guidable)
    how = {"objects": None, "rate_hz": RATE_HZ, "guide": guide, "teleop": None}
    _record_one(robot, spool, Namespace(task=task, instruction=instruction, **how))
    _send_all(client, spool)


def run_check(_: RoboPromptClient, arguments: Namespace) -> int:
    """Print the report; 1 where something failed."""
    robot = open_robot(arguments.robot, cameras=False)
    for k, place_m in enumerate(arguments.touch):
        finite_array(f"--touch[{k}]", place_m, (3,))

    def confirm(question: str) -> bool:
        return ask_yes(f"{question} [y/N] ")

    return print_results(ArmCheck(robot, moves=arguments.move, confirm=confirm, touched_m=arguments.touch).run())


def print_results(results: Sequence[CheckResult]) -> int:
    """A line for each; 1 where something failed."""
    for result in results:
        _print(f"{MARKS[result.passed]}  {result.name}: {result.detail}")
    return int(any(result.passed is False for result in results))


def _record_one(robot: Robot, spool: Spool, arguments: Namespace) -> None:
    """One demonstration; what is interrupted stays in the spool."""
    try:
        seen = _seen(robot, arguments.objects)
    except CameraError as error:
        _print(str(error))
        return
    folder = spool.new(arguments.task, arguments.instruction, seen)
    arm: HasState = robot  # type: ignore[assignment]  # what has `state` can be recorded
    try:
        how = {"guide": arguments.guide, "teleop": arguments.teleop}
        trajectory = record_live(arm, folder / JOURNAL, arguments.rate_hz, **how)
    except (MotionError, InvalidInputError) as error:
        if (folder / JOURNAL).exists():
            _print(f"{error}; what came before is in {folder}")
            return
        spool.discard(folder)
        if isinstance(error, InvalidInputError):  # the next recording would not begin, either
            raise
        _print(str(error))
        return
    except KeyboardInterrupt:
        _print(f"kept in {folder}: `roboprompt-robot record --send-only` uploads it")
        raise
    if trajectory is None:
        spool.discard(folder)
        return
    _print(f"{len(trajectory)} frames, {trajectory.num_joints} joints")


def _seen(robot: Robot, objects: Path | None) -> Observation:
    """The scene at the start: poses of the file where there is one, and what the cell's cameras see."""
    if objects is None:
        return robot.observe()
    given = observation_from_file("--objects", objects)
    if not isinstance(robot, Arm) or robot.cameras is None:
        return given
    seen, known = robot.observe(), [item.name for item in given.objects]
    return Observation(given.objects, seen.frames, [name for name in seen.to_find if name not in known])


def _send_all(client: RoboPromptClient, spool: Spool) -> int:
    """Upload what waits; 1 where the service refused one."""
    refused = 0
    for folder in spool.waiting():
        try:
            sent = spool.send(client, folder)
        except ServiceUnreachableError as error:
            _print(f"{error}; it waits in {folder}")
            return 1
        except InvalidInputError as error:
            _print(f"{folder}: {error}")
            refused = 1
            continue
        refused |= not sent.stored
        _print(_said(sent))
    return refused


def _said(sent: Sent) -> str:
    answer: Mapping[str, Any] = sent.answer
    if not sent.stored:
        return f"refused: {answer.get('detail', answer.get('title'))} ({sent.folder})"
    lines = [f"stored as {answer['id']}: {len(answer.get('keyframes', ()))} keyframes"]
    lines += [f"  {item['severity']} {item['code']}: {item['message']}" for item in answer.get("findings", ())]
    return "\n".join(lines)


def _print(text: str) -> None:
    print(text, file=sys.stdout, flush=True)  # noqa: T201
