"""Driver of a Universal Robots arm by the package ur-rtde: meters, rotation vectors, tool in the base frame."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from roboprompt_client.arms.driver import LOOK_FIRST, ArmState, pose_matrix
from roboprompt_client.arms.named import URGeometry, checked_model
from roboprompt_client.errors import MotionError
from roboprompt_client.extras import import_extra
from roboprompt_client.motion.limits import checked_bound
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array

SPEED_M_S, ACCELERATION_M_S2 = 0.1, 0.3
MAX_SPEED_M_S = 2.0  # of a hand; larger numbers are no meters per second
STOP_M_S2 = 2.0
POLL_S, GRIPPER_S = 0.05, 1.0
FIRST_TOOL_OUTPUT = 16  # of the receive interface, which numbers all digital outputs in a row


class MakersObject:
    """An object of a maker's package, whose methods raise MotionError instead of errors of any kind."""

    def __init__(self, name: str, made: object) -> None:
        self._name, self._made = name, made

    def __getattr__(self, method: str) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:  # noqa: ANN401
            try:
                return getattr(self._made, method)(*arguments)
            except Exception as error:  # the package's errors share no base class
                raise MotionError(f"{self._name}: {method}: {error or type(error).__name__}") from error

        return call


class UR:
    """A driver for `Arm`.

    Args:
        address: of the arm's controller, in remote control.
        model: `ur3e`, `ur5e`, `ur10e` or `ur16e`: plans are checked with its joints; None: unknown.
        speed_m_s, acceleration_m_s2: of the tool.
        gripper_output: the tool's digital output that closes the gripper or switches the suction on; None: no gripper.
        gripper_s: how long the gripper takes.

    Raises:
        InvalidInputError: for an unknown model, or a speed or acceleration out of range.
        MotionError: if the arm cannot be reached.
    """

    name = "UR (ur-rtde)"
    proven = ""

    def __init__(
        self,
        address: str,
        *,
        model: str | None = None,
        speed_m_s: float = SPEED_M_S,
        acceleration_m_s2: float = ACCELERATION_M_S2,
        gripper_output: int | None = None,
        gripper_s: float = GRIPPER_S,
    ) -> None:
        self._model = model if model is None else checked_model(model)
        self._speed = checked_bound("options.speed_m_s", speed_m_s, MAX_SPEED_M_S)
        self._acceleration = checked_bound("options.acceleration_m_s2", acceleration_m_s2)
        self._control, self._receive = (self._connected(kind, address) for kind in ("Control", "Receive"))
        self._outputs = None if gripper_output is None else self._connected("IO", address)
        self._output, self._gripper_s = gripper_output, gripper_s
        self._progress_before = -1

    def _connected(self, kind: str, address: str) -> MakersObject:
        module = MakersObject(f"{self.name}, {address}", import_extra(f"rtde_{kind.lower()}", "ur-rtde", "ur"))
        return MakersObject(self.name, getattr(module, f"RTDE{kind}Interface")(address))

    def state(self) -> ArmState:
        if not self._receive.isConnected():
            raise MotionError(f"{self.name}: the connection is lost")
        x, y, z, *turn = self._receive.getActualTCPPose()
        return ArmState(
            np.array([x, y, z]),
            rotations.canonical(rotations.from_rotation_vector(turn)),
            np.array(self._receive.getActualQ()),
            np.array(self._receive.getActualQd()),
            gripper_open=self._gripper_open(),
            wrench_n_nm=np.array(self._receive.getActualTCPForce()),
        )

    def _gripper_open(self) -> bool | None:
        """Return the state of the tool's output, whoever has set it; None without a gripper."""
        return None if self._output is None else not self._receive.getDigitalOutState(FIRST_TOOL_OUTPUT + self._output)

    def check(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Check the target by the controller's safety limits; the controller itself checks the way to it."""
        self._require_ready()
        pose = _pose(position_m, quaternion_xyzw)
        if not self._control.isPoseWithinSafetyLimits(pose):
            raise MotionError(f"{self.name}: the pose is out of reach or beyond the safety limits")
        joints = self._control.getInverseKinematics(pose)
        if not joints or not self._control.isJointsWithinSafetyLimits(joints):
            raise MotionError(f"{self.name}: the pose is beyond a joint's limit")

    def geometry(self) -> URGeometry | None:
        """Return the geometry with the tool center point that is set on the pendant; None for an unknown model."""
        if self._model is None:
            return None
        x, y, z, *turn = self._control.getTCPOffset()
        return URGeometry(self._model, pose_matrix(np.array([x, y, z]), rotations.from_rotation_vector(turn)))

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        self._progress_before = self._control.getAsyncOperationProgress()
        pose = _pose(position_m, quaternion_xyzw)
        if not self._control.moveL(pose, self._speed, self._acceleration, True):
            raise MotionError(f"{self.name}: the motion was refused")

    def finished(self) -> bool:
        """A negative progress other than before the motion means that it has ended."""
        self._require_ready()
        progress = self._control.getAsyncOperationProgress()
        if progress < 0 and progress != self._progress_before:
            return True
        time.sleep(POLL_S)
        return False

    def set_gripper(self, *, is_open: bool) -> None:
        if self._outputs is None or is_open == self._gripper_open():
            return
        if not self._outputs.setToolDigitalOut(self._output, not is_open):
            raise MotionError(f"{self.name}: the tool's output {self._output} was not set")
        time.sleep(self._gripper_s)

    def halt(self) -> None:
        self._control.stopL(STOP_M_S2)

    def recover(self) -> None:
        """Restart the control script; a protective stop is unlocked on the pendant."""
        if not self._control.isConnected() and not self._control.reconnect():
            raise MotionError(f"{self.name}: the controller does not answer")
        self._require_ready()

    def close(self) -> None:
        self._control.stopScript()
        self._control.disconnect()
        self._receive.disconnect()

    def _require_ready(self) -> None:
        for stopped, what in (
            (self._receive.isEmergencyStopped, "an emergency stop"),
            (self._receive.isProtectiveStopped, "a protective stop"),
        ):
            if stopped():
                raise MotionError(f"{self.name}: {what}: release it on the pendant; {LOOK_FIRST}")
        if not self._control.isConnected():
            raise MotionError(f"{self.name}: the connection is lost")


def _pose(position_m: Array, quaternion_xyzw: Array) -> list[float]:
    return [*position_m.tolist(), *rotations.to_rotation_vector(quaternion_xyzw).tolist()]
