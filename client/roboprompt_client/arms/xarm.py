"""Driver of a UFACTORY xArm or Lite by the package xarm-python-sdk: millimeters, roll pitch yaw, return codes."""

import time
from typing import Any

import numpy as np

from roboprompt_client.arms.driver import LOOK_FIRST, STEERED_S, ArmState, MakersObject
from roboprompt_client.errors import MotionError
from roboprompt_client.extras import import_extra
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array

SPEED_MM_S, ACCELERATION_MM_S2 = 100.0, 500.0
MM = 1000.0
PULSES_PER_MM = 10.0  # of the xArm Gripper: 850 is 85 mm open
OPEN_PULSES, CLOSED_PULSES = 850, 0
POSITION_MODE, VELOCITY_MODE = 0, 5
READY, MOVING, STOP = 0, 1, 4
POLL_S, START_S = 0.05, 0.2


class XArm:
    """A driver for `Arm`.

    Args:
        address: of the arm's control box.
        speed_mm_s, acceleration_mm_s2: of the tool.
        gripper: whether there is an xArm Gripper.

    Raises:
        MotionError: if the arm cannot be reached or made ready.
    """

    name = "xArm (xarm-python-sdk)"
    proven = ""

    def __init__(
        self,
        address: str,
        *,
        speed_mm_s: float = SPEED_MM_S,
        acceleration_mm_s2: float = ACCELERATION_MM_S2,
        gripper: bool = True,
    ) -> None:
        sdk = import_extra("xarm.wrapper", "xarm-python-sdk", "xarm")
        self._arm = MakersObject(
            self.name, MakersObject(f"{self.name}, {address}", sdk).XArmAPI(address, is_radian=True)
        )
        self._speed, self._acceleration = speed_mm_s, acceleration_mm_s2
        self._has_gripper = gripper
        self._started_s, self._mode = 0.0, POSITION_MODE
        error, _ = self._result("get_err_warn_code")
        if not error:  # else it is left for a person to see
            self._make_ready()

    def state(self) -> ArmState:
        x, y, z, *turn = self._result("get_position", is_radian=True)
        positions, velocities, *_ = self._result("get_joint_states", is_radian=True)
        pulses = self._result("get_gripper_position") if self._has_gripper else None
        return ArmState(
            np.array([x, y, z]) / MM,
            rotations.canonical(rotations.from_roll_pitch_yaw(*turn)),
            np.array(positions),
            np.array(velocities),
            None if pulses is None else pulses / PULSES_PER_MM / MM,
        )

    def check(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Check the target by the control box's limits; the control box itself checks the way to it."""
        self._require_ready()
        pose = _pose(position_m, quaternion_xyzw)
        if self._result("is_tcp_limit", pose, is_radian=True):
            raise MotionError(f"{self.name}: the pose is beyond the limits of the tool")
        joints = self._result("get_inverse_kinematics", pose, input_is_radian=True, return_is_radian=True)
        if self._result("is_joint_limit", joints, is_radian=True):
            raise MotionError(f"{self.name}: the pose is beyond a joint's limit")

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        if self._mode != POSITION_MODE:
            self._set_mode(POSITION_MODE)
        pose = _pose(position_m, quaternion_xyzw)
        how = {"speed": self._speed, "mvacc": self._acceleration, "is_radian": True, "wait": False}
        self._do("set_position", *pose, **how)
        self._started_s = time.monotonic()

    def finished(self) -> bool:
        self._require_ready()
        moving = self._result("get_state") == MOVING
        just_started = time.monotonic() - self._started_s < START_S  # the box reports a motion with a delay
        if moving or just_started:
            time.sleep(POLL_S)
            return False
        return True

    def steer(self, velocity_m_s: Array, turning_rad_s: Array) -> None:
        """With firmware 1.8.0 or later the control box ends the motion if no further call comes."""
        self._require_ready()
        if self._mode != VELOCITY_MODE:
            self._set_mode(VELOCITY_MODE)
        speeds = [*(MM * velocity_m_s).tolist(), *turning_rad_s.tolist()]
        self._do("vc_set_cartesian_velocity", speeds, is_radian=True, is_tool_coord=False, duration=STEERED_S)
        self._started_s = time.monotonic()

    def set_gripper(self, *, is_open: bool) -> None:
        if self._has_gripper:
            self._do("set_gripper_position", OPEN_PULSES if is_open else CLOSED_PULSES, wait=True)

    def halt(self) -> None:
        """Set the box's state 4: it stops, and accepts no motion before `recover`."""
        self._do("set_state", STOP)

    def recover(self) -> None:
        self._do("clean_error")
        self._do("clean_warn")
        self._make_ready()

    def _make_ready(self) -> None:
        self._do("motion_enable", enable=True)
        self._set_mode(POSITION_MODE)
        if self._has_gripper:
            self._do("set_gripper_enable", True)

    def close(self) -> None:
        self._arm.disconnect()

    def _require_ready(self) -> None:
        error, _ = self._result("get_err_warn_code")
        if error:
            raise MotionError(f"{self.name}: the arm reports error {error}: {LOOK_FIRST}")

    def _set_mode(self, mode: int) -> None:
        self._do("set_mode", mode)
        self._do("set_state", READY)
        self._mode = mode

    def _result(self, method: str, *arguments: Any, **named: Any) -> Any:  # noqa: ANN401
        code, value = getattr(self._arm, method)(*arguments, **named)
        self._check(method, code)
        return value

    def _do(self, method: str, *arguments: Any, **named: Any) -> None:  # noqa: ANN401
        self._check(method, getattr(self._arm, method)(*arguments, **named))

    def _check(self, method: str, code: int | None) -> None:
        if code:
            raise MotionError(f"{self.name}: {method} answered {code} (see the SDK's xarm_api_code.md)")


def _pose(position_m: Array, quaternion_xyzw: Array) -> list[float]:
    return [*(MM * position_m).tolist(), *rotations.to_roll_pitch_yaw(quaternion_xyzw)]
