"""One demonstration at the terminal: what is recorded is shown as it comes, and keys move the gripper and end it."""

import sys
import time
from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from roboprompt_client.arms.steering import Steer
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.recorder import HasState, Progress, Recorder
from roboprompt_client.teleop import KEYS as MOVES
from roboprompt_client.teleop import SPEED_M_S, TICK_S, TURN_RAD_S, Read, Said, opened
from roboprompt_client.terminal import END, keyboard
from roboprompt_client.trajectory import Trajectory

KEYS = "o: open the gripper   c: close it   x: discard   Enter: keep"
OPEN, CLOSE, KEEP = "o", "c", "\r\n"
SHOWN_S = 0.2
MAX_LINE_CHARS, CLEAR_LINE = 78, "\x1b[K"
AN_ARM = "an Arm, such as that of a cell's file"


@runtime_checkable
class HasGripper(Protocol):
    """What the keys can open and close, such as an `Arm`."""

    def set_gripper(self, *, is_open: bool) -> None:
        """Return when it is done."""
        ...


@runtime_checkable
class CanBeGuided(Protocol):
    """What a person can move by hand, such as an `Arm`."""

    def guided(self) -> AbstractContextManager[None]:
        """While it lasts the arm yields to the hand."""
        ...


@runtime_checkable
class CanBeSteered(Protocol):
    """What follows a person's keys, such as an `Arm`."""

    def steered(self) -> AbstractContextManager[Steer]:
        """While it lasts the hand follows the velocities that are sent."""
        ...


def record_live(
    arm: HasState, journal: Path, rate_hz: float, *, guide: bool = False, teleop: str | None = None
) -> Trajectory | None:
    """Record until the person ends it.

    Args:
        guide: let the arm yield to the person's hand meanwhile.
        teleop: `keyboard` or `spacemouse`, with which the person steers the hand meanwhile; None: neither.

    Returns:
        what was recorded; None where the person discards it.

    Raises:
        InvalidInputError: if the arm can be neither guided nor steered, or what was recorded is no trajectory.
        MotionError: if the arm stopped answering or moving; the journal has what came before.
        KeyboardInterrupt: likewise.
    """
    with ExitStack() as led:
        read = _nothing if teleop is None else led.enter_context(opened(teleop))
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
    """The velocity that the hand follows, if any; what begins ends with `led`."""
    if guide:
        if not isinstance(arm, CanBeGuided):
            raise InvalidInputError("--guide", "this robot cannot be guided", AN_ARM)
        led.enter_context(arm.guided())
    if not steers:
        return None
    if not isinstance(arm, CanBeSteered):
        raise InvalidInputError("--teleop", "this robot cannot be steered", AN_ARM)
    return led.enter_context(arm.steered())


def _nothing(keys: str) -> Said:
    return Said(np.zeros(6), keys)


def _until_ended(arm: HasState, recorder: Recorder, read: Read, steer: Steer | None) -> bool:
    """Whether the person keeps the recording."""
    _show(f"{KEYS}\n" if steer is None else f"{MOVES}\n{KEYS}\n")
    shown_s, moving, problem = 0.0, False, ""
    with keyboard() as pressed:
        while True:
            said = read(pressed(SHOWN_S if steer is None else TICK_S))
            for key in said.keys:
                if key in KEEP or key == END:
                    _show("\n")
                    return key != END
                if key in (OPEN, CLOSE) and isinstance(arm, HasGripper):
                    arm.set_gripper(is_open=key == OPEN)
            if steer is not None and (moving or said.direction.any()):  # once more with zeros: then it rests at once
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
    print(text, end="", file=sys.stderr, flush=True)  # noqa: T201
