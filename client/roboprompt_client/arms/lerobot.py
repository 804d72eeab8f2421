"""Driver of an arm with LeRobot's Robot interface whose actions are end-effector poses, such as an SO-101.

LeRobot's convention: `ee.x`, `ee.y`, `ee.z` in meters, `ee.wx`, `ee.wy`, `ee.wz` a rotation vector, `ee.gripper_pos`
0 (closed) to 100 (open), joints `NAME.pos` in degrees. LeRobot refuses an action more than 5 cm from the last one, so a
motion is sent in steps. An arm of five joints cannot reach every rotation: give `Arm` a larger rotation tolerance.
"""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from roboprompt_client.arms.driver import ArmState, MakersObject, require_reach
from roboprompt_client.arms.stepping import Stepping
from roboprompt_client.errors import MotionError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array

POSITION, ROTATION = ("ee.x", "ee.y", "ee.z"), ("ee.wx", "ee.wy", "ee.wz")
GRIPPER, JOINT = "ee.gripper_pos", ".pos"
STEP_M, STEP_RAD = 0.01, 0.05
RATE_HZ, SETTLE_S, GRIPPER_S = 30.0, 0.5, 1.0
OPEN, CLOSED, HALF_OPEN = 100.0, 0.0, 50.0


class LeRobotArm(Stepping):
    """A driver for `Arm`.

    Args:
        robot: a LeRobot robot with the `ee.` features above in observations and actions; it is connected if needed.
        reach_m: poses farther from the base are refused.
        open_width_m: the fingers' distance at 100; None: only open or closed is known.

    Raises:
        MotionError: if it does not connect, or has no such features.
    """

    name = "LeRobot"
    proven = ""

    def __init__(self, robot: Any, *, reach_m: float = 0.4, open_width_m: float | None = None) -> None:  # noqa: ANN401
        super().__init__(STEP_M, STEP_RAD)
        self._robot, self._calls = robot, MakersObject(self.name, robot)
        self._reach_m, self._open_width_m = reach_m, open_width_m
        self.recover()
        if missing := [name for name in (*POSITION, *ROTATION, GRIPPER) if name not in self._observed()]:
            raise MotionError(f"{self.name}: the robot does not observe {', '.join(missing)}")
        # What was commanded, not what is measured: fingers that hold something would let it go.
        self._grip = float(self._observed()[GRIPPER])
        self._gripping = False

    def state(self) -> ArmState:
        seen = self._observed()
        joints = [value for name, value in seen.items() if name.endswith(JOINT) and not name.startswith("gripper")]
        grip = float(seen[GRIPPER])
        return ArmState(
            np.array([float(seen[name]) for name in POSITION]),
            rotations.canonical(rotations.from_rotation_vector([float(seen[name]) for name in ROTATION])),
            np.radians(np.array(joints, float)) if joints else None,
            None,
            None if self._open_width_m is None else grip / OPEN * self._open_width_m,
            grip > HALF_OPEN,
        )

    def check(self, position_m: Array, quaternion_xyzw: Array) -> None:
        require_reach(position_m, self._reach_m)

    def finished(self) -> bool:
        sent = self.send_next()
        time.sleep(1 / RATE_HZ if sent else SETTLE_S)
        return not sent

    def set_gripper(self, *, is_open: bool) -> None:
        now = self.state()
        if now.gripper_open == is_open:
            return
        self._grip, self._gripping = OPEN if is_open else CLOSED, True
        self.send(now.position_m, now.quaternion_xyzw)
        time.sleep(GRIPPER_S)
        self._gripping = False

    def halt(self) -> None:
        """Also stop fingers that open or close; fingers that hold something keep holding it."""
        if self._gripping:
            self._grip = float(self._observed()[GRIPPER])
        super().halt()

    def recover(self) -> None:
        if not self._robot.is_connected:
            self._calls.connect()

    def close(self) -> None:
        self._calls.disconnect()

    def send(self, position_m: Array, quaternion_xyzw: Array) -> None:
        turn = rotations.to_rotation_vector(quaternion_xyzw)
        named = zip((*POSITION, *ROTATION, GRIPPER), (*position_m, *turn, self._grip), strict=True)
        self._calls.send_action({name: float(value) for name, value in named})

    def _observed(self) -> Mapping[str, Any]:
        seen: Mapping[str, Any] = self._calls.get_observation()
        return seen
