"""Read a person's keys at a terminal, a SpaceMouse or a leader arm, with which they steer the hand.

A direction is (6,): motions along and about the world's x, y, z, each -1 to 1, where 1 is full speed. If the base is
not rotated in the world, x points away from it, y to its left, z up.
"""

import os
import re
import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.extras import make_driver
from roboprompt_client.types.arrays import Array

MAX_KEYS = 64  # per read
END = "x"  # also read from a terminal that was closed
SPEED_M_S, TURN_RAD_S = 0.10, 0.5
TICK_S = 0.04  # between two commands to the arm
HELD_S = 0.15  # a key counts as held so long after its last press; terminals repeat it 20 to 30 times a second
# A tap moves the hand by millimeters; a held key reaches full speed after a while.
TAPPED_SHARE, FULL_AFTER_S = 0.2, 1.0
STALE_S = 0.2  # a SpaceMouse reports more often while it is pushed
MAX_REPORTS, MAX_REPORT_BYTES = 64, 64  # per read
FULL_TRAVEL = 350  # reported at the end of the cap's travel
TO_WORLD = (1, 0, 2, 4, 3, 5)  # the world's axis of each axis of the cap, with the opposite sign
HIDRAW = Path("/sys/class/hidraw")
MADE_BY_3DCONNEXION = r"HID_ID=\w+:0000(256F:\w+|046D:0000C6\w\w)"  # also those sold by Logitech
DEAD_SHARE = 0.05  # of the cap's travel is ignored: a resting hand moves it so far

_ALONG, _ABOUT = np.eye(6)[:3], np.eye(6)[3:]
DIRECTIONS: Mapping[str, Array] = {
    key: sign * axis
    for keys, axis in zip(("ws", "ad", "rf", "lj", "ik", "qe"), (*_ALONG, *_ABOUT), strict=True)
    for key, sign in zip(keys, (1.0, -1.0), strict=True)
}
MOVES = "w s: away, nearer   a d: left, right   r f: up, down   q e: turn   i k, j l: tilt"


class PersonInput(NamedTuple):
    """A person's input: a direction (6,) and the keys that were pressed."""

    direction: Array
    keys: str


Pressed = Callable[[float], str]
Read = Callable[[str], PersonInput]  # argument: the keys pressed since the last call


def has_keyboard() -> bool:
    """Return whether standard input is a terminal, whose keys can be read one by one."""
    return sys.stdin.isatty()


@contextmanager
def keyboard() -> Iterator[Pressed]:
    """Yield a function that returns the keys pressed since its last call; it waits for one at most the given seconds.

    Within the context keys are not echoed. If standard input is not a terminal, the function waits for a line.
    """
    if not has_keyboard():
        yield _line
        return
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin, termios.TCSADRAIN)  # keys typed before still count
    try:
        yield _pressed
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _pressed(wait_s: float) -> str:
    ready, _, _ = select.select([sys.stdin], [], [], wait_s)
    if not ready:
        return ""
    return os.read(sys.stdin.fileno(), MAX_KEYS).decode(errors="ignore") or END


def _line(_wait_s: float) -> str:
    try:
        return input("").strip() or "\n"
    except EOFError:
        return "\n"


class HeldKeys:
    """Which keys are held, and since when: terminals report presses only."""

    def __init__(self) -> None:
        self._spans_s: dict[str, tuple[float, float]] = {}

    def read(self, keys: str) -> PersonInput:
        """Note keys that were pressed since the last call; return the direction."""
        now_s = time.monotonic()
        for key in keys:
            if key in DIRECTIONS:
                self.press(key, now_s)
        return PersonInput(self.direction(now_s), keys)

    def press(self, key: str, now_s: float) -> None:
        """Note the press of a key of `DIRECTIONS`."""
        since_s, until_s = self._spans_s.get(key, (now_s, now_s))
        self._spans_s[key] = (since_s if now_s < until_s else now_s, now_s + HELD_S)

    def direction(self, now_s: float) -> Array:
        """Return the sum (6,) of the held keys' directions."""
        total: Array = np.zeros(6)
        for key, (since_s, until_s) in self._spans_s.items():
            if now_s < until_s:
                total = total + min(1.0, TAPPED_SHARE + (now_s - since_s) / FULL_AFTER_S) * DIRECTIONS[key]
        return total


class SpaceMouse:
    """A 3Dconnexion SpaceMouse, read by its raw reports; its buttons close (left) and open (right) the gripper.

    Reports 1 and 2 have little-endian int16 along and about the cap's axes (right, toward the person, down), in one
    report or in two; report 3 has the buttons' bits.

    Args:
        reports: a non-blocking file descriptor of Linux's hidraw; each read is one report.
    """

    def __init__(self, reports: int) -> None:
        self._reports = reports
        self._pushed: Array = np.zeros(6)
        self._came_s = -np.inf
        self._buttons = 0

    def read(self, keys: str) -> PersonInput:
        """Return the last report's direction, zero if the report is old, and the keys with the buttons' clicks."""
        buttons = self._buttons
        with suppress(OSError):  # no report waits, or the device was unplugged
            for _ in range(MAX_REPORTS):
                self._take(os.read(self._reports, MAX_REPORT_BYTES))
        clicked = "".join(key for bit, key in ((1, "c"), (2, "o")) if self._buttons & bit and not buttons & bit)
        fresh = time.monotonic() - self._came_s < STALE_S
        pushed = np.where(np.abs(self._pushed) < DEAD_SHARE, 0.0, np.clip(self._pushed, -1, 1))
        return PersonInput(pushed if fresh else np.zeros(6), keys + clicked)

    def _take(self, report: bytes) -> None:
        if report[:1] == b"\x03":
            self._buttons = report[1]
            return
        first = {b"\x01": 0, b"\x02": 3}.get(report[:1])
        if first is None:
            return
        values = np.frombuffer(report[1:], "<i2", count=min(6 - first, (len(report) - 1) // 2))
        for axis, value in zip(TO_WORLD[first:], values, strict=False):
            self._pushed[axis] = -value / FULL_TRAVEL
        self._came_s = time.monotonic()


@contextmanager
def opened(device: str) -> Iterator[Read]:
    """Yield the function that reads a person's input from a device.

    Args:
        device: `keyboard`, `spacemouse`, or MODULE:FACTORY of a `Leader`, see the module `leader`.

    Raises:
        InvalidInputError: if the device is missing, or this user may not read it.
        MotionError: if a leader arm does not answer.
    """
    if ":" in device:
        leader = make_driver("--teleop", device, {}, {})
        if not hasattr(leader, "read"):
            raise InvalidInputError("--teleop", f"{device} makes a {type(leader).__name__}", "a factory of a Leader")
        with leader:
            yield leader.read
        return
    if device == "keyboard":
        if not has_keyboard():
            raise InvalidInputError("--teleop", "standard input is not a terminal", "a terminal")
        yield HeldKeys().read
        return
    path = _space_mouse()
    try:
        reports = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError as error:
        raise InvalidInputError(
            "--teleop", f"{path} cannot be read: {error}", "a udev rule that allows this user"
        ) from error
    try:
        yield SpaceMouse(reports).read
    finally:
        os.close(reports)


def _space_mouse() -> Path:
    """Return the device file of a SpaceMouse that is plugged in."""
    for device in sorted(HIDRAW.glob("hidraw*")):
        uevent = (device / "device/uevent").read_text()
        if re.search(MADE_BY_3DCONNEXION, uevent):
            return Path("/dev") / device.name
    raise InvalidInputError("--teleop", "no SpaceMouse is plugged in", "Linux, and a 3Dconnexion SpaceMouse")
