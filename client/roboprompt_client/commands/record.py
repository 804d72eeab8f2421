"""`roboprompt-robot record`: record demonstrations while a person moves the arm, and upload them."""

import sys
import time
from argparse import Namespace
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np

from roboprompt_client.arms.arm import Arm, Steer
from roboprompt_client.arms.driver import Guidable
from roboprompt_client.cell import closing_robot, open_robot
from roboprompt_client.client import RoboPromptClient
from roboprompt_client.commands.look import AddCommand, add_find, find_in_pictures
from roboprompt_client.commands.terminal import Person, ask, ask_yes, say
from roboprompt_client.errors import CameraError, InvalidInputError, MotionError, ServiceUnreachableError
from roboprompt_client.recording.recorder import RATE_HZ, HasState, Progress, Recorder
from roboprompt_client.recording.spool import JOURNAL, Sent, Spool
from roboprompt_client.recording.teleop import END, MOVES, SPEED_M_S, TICK_S, TURN_RAD_S, Read, Said, keyboard, opened
from roboprompt_client.robot import OBJECTS, Observation, Robot, observation_from_file
from roboprompt_client.types.trajectory import Trajectory

SPOOL = Path("recordings")
KEYS = "o: open the gripper   c: close it   x: discard   Enter: keep"
OPEN, CLOSE, KEEP = "o", "c", "\r\n"
SHOWN_S = 0.2
MAX_LINE_CHARS, CLEAR_LINE = 78, "\x1b[K"
AN_ARM = "an Arm, such as that of a cell's file"


def add_record(add: AddCommand, robot_help: str) -> None:
    """Add `record` to the script's commands."""
    what = "record demonstrations while a person moves the arm, and upload them"
    record = add("record", what, run_record)
    record.add_argument("--robot", metavar="ROBOT", help=robot_help)
    record.add_argument("--task", help="needed unless --send-only")
    record.add_argument("--instruction", help="needed unless --send-only")
    what = f"what the robot sees, if it does not know it itself, {OBJECTS}"
    record.add_argument("--objects", type=Path, metavar="FILE", help=what)
    add_find(record)
    record.add_argument(
        "--spool",
        type=Path,
        default=SPOOL,
        help="folder for recordings that wait for the service (default: %(default)s)",
    )
    record.add_argument(
        "--rate-hz", type=float, default=RATE_HZ, help="samples a second, at least 20 (default: %(default)g)"
    )
    led = record.add_mutually_exclusive_group()
    what = "let the arm carry its own weight and yield to your hand (Franka only)"
    led.add_argument("--guide", action="store_true", help=what)
    led.add_argument(
        "--teleop", choices=("keyboard", "spacemouse"), help="steer the hand with these keys or this device"
    )
    record.add_argument("--send-only", action="store_true", help="upload recordings that wait, and record nothing")


