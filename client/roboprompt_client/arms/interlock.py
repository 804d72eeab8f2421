"""One motion of an arm at a time, and none after a stop."""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from roboprompt_client.arms.driver import LOOK_FIRST, Driver
from roboprompt_client.errors import MotionError

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
