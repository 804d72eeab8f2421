"""`roboprompt-robot record`: record demonstrations while a person moves the arm, and upload them."""

from argparse import ArgumentTypeError, Namespace
from collections.abc import Callable
from functools import partial
from pathlib import Path

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.driver import Guidable
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.record_live import record_live, require_movable
from roboprompt_client.commands.shared import (
    ROBOT,
    SEEN,
    AddCommand,
    add_find,
    asking_robot,
    find_in_pictures,
    other_base,
    require_same_base,
    task_document,
)
from roboprompt_client.commands.terminal import ask, ask_yes, recovered, say
from roboprompt_client.errors import (
    CameraError,
    InvalidInputError,
    MotionError,
    ServiceUnreachableError,
)
from roboprompt_client.recording.journal import films_from_journal
from roboprompt_client.recording.recorder import (
    RATE_HZ,
    HasState,
    checked_film_hz,
    checked_rate_hz,
)
from roboprompt_client.recording.spool import JOURNAL, UNFINISHED, Sent, Spool
from roboprompt_client.robot import Observation, Robot, observation_from_file
from roboprompt_client.types.film import FILM_HZ
from roboprompt_client.types.names import checked_instruction, checked_name

SPOOL = Path("recordings")
FILMED = "pictures a second that each camera of the cell takes meanwhile; 0: none (default: %(default)g)"
STEER = "steer the hand with keyboard or spacemouse, or with a LeRobot leader arm that MODULE:FACTORY returns"


def add_record(add: AddCommand) -> None:
    """Add `record` to the commands."""
    record = add("record", "record demonstrations while a person moves the arm, and upload them", run_record)
    option = record.add_argument
    option("--robot", metavar="ROBOT", help=ROBOT)
    option("--task", help="needed unless --send-only")
    option("--instruction", help="needed unless --send-only")
    option("--objects", type=Path, metavar="FILE", help=f"{SEEN}, if the robot does not know them itself")
    add_find(record)
    option("--spool", type=Path, default=SPOOL, help=f"folder of recordings that wait (default: {SPOOL})")
    rate, film = partial(_number, checked_rate_hz), partial(_number, checked_film_hz)
    option("--rate-hz", type=rate, default=RATE_HZ, help="samples a second, at least 20 (default: %(default)g)")
    option("--film-hz", type=film, default=FILM_HZ, help=FILMED)
    moved_by = record.add_mutually_exclusive_group()
    what = "let the arm carry its own weight and yield to your hand (Franka only)"
    moved_by.add_argument("--guide", action="store_true", help=what)
    moved_by.add_argument("--teleop", metavar="DEVICE", type=_device, help=STEER)
    what = "upload recordings that wait, also those that were interrupted, and record nothing"
    option("--send-only", action="store_true", help=what)
    record.set_defaults(corrects=None)


def _number(checked: Callable[[float], float], text: str) -> float:
    try:
        return checked(float(text))
    except ValueError as error:  # an InvalidInputError, too
        raise ArgumentTypeError(str(error)) from error


def _device(text: str) -> str:
    if text in ("keyboard", "spacemouse") or ":" in text:
        return text
    raise ArgumentTypeError(f"{text!r:.40} is none of keyboard, spacemouse, MODULE:FACTORY")


def run_record(client: RoboPromptClient, arguments: Namespace) -> int:
    """Record until the person ends it, and upload; recordings that the service cannot take now wait in the spool.

    Return 1 if the service refused a recording or did not answer, else 0.
    """
    try:
        spool = Spool(arguments.spool)
    except OSError as error:
        raise InvalidInputError("--spool", str(error), "a folder of this user's that can be written") from error
    if arguments.send_only:
        spool.finish_all()
        return _send_all(client, spool)
    for name in ("robot", "task", "instruction"):
        if getattr(arguments, name) is None:
            raise InvalidInputError(f"--{name}", "is missing", "needed unless --send-only")
    checked_name("--task", arguments.task)
    checked_instruction("--instruction", arguments.instruction)
    if arguments.objects is not None:
        observation_from_file("--objects", arguments.objects)  # report its faults before the recording
    with asking_robot(arguments.robot) as robot:
        return _record_all(client, robot, spool, arguments)


