"""A person moves the hand: with the keys of a terminal, or with a SpaceMouse.

A direction is (6,): along the world's x, y, z and about them, each -1 to 1, 1 being the full speed. Where the base is
not turned x points away from it, y to its left, z up.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from roboprompt_client.arrays import Array
from roboprompt_client.errors import InvalidInputError
from roboprompt_client.extras import import_extra
from roboprompt_client.terminal import has_keyboard

SPEED_M_S, TURN_RAD_S = 0.10, 0.5
TICK_S = 0.04  # between two commands to the arm
HELD_S = 0.15  # after its last press a key counts as held: terminals repeat it 20 to 30 times a second
# A key that is tapped moves the hand by millimeters, one that is held has its full speed after a while.
TAPPED_SHARE, FULL_AFTER_S = 0.2, 1.0
STALE_S = 0.2  # a SpaceMouse that is pushed reports more often
MAX_REPORTS = 64  # that are read at once
DEAD_SHARE = 0.05  # of a cap's travel: what a hand that rests on it does

_ALONG, _ABOUT = np.eye(6)[:3], np.eye(6)[3:]
DIRECTIONS: Mapping[str, Array] = {
    key: sign * axis
    for keys, axis in zip(("ws", "ad", "rf", "lj", "ik", "qe"), (*_ALONG, *_ABOUT), strict=True)
    for key, sign in zip(keys, (1.0, -1.0), strict=True)
}
KEYS = "w s: away, nearer   a d: left, right   r f: up, down   q e: turn   i k, j l: tilt"


class Said(NamedTuple):
    """What a person wants: a direction (6,), and the keys of the recording that were pressed."""

    direction: Array
    keys: str


Read = Callable[[str], Said]  # from the keys that were pressed since the last call


class HeldKeys:
    """Since when, and until when, each key counts as held."""

    def __init__(self) -> None:
        self._spans_s: dict[str, tuple[float, float]] = {}

    def press(self, key: str, now_s: float) -> None:
        """Note one of `DIRECTIONS`."""
        since_s, until_s = self._spans_s.get(key, (now_s, now_s))
        self._spans_s[key] = (since_s if now_s < until_s else now_s, now_s + HELD_S)

    def direction(self, now_s: float) -> Array:
        """(6,), of all that are held."""
        total: Array = np.zeros(6)
        for key, (since_s, until_s) in self._spans_s.items():
            if now_s < until_s:
                total = total + min(1.0, TAPPED_SHARE + (now_s - since_s) / FULL_AFTER_S) * DIRECTIONS[key]
        return total


class SpaceMouse:
    """A 3Dconnexion SpaceMouse, seen from the side of the base; its buttons close (left) and open (right).

    Args:
        device: of pyspacemouse, its axes as ROS has them.
        clock: that of the device's reports.
    """

    def __init__(self, device: Any, clock: Callable[[], float] = time.perf_counter) -> None:  # noqa: ANN401
        self._device, self._clock = device, clock
        self._down = (False, False)

    def read(self, keys: str) -> Said:
        """What it reported last; a report that is old, of a device that was unplugged, moves nothing."""
        state = self._last()
        down = tuple(bool(button) for button in (*state.buttons, 0, 0)[:2])
        clicked = "".join(key for key, now, before in zip("co", down, self._down, strict=True) if now and not before)
        self._down = (down[0], down[1])
        pushed = np.array([state.x, state.y, state.z, state.roll, state.pitch, state.yaw], float)
        pushed[np.abs(pushed) < DEAD_SHARE] = 0.0
        fresh = self._clock() - state.t < STALE_S
        return Said(np.clip(pushed, -1, 1) if fresh else np.zeros(6), keys + clicked)

    def _last(self) -> Any:  # noqa: ANN401
        """The state after all reports that wait: one is read at a time, and several come between two ticks."""
        for _ in range(MAX_REPORTS):
            before_s = self._device.read().t
            if self._device.read().t == before_s:
                break
        return self._device.read()


@contextmanager
def opened(device: str) -> Iterator[Read]:
    """What a person moves the hand with.

    Args:
        device: `keyboard` or `spacemouse`.

    Raises:
        InvalidInputError: if there is no such device, or its package is not installed.
    """
    if device == "keyboard":
        if not has_keyboard():
            raise InvalidInputError("--teleop", "standard input is no terminal whose keys can be read", "a terminal")
        yield _of_keyboard(HeldKeys())
        return
    package = import_extra("pyspacemouse", "pyspacemouse", "spacemouse")
    try:
        mouse = package.open(axis_convention=package.AxisConvention.ROS)
    except (RuntimeError, OSError, ValueError) as error:
        remedy = "one that is plugged in and that this user may read (udev)"
        raise InvalidInputError("--teleop", f"no SpaceMouse: {error}", remedy) from error
    with mouse:
        yield SpaceMouse(mouse).read


def _of_keyboard(held: HeldKeys) -> Read:
    def read(keys: str) -> Said:
        now_s = time.monotonic()
        for key in keys:
            if key in DIRECTIONS:
                held.press(key, now_s)
        return Said(held.direction(now_s), keys)

    return read
