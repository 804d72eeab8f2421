"""Driver of a Franka Panda or Research 3, over libfranka by the package franky.

Franky's convention is ours: meters, quaternions xyzw, end effector in the base frame. The default is 5 % of the arm's
full dynamics.
"""

import logging
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, wait
from contextlib import contextmanager, suppress
from threading import Thread
from typing import Any

import numpy as np

from roboprompt_client.arms.driver import LOOK_FIRST, ArmState
from roboprompt_client.arms.named import LIMITS_RAD, PandaGeometry, checked_model
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.extras import import_extra
from roboprompt_client.types.arrays import Array

log = logging.getLogger(__name__)
DYNAMICS = 0.05
GRIPPER_M_S, GRASP_N = 0.05, 20.0
POLL_S = 0.05
MIN_TOOL_M = 0.03  # a gripper is longer; the Franka Hand: 0.1034
CONNECT_S = 10.0
WIDTH_TOLERANCE_M = 0.001
POSE_TOLERANCE = 1e-6  # meters and radians
# Ruckig fails to synchronize one of about 70 motions. At another speed it succeeds; nothing has moved by then.
PLANNER_FAILED, SPEED_SHARES = "Motion planner failed", (1.0, 0.9, 0.8)
# libfranka's words for commands that came too late for its loop of 1 kHz
TOO_LATE = ("communication_constraints_violation", "UDP receive")
LATE_REMEDY = (
    "commands came too late: end busy programs on this computer, use a real-time kernel and a network cable of its own "
    "to the control unit"
)


