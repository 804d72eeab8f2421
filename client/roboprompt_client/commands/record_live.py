"""Record while a person moves the arm and presses keys at a terminal, which shows a line of progress."""

import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np

from roboprompt_client.arms.arm import Arm, Steer
from roboprompt_client.arms.driver import Guidable, Steerable
from roboprompt_client.cameras.rig import MountedCamera
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.recording.recorder import HasState, Progress, Recorder
from roboprompt_client.recording.teleop import (
    END,
    MOVES,
    SPEED_M_S,
    TICK_S,
    TURN_RAD_S,
    PersonInput,
    Read,
    keyboard,
    opened,
)
from roboprompt_client.types.film import FILM_HZ
from roboprompt_client.types.trajectory import Trajectory

KEYS = "o: open the gripper   c: close it   x: discard   Enter: keep"
OPEN, CLOSE, KEEP = "o", "c", "\r\n"
SHOWN_S = 0.2
MAX_LINE_CHARS, CLEAR_LINE = 78, "\x1b[K"


def require_movable(arm: object, *, guide: bool, teleop: str | None) -> None:
    """Check before a recording that the arm can be moved as asked.

    Raises:
        InvalidInputError: if the arm cannot be guided or steered, or the device is not there.
        MotionError: if the device does not answer.
    """
    driver = getattr(arm, "driver", None)
    if guide and not isinstance(driver, Guidable):
        raise InvalidInputError("--guide", "this arm cannot be guided by its driver", "its maker's button")
    if teleop is None:
        return
    if not isinstance(driver, Steerable):
        raise InvalidInputError("--teleop", "this arm cannot be steered by its driver", "another arm")
    with opened(teleop):
        pass


def record_live(
    arm: HasState,
    journal: Path,
    rate_hz: float,
    *,
    guide: bool = False,
    teleop: str | None = None,
    film_hz: float = FILM_HZ,
) -> Trajectory | None:
    """Record until the person ends it; keys open and close the gripper, and a line shows the progress.

    Args:
        guide: let the arm yield to the person's hand.
        teleop: the device to steer the hand with, as of `opened`; None: no device.
        film_hz: pictures a second that the arm's cameras take; 0: none.

    Returns:
        the recording, or None if the person discards it.

    Raises:
        InvalidInputError: if the arm cannot be guided or steered as asked, or the recording is invalid.
        MotionError, KeyboardInterrupt: if arm or person ended it; the journal has the recording until then.
    """
    with ExitStack() as stack:
        read = _no_motion if teleop is None else stack.enter_context(opened(teleop))
        steer = _moved(arm, stack, guide=guide, steers=teleop is not None)
        recorder = Recorder(arm, journal, rate_hz, _filming(arm), film_hz)
        recorder.start()
        try:
            keep = _until_ended(arm, recorder, read, steer)
        except BaseException:
            _show("\n")
            with suppress(MotionError, InvalidInputError):
                recorder.stop()
            raise
        trajectory = recorder.stop()
    return trajectory if keep else None


def _filming(arm: HasState) -> list[MountedCamera]:
    """Return the cameras that can film: not those that replay recorded frames, which a later picture needs."""
    rig = arm.cameras if isinstance(arm, Arm) else None
    return [] if rig is None else [item for item in rig.cameras if not getattr(item.driver, "recorded", False)]


def _moved(arm: HasState, stack: ExitStack, *, guide: bool, steers: bool) -> Steer | None:
    """Let the arm be guided or steered until `stack` is closed; return the function that steers it, or None."""
    if guide:
        stack.enter_context(arm.guided())  # type: ignore[attr-defined]  # see `require_movable`
    if not steers:
        return None
    steer: Steer = stack.enter_context(arm.steered())  # type: ignore[attr-defined]  # see `require_movable`
    return steer


def _no_motion(keys: str) -> PersonInput:
    return PersonInput(np.zeros(6), keys)


def _until_ended(arm: HasState, recorder: Recorder, read: Read, steer: Steer | None) -> bool:
    """Serve the person's keys until they end the recording; return whether they keep it."""
    _show(f"{KEYS}\n" if steer is None else f"{MOVES}\n{KEYS}\n")
    shown_s, moving, problem = 0.0, False, ""
    with keyboard() as pressed:
        while True:
            given = read(pressed(SHOWN_S if steer is None else TICK_S))
            for key in given.keys:
                if key in KEEP or key == END:
                    _show("\n")
                    return key != END
                if key in (OPEN, CLOSE) and hasattr(arm, "set_gripper"):
                    arm.set_gripper(is_open=key == OPEN)
            if steer is not None and (
                moving or given.direction.any()
            ):  # once more with zeros, so that the hand stops at once
                refusal = steer(SPEED_M_S * given.direction[:3], TURN_RAD_S * given.direction[3:])
                moving = bool(given.direction.any())
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