def _record_all(client: RoboPromptClient, robot: Robot, spool: Spool, arguments: Namespace) -> int:
    """Record until the person ends it; return 1 if the service refused a recording or did not answer, else 0."""
    if not hasattr(robot, "state"):
        raise InvalidInputError("--robot", "has no `state`", "an arm of a cell's file, or `state` returns an ArmState")
    require_movable(robot, guide=arguments.guide, teleop=arguments.teleop)
    find_in_pictures(robot, client, arguments.task, arguments.find)
    _announce(client, robot, arguments)
    failed = 0
    while ask("Enter to record, q to end: ") not in ("q", None):
        try:
            _record_one(robot, spool, arguments)
        except MotionError as error:
            say(str(error))
            failed = 1
            if not recovered(robot):
                break
        failed |= _send_all(client, spool)
    return failed


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
        say(f"{error} Recordings wait in {arguments.spool}.")


def offer_correction(client: RoboPromptClient, robot: Robot, task: str, instruction: str, prediction_id: str) -> None:
    """After a run that failed, offer to record a demonstration that corrects its prediction."""
    if not hasattr(robot, "state") or not ask_yes("Show how it is done? Put the scene back first. [y/N] "):
        return
    spool = Spool(SPOOL)
    guide = isinstance(robot, Arm) and isinstance(robot.driver, Guidable)
    how = {"objects": None, "rate_hz": RATE_HZ, "film_hz": FILM_HZ, "guide": guide, "teleop": None}
    _record_one(robot, spool, Namespace(task=task, instruction=instruction, corrects=prediction_id, **how))
    _send_all(client, spool)


def _record_one(robot: Robot, spool: Spool, options: Namespace) -> None:
    """Record one demonstration with the command's options; an interrupted one stays in the spool, unfinished.

    Raises:
        MotionError: if the arm ended it.
        InvalidInputError: if the next recording would fail, too.
    """
    try:
        seen = _seen(robot, options.objects)
    except CameraError as error:
        say(str(error))
        return
    folder = spool.new(options.task, options.instruction, seen, options.corrects)
    arm: HasState = robot  # type: ignore[assignment]  # checked by the caller: it has `state`
    moved_by = {"guide": options.guide, "teleop": options.teleop}
    try:
        trajectory = record_live(arm, folder / UNFINISHED, options.rate_hz, film_hz=options.film_hz, **moved_by)
    except (MotionError, InvalidInputError, KeyboardInterrupt):
        if (folder / UNFINISHED).exists():
            say(f"interrupted, and not uploaded: it is in {folder}; `roboprompt-robot record --send-only` uploads it")
        else:
            spool.discard(folder)
        raise
    if trajectory is None:
        spool.discard(folder)
        return
    spool.finish(folder)
    films = [f"film of {film.camera}: {len(film.pictures)}" for film in films_from_journal(folder / JOURNAL)]
    say(", ".join([f"{len(trajectory)} frames", f"{trajectory.num_joints} joints", *films]))


def _seen(robot: Robot, objects: Path | None) -> Observation:
    """Return the scene at the start: the file's poses if there is a file, and the cameras' pictures."""
    if objects is None:
        return robot.observe()
    given = observation_from_file("--objects", objects)
    if not isinstance(robot, Arm) or robot.cameras is None:
        return given
    seen, known = robot.observe(), [item.name for item in given.objects]
    return Observation(given.objects, seen.frames, [name for name in seen.to_find if name not in known])


def _send_all(client: RoboPromptClient, spool: Spool) -> int:
    """Upload the recordings that wait; return 1 if one was refused or the service does not answer, else 0."""
    refused = 0
    for folder in spool.waiting():
        try:
            sent = spool.send(client, folder)
        except ServiceUnreachableError as error:
            say(f"{error}; it waits in {folder}")
            return 1
        except InvalidInputError as error:
            say(f"{folder}: {error}")
            refused = 1
            continue
        refused |= not sent.stored
        say(_answer_text(sent))
    return refused


def _answer_text(sent: Sent) -> str:
    """Return the answer to a recording for a person: keyframes and findings, or why it was refused."""
    answer = sent.answer
    if not sent.stored:
        return f"refused: {answer.get('detail', answer.get('title'))} ({sent.folder})"
    lines = [f"stored as {answer['id']}: {len(answer.get('keyframes', ()))} keyframes"]
    lines += [f"  {item['severity']} {item['code']}: {item['message']}" for item in answer.get("findings", ())]
    return "\n".join(lines)