def run_record(client: RoboPromptClient, arguments: Namespace) -> int:
    """Record until the person ends it, and upload; recordings that the service cannot take now wait in the spool.

    Return 1 if the service refused a recording or did not answer, else 0.
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
            observation_from_file("--objects", arguments.objects)  # report its faults before the recording
        with closing_robot(open_robot(arguments.robot)) as robot:
            failed = _record_all(client, robot, spool, arguments)
    return failed | _send_all(client, spool)


def _record_all(client: RoboPromptClient, robot: Robot, spool: Spool, arguments: Namespace) -> int:
    """Record until the person ends it; return 1 if the service refused a recording or did not answer, else 0."""
    if not hasattr(robot, "state"):
        raise InvalidInputError("--robot", "cannot be recorded: it has no state()", "an arm of a cell's file")
    find_in_pictures(robot, client, arguments.task, arguments.find)
    if isinstance(robot, Arm):
        robot.confirm_viewpoint = Person(robot).confirm_viewpoint
    failed = 0
    while ask("Enter to record, q to end: ") not in ("q", None):
        asked = (arguments.task, arguments.instruction, arguments.objects, arguments.rate_hz)
        _record_one(robot, spool, *asked, guide=arguments.guide, teleop=arguments.teleop)
        failed |= _send_all(client, spool)
    return failed


def offer_correction(client: RoboPromptClient, robot: Robot, task: str, instruction: str) -> None:
    """After a run that failed, offer to record a demonstration of how it is done."""
    if not hasattr(robot, "state") or not ask_yes("Show how it is done? Put the scene back first. [y/N] "):
        return
    spool = Spool(SPOOL)
    guide = isinstance(robot, Arm) and isinstance(robot.driver, Guidable)
    _record_one(robot, spool, task, instruction, None, RATE_HZ, guide=guide, teleop=None)
    _send_all(client, spool)


def _record_one(
    robot: Robot,
    spool: Spool,
    task: str,
    instruction: str,
    objects: Path | None,
    rate_hz: float,
    *,
    guide: bool,
    teleop: str | None,
) -> None:
    """Record one demonstration; an interrupted one stays in the spool."""
    try:
        seen = _seen(robot, objects)
    except CameraError as error:
        say(str(error))
        return
    folder = spool.new(task, instruction, seen)
    arm: HasState = robot  # type: ignore[assignment]  # checked by the caller: it has `state`
    try:
        trajectory = record_live(arm, folder / JOURNAL, rate_hz, guide=guide, teleop=teleop)
    except (MotionError, InvalidInputError) as error:
        if (folder / JOURNAL).exists():
            say(f"{error}; the recording until then is kept in {folder}")
            return
        spool.discard(folder)
        if isinstance(error, InvalidInputError):  # the next recording would fail, too
            raise
        say(str(error))
        return
    except KeyboardInterrupt:
        say(f"kept in {folder}: `roboprompt-robot record --send-only` uploads it")
        raise
    if trajectory is None:
        spool.discard(folder)
        return
    say(f"{len(trajectory)} frames, {trajectory.num_joints} joints")


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


def record_live(
    arm: HasState, journal: Path, rate_hz: float, *, guide: bool = False, teleop: str | None = None
) -> Trajectory | None:
    """Record until the person ends it; keys open and close the gripper, and a line shows the progress.

    Args:
        guide: let the arm yield to the person's hand.
        teleop: `keyboard` or `spacemouse`, to steer the hand with; None: neither.

    Returns:
        the recording, or None if the person discards it.

    Raises:
        InvalidInputError: if the arm cannot be guided or steered as asked, or the recording is invalid.
        MotionError, KeyboardInterrupt: if arm or person ended it; the journal has the recording until then.
    """
    with ExitStack() as led:
        read = _no_motion if teleop is None else led.enter_context(opened(teleop))
        steer = _led(arm, led, guide=guide, steers=teleop is not None)
        recorder = Recorder(arm, journal, rate_hz)
        recorder.start()
        try:
            keep = _until_ended(arm, recorder, read, steer)
        except BaseException:
            with suppress(MotionError, InvalidInputError):
                recorder.stop()
            raise
        trajectory = recorder.stop()
    return trajectory if keep else None


def _led(arm: HasState, led: ExitStack, *, guide: bool, steers: bool) -> Steer | None:
    """Let the arm be guided or steered until `led` is closed; return the function that steers it, or None."""
    if guide:
        if not hasattr(arm, "guided"):
            raise InvalidInputError("--guide", "this robot cannot be guided", AN_ARM)
        led.enter_context(arm.guided())
    if not steers:
        return None
    if not hasattr(arm, "steered"):
        raise InvalidInputError("--teleop", "this robot cannot be steered", AN_ARM)
    steer: Steer = led.enter_context(arm.steered())
    return steer


def _no_motion(keys: str) -> Said:
    return Said(np.zeros(6), keys)


def _until_ended(arm: HasState, recorder: Recorder, read: Read, steer: Steer | None) -> bool:
    """Serve the person's keys until they end the recording; return whether they keep it."""
    _show(f"{KEYS}\n" if steer is None else f"{MOVES}\n{KEYS}\n")
    shown_s, moving, problem = 0.0, False, ""
    with keyboard() as pressed:
        while True:
            said = read(pressed(SHOWN_S if steer is None else TICK_S))
            for key in said.keys:
                if key in KEEP or key == END:
                    _show("\n")
                    return key != END
                if key in (OPEN, CLOSE) and hasattr(arm, "set_gripper"):
                    arm.set_gripper(is_open=key == OPEN)
            if steer is not None and (
                moving or said.direction.any()
            ):  # once more with zeros, so that the hand stops at once
                refusal = steer(SPEED_M_S * said.direction[:3], TURN_RAD_S * said.direction[3:])
                moving = bool(said.direction.any())
                problem = refusal if moving else problem
            if (progress := recorder.progress) is not None and time.monotonic() - shown_s > SHOWN_S:
                shown_s = time.monotonic()
                _show(f"\r{problem[:MAX_LINE_CHARS] or _line(progress)}{CLEAR_LINE}")


def _line(progress: Progress) -> str:
    state = progress.state
    x_m, y_m, z_m = state.position_m
    width = "" if state.gripper_width_m is None else f"  gripper {1000 * state.gripper_width_m:3.0f} mm"
    return f"{progress.elapsed_s:6.1f} s  {progress.rate_hz:4.0f} Hz  hand {x_m:+.3f} {y_m:+.3f} {z_m:+.3f} m{width}"


def _show(text: str) -> None:
    print(text, end="", file=sys.stderr, flush=True)
