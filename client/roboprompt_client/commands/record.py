"""`roboprompt-robot record`: record demonstrations while a person moves the arm, and upload them."""

import os
import select
import sys
import termios
import tty
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import Guidable
from roboprompt_client.cell import closing_robot, open_robot
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.shared import (
    ROBOT,
    SEEN,
    AddCommand,
    add_find,
    ask,
    ask_yes,
    find_in_pictures,
    other_base,
    recovered,
    require_same_base,
    say,
    task_document,
)
from roboprompt_client.errors import (
    CameraError,
    InvalidInputError,
    MotionError,
    ServiceProblemError,
    ServiceUnreachableError,
)
from roboprompt_client.recording import (
    RATE_HZ,
    Recorder,
    Sample,
    checked_rate_hz,
    upload_recording,
    write_recording,
)
from roboprompt_client.robot import Observation, Robot, observation_from_file
from roboprompt_client.types.names import checked_instruction, checked_name
from roboprompt_client.types.trajectory import Trajectory

FOLDER = Path("recordings")
KEYS = "o: open the gripper   c: close it   x: discard   Enter: keep"
OPEN, CLOSE, KEEP, DISCARD = "o", "c", "\r\n", "x"
SHOWN_S = 0.2
CLEAR_LINE = "\x1b[K"
MAX_KEYS = 64  # per read


def add_record(add: AddCommand) -> None:
    """Add `record` to the commands."""
    record = add("record", "record demonstrations while a person moves the arm, and upload them", run_record)
    option = record.add_argument
    option("--robot", metavar="ROBOT", help=ROBOT)
    option("--task", help="needed unless --upload")
    option("--instruction", help="needed unless --upload")
    option("--objects", type=Path, metavar="FILE", help=f"{SEEN}, if the robot does not know them itself")
    add_find(record)
    option("--folder", type=Path, default=FOLDER, help=f"where recordings are kept (default: {FOLDER})")
    option("--rate-hz", type=float, default=RATE_HZ, help="samples a second, at least 20 (default: %(default)g)")
    option("--guide", action="store_true", help="let the arm carry its weight and yield to your hand (Franka only)")
    option("--upload", type=Path, metavar="RECORDING", help="send a recording again, by its folder; record nothing")


def run_record(client: RoboPromptClient, arguments: Namespace) -> int:
    """Record until the person ends it, and upload; return 1 if a recording was broken off or not stored, else 0."""
    if arguments.upload is not None:
        return _upload(client, arguments.upload)
    for name in ("robot", "task", "instruction"):
        if getattr(arguments, name) is None:
            raise InvalidInputError(f"--{name}", "is missing", "needed unless --upload")
    checked_rate_hz(arguments.rate_hz)
    checked_name("--task", arguments.task)
    checked_instruction("--instruction", arguments.instruction)
    if arguments.objects is not None:
        observation_from_file("--objects", arguments.objects)  # report its faults before the recording
    with closing_robot(open_robot(arguments.robot)) as robot:
        if not hasattr(robot, "state"):
            valid = "an arm of a cell's file, or `state` returns an ArmState"
            raise InvalidInputError("--robot", "has no `state`", valid)
        if arguments.guide and not _can_be_guided(robot):
            raise InvalidInputError("--guide", "this arm cannot be guided by its driver", "its maker's button")
        find_in_pictures(robot, client, arguments.task, arguments.find)
        _announce(client, robot, arguments)
        failed = 0
        while ask("Enter to record, q to end: ") not in ("q", None):
            try:
                failed |= _record_one(client, robot, arguments)
            except MotionError as error:
                say(f"broken off, and not kept: {error}")
                failed = 1
                if not recovered(robot):
                    break
    return failed


def _can_be_guided(robot: Robot) -> bool:
    return isinstance(robot, Arm) and isinstance(robot.driver, Guidable)


def _announce(client: RoboPromptClient, robot: Robot, arguments: Namespace) -> None:
    """Say before the first recording what would surprise a person after it; raises ServiceProblemError for a key."""
    try:
        settings = task_document(client, arguments.task)
        require_same_base(robot, arguments.task, settings)
        if settings is None:
            say(f"{arguments.task!r} is a new task")
            if base := other_base(robot, {}):
                client.configure_task(arguments.task, **base)
    except ServiceUnreachableError as error:
        say(f"{error} Recordings are kept in {arguments.folder}.")


def offer_correction(client: RoboPromptClient, robot: Robot, task: str, instruction: str, prediction_id: str) -> None:
    """After a run that failed, offer to record a demonstration that corrects its prediction."""
    if hasattr(robot, "state") and ask_yes("Show how it is done? Put the scene back first. [y/N] "):
        how = {"objects": None, "rate_hz": RATE_HZ, "guide": _can_be_guided(robot), "folder": FOLDER}
        _record_one(client, robot, Namespace(task=task, instruction=instruction, **how), corrects=prediction_id)


