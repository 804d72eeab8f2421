"""What stops an arm: a stop, which holds until `recover` (`Interlock`), and what `Tolerance` does not allow."""

import logging
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields

from roboprompt_client.arms.driver import LOOK_FIRST, ArmState, Driver
from roboprompt_client.errors import MotionError
from roboprompt_client.motion.limits import checked_bound
from roboprompt_client.types.poses import EndEffectorAction

log = logging.getLogger(__name__)
MAX_START_S = 0.2


class Interlock:
    """Gives commands to a driver. After a stop, or an error within `alone`, it gives none until `recover`."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver
        self._stopped, self._moving = threading.Event(), threading.Lock()
        self._starting = threading.Lock()  # held while a command is given

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Allow one motion at a time, and stop the arm if it fails."""
        if not self._moving.acquire(blocking=False):
            raise MotionError("another thread is moving the arm")
        try:
            yield
        except BaseException:
            self.stop()
            raise
        finally:
            self._moving.release()

    def begin(self, command: Callable[[], object]) -> None:
        """Give a command: a stop of another thread comes either before it or after it."""
        with self._starting:
            self.refuse_if_stopped()
            command()
        self.refuse_if_stopped()

    def wait(self, most_s: float, check: Callable[[], None] = lambda: None) -> None:
        """Wait for the end of a motion; raises MotionError after `most_s` or a stop, and what `check` raises."""
        end_s = time.monotonic() + most_s
        while not self._driver.finished():
            self.refuse_if_stopped()
            check()
            if time.monotonic() > end_s:
                raise MotionError(f"the motion did not end within {most_s:g} s")
        self.refuse_if_stopped()

    def refuse_if_stopped(self) -> None:
        """Raise MotionError after a stop."""
        if self._stopped.is_set():
            raise MotionError(f"the arm was stopped: {LOOK_FIRST}")

    def stop(self) -> None:
        """Stop, from any thread; an error of the driver is logged, so that it hides no other."""
        self._stopped.set()
        if not self._starting.acquire(blocking=False):
            self._halt()  # at once, and again after the command that another thread is giving
            if not self._starting.acquire(timeout=MAX_START_S):  # do not wait for a driver that hangs
                self._halt()
                return
        try:
            self._halt()
        finally:
            self._starting.release()

    def recover(self) -> None:
        """Let the arm move again; a stop meanwhile holds."""
        with self._starting:
            self._stopped.clear()
            try:
                self._driver.recover()
            except BaseException:
                self._stopped.set()
                raise

    def _halt(self) -> None:
        try:
            self._driver.halt()
        except Exception as error:  # of any kind, from a driver of the user's own
            log.error("%s: the stop was not confirmed: %s", self._driver.name, error or type(error).__name__)


@dataclass(frozen=True)
class Tolerance:
    """How exactly the end effector must arrive, how long a motion may take, and how much force it may meet.

    Attributes:
        max_contact_force_n: checked about 20 times a second while the arm moves; None: not checked.

    Raises:
        InvalidInputError: for a bound that is not a finite number above 0.
    """

    position_m: float = 0.005
    rotation_deg: float = 2.0
    width_m: float = 0.004
    motion_s: float = 120.0
    max_contact_force_n: float | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            if (value := getattr(self, field.name)) is not None or field.default is not None:
                checked_bound(f"tolerance.{field.name}", value)

    def check_pose(self, state: ArmState, action: EndEffectorAction) -> None:
        """Raise MotionError if the end effector is not at the action's pose, both in the world frame."""
        off_m, off_deg = state.distance_to(action.position_m, action.quaternion_xyzw)
        if not (off_m <= self.position_m and off_deg <= self.rotation_deg):
            raise MotionError(f"the motion ended {1000 * off_m:.1f} mm and {off_deg:.1f} degrees off its target")

    def check_contact(self, state: Callable[[], ArmState]) -> None:
        """Raise MotionError if the hand meets too much force; `state` is called only if there is a bound."""
        if (most_n := self.max_contact_force_n) is not None and (now := state()).force_n > most_n:
            where_m = now.position_m.round(3).tolist()
            raise MotionError(f"the hand met {now.force_n:.1f} N at {where_m} m, at most {most_n:g} N are allowed")

    def check_gripper(self, width_m: float, open_width_m: float, *, is_open: bool) -> None:
        """Raise MotionError if the fingers, at least `open_width_m` apart when open, did not do as commanded."""
        if not math.isfinite(width_m):
            raise MotionError(f"the gripper's width is {width_m} m: whether it did as commanded is not known")
        is_closed, is_wide = width_m <= self.width_m, width_m >= open_width_m - self.width_m
        if is_open and (is_closed or not is_wide):
            of_mm = f"{1000 * width_m:.1f} of {1000 * open_width_m:.1f} mm"
            raise MotionError(f"the gripper was to open, but measures {of_mm}")
        if not is_open and is_wide and not is_closed:
            message = f"the gripper was to close, but still measures {1000 * width_m:.1f} mm"
            raise MotionError(f"{message} (if it held something before: give the cell `open_width_m`)")
