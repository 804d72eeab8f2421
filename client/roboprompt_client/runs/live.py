"""A robot that is watched: while it works the service hears where it is, and may stop it.

    run_task(client, robot, "pick", "pick up the cube", watch=partial(Live, client, robot, on_lost="stop"))

Where a person presses Stop on the service's page `Now` the answer to the next report says so, at most 0.2 s later on a
machine and a network that are not busy. This replaces no emergency stop.
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
LOST_S = 1.0  # without an answer; also how long one request may take


def checked_on_lost(value: object) -> OnLost:
    """What a robot does without contact; raises InvalidInputError for what is none of both."""
    if value not in ("continue", "stop"):
        raise InvalidInputError("lost_contact", f"is {value!r:.40}", "continue or stop")
    return value


class Live:
    """Reports a run five times a second from a thread of its own, and stops the robot from there.

    Args:
        robot: its `stop` is called from that thread, and so is its `state`, if it has one as `Arm` has.
        on_lost: what the robot does where the service has not answered for a second.
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
        """Raises StoppedError if somebody stopped the run after its last motion: there may be more to come."""
        self._ended.set()
        self._thread.join()
        with suppress(ServiceProblemError, ServiceUnreachableError):  # then it is forgotten by itself
            if self._client.end_run(self.id, LOST_S):
                self._stopped_by = self._stopped_by or BY_A_PERSON
        if kind is None:
            self._refuse_if_stopped()

    @contextmanager
    def _carrying_out(self, index: int, action: EndEffectorAction, prediction_id: str | None) -> Iterator[None]:
        """Around the motion of an action; raises StoppedError before it or after it, if the run was stopped."""
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
            if self._stopped_by:  # again: a motion may have begun between a check and the first stop
                self._stop(self._stopped_by)
            try:
                if self._client.report_run(self.id, {**self._said, **self._state()}, LOST_S):
                    self._stop(BY_A_PERSON)
                heard_s, warned = time.monotonic(), False
            except Exception as error:  # whatever it is, the thread that can stop the robot goes on
                if time.monotonic() - heard_s >= LOST_S and not warned:
                    warned = True
                    log.warning("the service does not hear of this run: %s", error)
                    if self._on_lost == "stop":
                        self._stop(f"no contact with the service for {LOST_S:g} s: {error}")
            self._ended.wait(max(0.0, begun_s + PERIOD_S - time.monotonic()))

    def _stop(self, why: str) -> None:
        self._stopped_by = why
        try:
            self._robot.stop()
        except Exception as error:  # the next turn tries again
            log.warning("the robot does not stop: %s", error)

    def _state(self) -> Mapping[str, Any]:
        """Where the robot is, if it says so."""
        if not callable(state := getattr(self._robot, "state", None)):
            return {}
        try:
            now = state()
        except Exception as error:  # whatever an arm's interface raises must not end the thread that can stop it
            log.debug("the robot's state is not known: %s", error)
            return {}
        joints = now.joint_positions_rad
        return {
            "end_effector": {"position": now.position_m.tolist(), "quaternion_xyzw": now.quaternion_xyzw.tolist()},
            **({} if joints is None else {"joint_positions": joints.tolist()}),
        }