def _record_one(client: RoboPromptClient, robot: Robot, options: Namespace, corrects: str | None = None) -> int:
    """Record and upload one demonstration with the command's options; return 1 if it was not stored.

    Raises:
        MotionError: if the arm ended it.
        InvalidInputError: if the next recording would fail, too.
    """
    try:
        seen = _seen(robot, options.objects)
    except CameraError as error:
        say(str(error))
        return 1
    trajectory = record_live(robot, options.rate_hz, guide=options.guide)
    if trajectory is None:
        return 0
    metadata = {"task": options.task, "instruction": options.instruction, "corrects": corrects}
    folder = write_recording(options.folder, metadata, trajectory, seen)
    say(f"{len(trajectory)} frames, {trajectory.num_joints} joints")
    return _upload(client, folder)


def _seen(robot: Robot, objects: Path | None) -> Observation:
    """Return the scene at the start: the file's poses if there is a file, and the cameras' pictures."""
    if objects is None:
        return robot.observe()
    given = observation_from_file("--objects", objects)
    if not isinstance(robot, Arm) or not robot.cameras.cameras:
        return given
    seen, known = robot.observe(), [item.name for item in given.objects]
    return Observation(given.objects, seen.frames, [name for name in seen.to_find if name not in known])


def _upload(client: RoboPromptClient, folder: Path) -> int:
    """Upload a recording, and say what the service answers; return 1 if it is not stored, else 0."""
    try:
        answer = upload_recording(client, folder)
    except (ServiceUnreachableError, ServiceProblemError) as error:
        say(f"not stored: {error}\nsend it again: roboprompt-robot record --upload {folder}")
        return 1
    say(f"stored as {answer['id']}: {len(answer.get('keyframes', ()))} keyframes")
    for item in answer.get("findings", ()):
        say(f"  {item['severity']} {item['code']}: {item['message']}")
    return 0


def record_live(arm: Any, rate_hz: float, *, guide: bool = False) -> Trajectory | None:  # noqa: ANN401
    """Return what was recorded until the person ends it, or None if they discard it.

    Keys open and close the gripper, and a line shows the progress. With `guide` the arm yields to the person's hand.
    Raises MotionError or KeyboardInterrupt if arm or person broke it off.
    """
    with arm.guided() if guide else nullcontext():
        recorder = Recorder(arm, rate_hz)
        recorder.start()
        try:
            keep = _until_ended(arm, recorder)
        except BaseException:
            with suppress(MotionError, InvalidInputError):
                recorder.stop()
            raise
        finally:
            _show("\n")
        trajectory = recorder.stop()
    return trajectory if keep else None


def _until_ended(arm: Any, recorder: Recorder) -> bool:  # noqa: ANN401
    """Serve the person's keys until they end the recording; return whether they keep it."""
    _show(f"{KEYS}\n")
    with keyboard() as pressed:
        while True:
            for key in pressed(SHOWN_S):
                if key in KEEP or key == DISCARD:
                    return key != DISCARD
                if key in (OPEN, CLOSE) and hasattr(arm, "set_gripper"):
                    arm.set_gripper(is_open=key == OPEN)
            if samples := recorder.samples:
                _show(f"\r{_line(samples)}{CLEAR_LINE}")


@contextmanager
def keyboard() -> Iterator[Callable[[float], str]]:
    """Yield a function that returns the keys pressed since its last call; it waits for one at most the given seconds.

    Within the context keys are not echoed. If standard input is not a terminal, the function waits for a line.
    """
    if not sys.stdin.isatty():
        yield lambda _: ask("") or "\n"
        return
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin, termios.TCSADRAIN)  # keys typed before still count
    try:
        yield _pressed
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _pressed(wait_s: float) -> str:
    if not select.select([sys.stdin], [], [], wait_s)[0]:
        return ""
    return os.read(sys.stdin.fileno(), MAX_KEYS).decode(errors="ignore") or DISCARD  # a terminal that was closed


def _line(samples: Sequence[Sample]) -> str:
    (first_s, _), (last_s, state) = samples[0], samples[-1]
    x_m, y_m, z_m = state.position_m
    rate_hz = (len(samples) - 1) / (last_s - first_s) if last_s > first_s else 0.0
    width = "" if state.gripper_width_m is None else f"  gripper {1000 * state.gripper_width_m:3.0f} mm"
    return f"{last_s - first_s:6.1f} s  {rate_hz:4.0f} Hz  hand {x_m:+.3f} {y_m:+.3f} {z_m:+.3f} m{width}"


def _show(text: str) -> None:
    print(text, end="", file=sys.stderr, flush=True)
