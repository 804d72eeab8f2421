"""An arm behind LeRobot's Robot interface whose actions are end-effector poses, such as an SO-101 with its kinematics.

LeRobot's convention for these: `ee.x`, `ee.y`, `ee.z` in meters, `ee.wx`, `ee.wy`, `ee.wz` a rotation vector,
`ee.gripper_pos` 0 (closed) to 100 (open); joints `NAME.pos` in degrees. An action that is further than 5 cm from the
last one is refused there, so that a motion is sent in steps. An arm of five joints cannot have every rotation: give
`Arm` a tolerance that its orientation can keep.
"""

import threading
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from roboprompt_client.arms.driver import STEERED_S, ArmState, require_reach, straight_way
from roboprompt_client.errors import MotionError
from roboprompt_client.types import quaternions as rotations
from roboprompt_client.types.arrays import Array

POSITION, ROTATION = ("ee.x", "ee.y", "ee.z"), ("ee.wx", "ee.wy", "ee.wz")
GRIPPER, JOINT = "ee.gripper_pos", ".pos"
STEP_M, STEP_RAD = 0.01, 0.05
RATE_HZ, SETTLE_S, GRIPPER_S = 30.0, 0.5, 1.0
OPEN, CLOSED, HALF_OPEN = 100.0, 0.0, 50.0


class LeRobotArm:
    """A driver for `Arm`.

    Args:
        robot: a LeRobot robot with the `ee.` features above in its observations and actions; connected if it is not.
        reach_m: a pose further from the base is refused.
        open_width_m: how far the fingers are apart at 100; None: the gripper is only open or closed.

    Raises:
        MotionError: if it does not connect, or has no such features.
    """

    name = "LeRobot"
    proven = ""

    def __init__(self, robot: Any, *, reach_m: float = 0.4, open_width_m: float | None = None) -> None:  # noqa: ANN401
        self._robot, self._reach_m, self._open_width_m = robot, reach_m, open_width_m
        if not robot.is_connected:
            self._call("connect")
        if missing := [name for name in (*POSITION, *ROTATION, GRIPPER) if name not in self._observed()]:
            raise MotionError(f"{self.name}: the robot does not observe {', '.join(missing)}")
        self._steps: Iterator[tuple[Array, Array]] = iter(())
        self._halted = False
        self._sending = threading.Lock()  # no step follows a halt of another thread

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

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        self._halted = False
        self._steps = straight_way(self.state(), position_m, quaternion_xyzw, STEP_M, STEP_RAD)

    def finished(self) -> bool:
        grip = float(self._observed()[GRIPPER])
        with self._sending:
            step = None if self._halted else next(self._steps, None)
            if step is not None:
                self._send(*step, grip)
        time.sleep(SETTLE_S if step is None else 1 / RATE_HZ)
        return step is None

    def steer(self, velocity_m_s: Array, turning_rad_s: Array) -> None:
        """By poses a little ahead, of which the last one is where the arm rests."""
        self._steps, now = iter(()), self.state()
        with self._sending:
            self._halted = False
            self._send(*now.moved(velocity_m_s, turning_rad_s, STEERED_S), float(self._observed()[GRIPPER]))

    def set_gripper(self, *, is_open: bool) -> None:
        now = self.state()
        if now.gripper_open != is_open:
            self._send(now.position_m, now.quaternion_xyzw, OPEN if is_open else CLOSED)
            time.sleep(GRIPPER_S)

    def halt(self) -> None:
        """No further step is sent, and the arm is asked to be where it is."""
        with self._sending:
            self._halted = True
            now = self.state()
            self._send(now.position_m, now.quaternion_xyzw, float(self._observed()[GRIPPER]))

    def recover(self) -> None:
        if not self._robot.is_connected:
            self._call("connect")

    def close(self) -> None:
        self._call("disconnect")

    def _send(self, position_m: Array, quaternion_xyzw: Array, gripper: float) -> None:
        turn = rotations.to_rotation_vector(quaternion_xyzw)
        named = zip((*POSITION, *ROTATION, GRIPPER), (*position_m, *turn, gripper), strict=True)
        self._call("send_action", {name: float(value) for name, value in named})

    def _observed(self) -> Mapping[str, Any]:
        seen: Mapping[str, Any] = self._call("get_observation")
        return seen

    def _call(self, method: str, *arguments: Any) -> Any:  # noqa: ANN401
        try:
            return getattr(self._robot, method)(*arguments)
        except Exception as error:  # whatever the plugin and its motors raise
            raise MotionError(f"{self.name}: {method}: {error or type(error).__name__}") from error
