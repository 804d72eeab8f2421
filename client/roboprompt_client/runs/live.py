"""Report a run to the service while the robot works, so that people can watch it and stop it there.

    run_task(client, robot, "pick", "pick up the cube", watch=partial(Live, client, robot, on_lost="stop"))

If a person presses Stop on the service's page `Now`, the answer to the next report says so: within 0.2 s if machine and
network are not busy. This does not replace an emergency stop.
"""

import logging
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Literal
from uuid import uuid4

from roboprompt_client.client import RoboPromptClient
from roboprompt_client.errors import (
    InvalidInputError,
    MotionError,
    ServiceProblemError,
    ServiceUnreachableError,
    StoppedError,
)
from roboprompt_client.robot import Robot
from roboprompt_client.runs.loop import CarryingOut
from roboprompt_client.types.poses import EndEffectorAction

log = logging.getLogger(__name__)
OnLost = Literal["continue", "stop"]
PERIOD_S = 0.2
BY_A_PERSON = "a person stopped the robot from the service's page"
LOST_S = 1.0  # without an answer contact counts as lost; also the timeout of one request


def checked_on_lost(value: object) -> OnLost:
    """Return what the robot does when contact is lost; raises InvalidInputError for another value."""
    if value not in ("continue", "stop"):
        raise InvalidInputError("lost_contact", f"is {value!r:.40}", "continue or stop")
    return value


class Live:
    """Report a run five times a second from a thread, and stop the robot from that thread.

    Args:
        robot: its `stop` is called from that thread; also its `state`, if it has one as `Arm` does.
        on_lost: what the robot does when the service has not answered for a second.
    """

    def __init__(
        self, client: RoboPromptClient, robot: Robot, task: str, instruction: str, *, on_lost: OnLost = "continue"
    ) -> None:
        self.id = uuid4().hex
        self._client, self._robot, self._on_lost = client, robot, checked_on_lost(on_lost)
        self._said: dict[str, Any] = {"task": task, "instruction": instruction}
        self._ended = threading.Event()
        self._stopped_by = ""
        self._thread = threading.Thread(target=self._report, name="live", daemon=True)

    def __enter__(self) -> CarryingOut:
        self._thread.start()
        return self._carrying_out

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Raise StoppedError if a person stopped the run after its last motion, so that no further run begins."""
        self._ended.set()
        self._thread.join()
        with suppress(ServiceProblemError, ServiceUnreachableError):  # the service forgets the run by itself
            if self._client.end_run(self.id, LOST_S):
                self._stopped_by = self._stopped_by or BY_A_PERSON
        if kind is None:
            self._refuse_if_stopped()

    @contextmanager
    def _carrying_out(self, index: int, action: EndEffectorAction, prediction_id: str | None) -> Iterator[None]:
        """Wrap the motion of an action; raise StoppedError before or after it if the run was stopped."""
        target = {"position": action.position_m.tolist(), "quaternion_xyzw": action.quaternion_xyzw.tolist()}
        known = {} if prediction_id is None else {"prediction_id": prediction_id}
        self._said = {**self._said, **known, "action": index + 1, "target": target}
        self._refuse_if_stopped()
        try:
            yield
        except MotionError as error:
            self._refuse_if_stopped(error)
            raise
        self._refuse_if_stopped()

    def _refuse_if_stopped(self, error: MotionError | None = None) -> None:
        if self._stopped_by:
            raise StoppedError(self._stopped_by) from error

    def _report(self) -> None:
        heard_s, warned = time.monotonic(), False
        while not self._ended.is_set():
            begun_s = time.monotonic()
            if self._stopped_by:  # again, because a motion may have begun just before the first stop
                self._stop(self._stopped_by)
            try:
                if self._client.report_run(self.id, {**self._said, **self._state()}, LOST_S):
                    self._stop(BY_A_PERSON)
                heard_s, warned = time.monotonic(), False
            except Exception as error:  # no error may end the thread that can stop the robot
                if time.monotonic() - heard_s >= LOST_S and not warned:
                    warned = True
                    log.warning("contact with the service is lost: %s", error)
                    if self._on_lost == "stop":
                        self._stop(f"no contact with the service for {LOST_S:g} s: {error}")
            self._ended.wait(max(0.0, begun_s + PERIOD_S - time.monotonic()))

    def _stop(self, why: str) -> None:
        self._stopped_by = why
        try:
            self._robot.stop()
        except Exception as error:  # tried again at the next report
            log.warning("the robot does not stop: %s", error)

    def _state(self) -> Mapping[str, Any]:
        """Return the robot's pose and joints for the report; empty if it has no `state` or it fails."""
        if not callable(state := getattr(self._robot, "state", None)):
            return {}
        try:
            now = state()
        except Exception as error:  # no error may end the thread that can stop the robot
            log.debug("the robot's state is not known: %s", error)
            return {}
        joints = now.joint_positions_rad
        return {
            "end_effector": {"position": now.position_m.tolist(), "quaternion_xyzw": now.quaternion_xyzw.tolist()},
            **({} if joints is None else {"joint_positions": joints.tolist()}),
        }