class Franka:
    """A driver for `Arm`.

    Args:
        address: of the arm's control unit.
        model: `panda` or `fr3`, which have different joint limits.
        dynamics: share of the arm's full velocity, acceleration and jerk, 0 to 1.
        realtime: require a real-time kernel, which a real arm needs and a simulated one does not.
        gripper: whether there is a Franka Hand.

    Raises:
        InvalidInputError: for an unknown model, or dynamics out of range.
        MotionError: if the arm cannot be reached, or another program controls it.
    """

    name = "Franka (libfranka, franky)"
    proven = "libfranka's protocol over a simulated arm (franky-sim)"

    def __init__(
        self,
        address: str,
        *,
        model: str = "fr3",
        dynamics: float = DYNAMICS,
        realtime: bool = True,
        gripper: bool = True,
        grasp_n: float = GRASP_N,
    ) -> None:
        if not 0 < dynamics <= 1:
            raise InvalidInputError("dynamics", f"is {dynamics!r:.40}", "above 0 and at most 1")
        self._franky = franky = import_extra("franky", "franky-control", "franka")
        self._model, self._grasp_n = checked_model(model, LIMITS_RAD), grasp_n
        self._gripping = self._going = False
        self._attempts: Iterator[Any] = iter(())  # motions to the present target
        kernel = franky.RealtimeConfig.Enforce if realtime else franky.RealtimeConfig.Ignore
        with self._errors(f"connect {address}"):
            self._robot = _within(
                CONNECT_S, lambda: franky.Robot(address, relative_dynamics_factor=dynamics, realtime_config=kernel)
            )
            self._gripper = _within(CONNECT_S, lambda: franky.Gripper(address)) if gripper else None
        if gripper and np.linalg.norm(self._flange_to_tip()[:3, 3]) < MIN_TOOL_M:
            log.warning(
                "%s: no end effector is set in Desk: its poses are those of the flange, not of the fingertips",
                self.name,
            )

    def state(self) -> ArmState:
        with self._errors("state"):
            now, pose = self._robot.current_joint_state, self._robot.current_pose.end_effector_pose
            measured = self._robot.state
            wrench, time_s = np.array(measured.O_F_ext_hat_K, float).reshape(6), float(measured.time.to_sec())
            width_m = None if self._gripper is None else float(self._gripper.width)
        return ArmState(
            np.array(pose.translation, float).reshape(3),
            np.array(pose.quaternion, float).reshape(4),
            np.array(now.position, float).reshape(7),
            np.array(now.velocity, float).reshape(7),
            width_m,
            wrench_n_nm=wrench,
            time_s=time_s,
        )

    def check(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Also refuse while the arm reports an error: a reflex is acknowledged by `recover` only."""
        with self._errors("state"):
            if self._robot.has_errors:
                raise MotionError(f"the arm reports {self._robot.state.current_errors}: {LOOK_FIRST}")
            joints = np.array(self._robot.current_joint_state.position, float).reshape(7)
        self.geometry().way(joints, position_m, quaternion_xyzw)

    def geometry(self) -> PandaGeometry:
        return PandaGeometry(self._model, self._flange_to_tip())

    def _flange_to_tip(self) -> Array:
        with self._errors("state"):
            return np.array(self._robot.state.F_T_EE.matrix, float)

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        self._going = not self._is_at(position_m, quaternion_xyzw)
        if not self._going:  # franky's planner fails for ways that are as short as rounding errors
            return
        target, motion = self._franky.Affine(position_m, quaternion_xyzw), self._franky.CartesianMotion
        # a motion object is good for one motion
        self._attempts = iter([motion(target, relative_dynamics_factor=share) for share in SPEED_SHARES])
        self._start_next()

    def _start_next(self, failed: MotionError | None = None) -> None:
        """Start the next attempt that franky can plan; raise the last failure if none is left."""
        while (motion := next(attempts := self._attempts, None)) is not None:
            try:
                with self._errors("move"):
                    self._robot.move(motion, asynchronous=True)
                    if attempts is not self._attempts:  # another thread has halted meanwhile
                        self._robot.stop()
                return
            except MotionError as error:  # of this motion, or of the one before
                if PLANNER_FAILED not in str(error):
                    raise
                failed = error
                self._forget_error()
        if failed is not None:
            raise failed

    def _is_at(self, position_m: Array, quaternion_xyzw: Array) -> bool:
        off_m, off_deg = self.state().distance_to(position_m, quaternion_xyzw)
        return off_m < POSE_TOLERANCE and math.radians(off_deg) < POSE_TOLERANCE

    def finished(self) -> bool:
        if not self._going:
            return True
        try:
            with self._errors("motion"):
                # True once it has ended (franky 2.0; its docstring says the opposite). `join_motion` would take an
                # interrupt for itself.
                ended = bool(self._robot.poll_motion())
        except MotionError as error:
            if PLANNER_FAILED not in str(error):
                raise
            self._forget_error()
            self._start_next(error)
            ended = False
        if not ended:
            time.sleep(POLL_S)
        return ended

    def set_gripper(self, *, is_open: bool) -> None:
        if (hand := self._gripper) is None:
            return
        self._gripping = True
        try:
            with self._errors("gripper"):
                width_m, most_m = float(hand.width), float(hand.max_width)
                if is_open and width_m < most_m - WIDTH_TOLERANCE_M:
                    hand.open(GRIPPER_M_S)
                elif not is_open and width_m > WIDTH_TOLERANCE_M:
                    # Whatever it closes on, or nothing, is right: the width afterwards is what counts.
                    hand.grasp(0.0, GRIPPER_M_S, self._grasp_n, most_m, most_m)
        finally:
            self._gripping = False

    @contextmanager
    def guided(self) -> Iterator[None]:
        """Command zero torque, so that only the arm's weight is compensated, with soft walls before joint limits."""
        with self._errors("guide"):
            yielding = self._franky.SimpleTorqueMotion(signal_timeout=None, compensate_coriolis=True)
            self._robot.move(yielding, asynchronous=True)
        try:
            yield
        finally:
            with self._errors("guide"):
                self._robot.move(self._franky.TorqueStopMotion())

    def halt(self) -> None:
        """Pre-empt a motion of another thread; a gripper at rest keeps its grasp."""
        self._attempts = iter(())
        with self._errors("stop"):
            try:
                self._robot.stop()
            finally:
                if self._gripper is not None and self._gripping:
                    self._gripper.stop()

    def recover(self) -> None:
        self._forget_error()
        with self._errors("recovery"):
            self._robot.recover_from_errors()

    def _forget_error(self) -> None:
        """Let franky raise the error of the last motion, which was already raised, for the last time."""
        with suppress(Exception):
            self._robot.join_motion(POLL_S)

    def close(self) -> None:
        self._gripper = self._robot = None

    @contextmanager
    def _errors(self, what: str) -> Iterator[None]:
        try:
            yield
        except MotionError:
            raise
        except Exception as error:  # franky's errors share no base class
            message = f"{self.name}: {what}: {error or type(error).__name__}"
            late = any(words in message for words in TOO_LATE)
            raise MotionError(f"{message}: {LATE_REMEDY}" if late else message) from error


def _within(most_s: float, connect: Callable[[], Any]) -> Any:  # noqa: ANN401
    """Return what `connect` returns, or raise TimeoutError: libfranka waits forever for an arm that is in use."""
    done: Future[Any] = Future()

    def run() -> None:
        try:
            done.set_result(connect())
        except Exception as error:  # handed over to the caller
            done.set_exception(error)

    Thread(target=run, name="connect", daemon=True).start()
    if not wait([done], most_s).done:
        raise TimeoutError(f"no answer within {most_s:g} s: is it switched on, and does another program control it?")
    return done.result()
