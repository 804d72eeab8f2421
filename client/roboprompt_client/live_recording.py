"""One demonstration at the terminal: what is recorded is shown as it comes, and keys move the gripper and end it."""

import sys
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from typing import Protocol, runtime_checkable

from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.recorder import HasState, Progress, Recorder
from roboprompt_client.terminal import END, keyboard
from roboprompt_client.trajectory import Trajectory

KEYS = "o: open the gripper   c: close it   x: discard   Enter: keep"
OPEN, CLOSE, KEEP = "o", "c", "\r\n"
SHOWN_S = 0.2


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


def record_live(arm: HasState, journal: Path, rate_hz: float, *, guide: bool) -> Trajectory | None:
    """Record until the person ends it.

    Args:
        guide: let the arm yield to the person's hand meanwhile.

    Returns:
        what was recorded; None where the person discards it.

    Raises:
        InvalidInputError: if the arm cannot be guided, or what was recorded is no trajectory.
        MotionError: if the arm stopped answering or moving; the journal has what came before.
        KeyboardInterrupt: likewise.
    """
    if guide and not isinstance(arm, CanBeGuided):
        raise InvalidInputError("--guide", "this robot cannot be guided", "an Arm, such as that of a cell's file")
    recorder = Recorder(arm, journal, rate_hz)
    with arm.guided() if guide and isinstance(arm, CanBeGuided) else nullcontext():
        recorder.start()
        try:
            keep = _until_ended(arm, recorder)
        except BaseException:
            with suppress(MotionError, InvalidInputError):
                recorder.stop()
            raise
        trajectory = recorder.stop()
    return trajectory if keep else None


def _until_ended(arm: HasState, recorder: Recorder) -> bool:
    """Whether the person keeps the recording."""
    _show(f"{KEYS}\n")
    with keyboard() as pressed:
        while True:
            for key in pressed(SHOWN_S):
                if key in KEEP or key == END:
                    _show("\n")
                    return key != END
                if key in (OPEN, CLOSE) and isinstance(arm, HasGripper):
                    arm.set_gripper(is_open=key == OPEN)
            if (progress := recorder.progress) is not None:
                _show(f"\r{_line(progress)} ")


def _line(progress: Progress) -> str:
    state = progress.state
    x_m, y_m, z_m = state.position_m
    width = "" if state.gripper_width_m is None else f"  gripper {1000 * state.gripper_width_m:3.0f} mm"
    return f"{progress.elapsed_s:6.1f} s  {progress.rate_hz:4.0f} Hz  hand {x_m:+.3f} {y_m:+.3f} {z_m:+.3f} m{width}"


def _show(text: str) -> None:
    print(text, end="", file=sys.stderr, flush=True)  # noqa: T201
