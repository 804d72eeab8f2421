"""Driver of a ROS 2 arm through rosbridge; this computer needs no ROS.

The arm's controller must follow Cartesian targets (`geometry_msgs/PoseStamped`) at once, such as FZI's
`cartesian_motion_controller` (`target_frame`, `current_pose`) or MoveIt Servo's pose commands. A motion is sent in
steps, and the next step waits while the hand is far behind: if the connection breaks, the arm moves by `MAX_LEAD_M` at
most.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from roboprompt_client.arms.driver import MAX_SPEED_M_S, ArmState, require_reach
from roboprompt_client.arms.rosbridge import Message, Rosbridge
from roboprompt_client.arms.stepping import Stepping
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.motion.limits import checked_bound
from roboprompt_client.types.arrays import Array, finite_array, unit_quaternions

RATE_HZ, SETTLE_S = 20.0, 0.5
SPEED_M_S, TURN_RAD_S = 0.1, 0.5
MAX_AGE_S = 0.5  # of a pose that counts as the present one
MAX_LEAD_M = 0.03
NEAR_M, NEAR_DEG = 0.001, 0.2
STILL_M = 0.0002  # a hand that moves less within SETTLE_S has come to rest
POSE, JOINTS = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/JointState"


@dataclass(frozen=True)
class RosGripper:
    """A gripper's topic and its type, the messages that open and close it, and how long that takes."""

    topic: str
    type: str
    open: Mapping[str, Any]
    close: Mapping[str, Any]
    wait_s: float = 1.0


class Ros(Stepping):
    """A driver for `Arm`.

    Args:
        address: of rosbridge, such as ws://192.168.1.5:9090.
        pose, target: the topics of the hand's present pose and of target poses, both in `base_frame`.
        joints: the topic of joint states; `joint_names` are the arm's, in their order, and `finger_names` those whose
            positions add up to the width between the fingers.
        gripper: the members of `RosGripper`; None: no gripper.
        reach_m: poses farther from the base are refused; None: not checked.

    Raises:
        InvalidInputError: for options that contradict each other.
        MotionError: if rosbridge does not answer, or no pose arrives.
    """

    name = "ROS 2 (rosbridge)"
    proven = ""

    def __init__(
        self,
        address: str,
        *,
        pose: str,
        target: str,
        base_frame: str,
        joints: str | None = None,
        joint_names: Sequence[str] = (),
        finger_names: Sequence[str] = (),
        gripper: Mapping[str, Any] | None = None,
        speed_m_s: float = SPEED_M_S,
        turn_rad_s: float = TURN_RAD_S,
        reach_m: float | None = None,
    ) -> None:
        speed_m_s = checked_bound("options.speed_m_s", speed_m_s, MAX_SPEED_M_S)
        super().__init__(speed_m_s / RATE_HZ, checked_bound("options.turn_rad_s", turn_rad_s) / RATE_HZ)
        if joints is None and (joint_names or finger_names):
            raise InvalidInputError("joints", "is missing, but joint names are given", "the topic of joint states")
        self._pose, self._target, self._frame, self._joints = pose, target, base_frame.lstrip("/"), joints
        self._joint_names, self._finger_names = tuple(joint_names), tuple(finger_names)
        self._gripper = None if gripper is None else RosGripper(**gripper)
        self._gripper_open = None if gripper is None or finger_names else True
        self._reach_m = reach_m
        self._sent: tuple[Array, Array] | None = None
        self._bridge = Rosbridge(address)
        try:
            self._introduce()
        except MotionError:
            self._bridge.close()
            raise

    def state(self) -> ArmState:
        message = self._fresh(self._pose)
        try:
            frame, pose = message["header"]["frame_id"].lstrip("/"), message["pose"]
            position_m = finite_array(self._pose, [pose["position"][axis] for axis in "xyz"], (3,))
            turn = unit_quaternions(self._pose, [pose["orientation"][axis] for axis in "xyzw"], (4,))
            joints, fingers = self._joint_states(self._joint_names), self._joint_states(self._finger_names)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise MotionError(f"{self.name}: a message is malformed: {error}") from error
        if frame != self._frame:
            raise MotionError(f"{self.name}: {self._pose} is in the frame {frame!r}, not in {self._frame!r}")
        return ArmState(
            position_m,
            turn,
            joints[:, 0] if len(joints) else None,
            joints[:, 1] if len(joints) and np.isfinite(joints[:, 1]).all() else None,
            float(fingers[:, 0].sum()) if len(fingers) else None,
            self._gripper_open,
        )

    def check(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Check `reach_m`; the controller itself refuses other poses out of reach."""
        self.state()
        if self._reach_m is not None:
            require_reach(position_m, self._reach_m)

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        self._sent = None
        super().start(position_m, quaternion_xyzw)

    def finished(self) -> bool:
        """Send the next step; without one, or while the hand is far behind, return whether it has come to rest."""
        now = self.state()
        off_m, off_deg = (0.0, 0.0) if self._sent is None else now.distance_to(*self._sent)
        if off_m < MAX_LEAD_M and self.send_next():
            time.sleep(1 / RATE_HZ)
            return False
        if off_m < NEAR_M and off_deg < NEAR_DEG:
            return True
        time.sleep(SETTLE_S)
        return float(np.linalg.norm(self.state().position_m - now.position_m)) < STILL_M

    def set_gripper(self, *, is_open: bool) -> None:
        if (gripper := self._gripper) is None:
            return
        self._bridge.publish(gripper.topic, gripper.open if is_open else gripper.close)
        time.sleep(gripper.wait_s)
        self._gripper_open = None if self._finger_names else is_open
        self.state()

    def recover(self) -> None:
        """Check that poses arrive; errors of controllers are acknowledged in ROS."""
        self.state()

    def close(self) -> None:
        self._bridge.close()

    def _introduce(self) -> None:
        """Advertise and subscribe the topics, and wait for the first messages."""
        self._bridge.advertise(self._target, POSE)
        if self._gripper is not None:
            self._bridge.advertise(self._gripper.topic, self._gripper.type)
        self._bridge.subscribe(self._pose, POSE)
        if self._joints is not None:
            self._bridge.subscribe(self._joints, JOINTS, _merged)
        self._bridge.wait_until(self._is_known)
        self.state()

    def _is_known(self) -> bool:
        if self._bridge.last(self._pose) is None:
            return False
        names = {*self._joint_names, *self._finger_names}
        news = None if self._joints is None else self._bridge.last(self._joints)
        return not names or (news is not None and names <= set(news.message.get("name", ())))

    def _fresh(self, topic: str) -> Message:
        """Return a topic's last message; raises MotionError if it is missing or old."""
        if (news := self._bridge.last(topic)) is None:
            raise MotionError(f"{self.name}: no message from {topic}: is its controller active?")
        if (age_s := time.monotonic() - news.seen_s) > MAX_AGE_S:
            raise MotionError(f"{self.name}: the last message of {topic} is {age_s:.1f} s old, at most {MAX_AGE_S} s")
        return news.message

    def _joint_states(self, names: Sequence[str]) -> Array:
        """Return positions and velocities (N, 2) of joints; a missing velocity is NaN."""
        if self._joints is None or not names:
            return np.zeros((0, 2))
        states = _by_name(self._fresh(self._joints))
        if missing := [name for name in names if name not in states]:
            raise MotionError(f"{self.name}: {self._joints} lacks {', '.join(missing)}; it has {', '.join(states)}")
        return np.array([states[name] for name in names], float)

    def send(self, position_m: Array, quaternion_xyzw: Array) -> None:
        self._sent = position_m, quaternion_xyzw
        position = dict(zip("xyz", position_m.tolist(), strict=True))
        orientation = dict(zip("xyzw", quaternion_xyzw.tolist(), strict=True))
        pose = {"position": position, "orientation": orientation}
        self._bridge.publish(self._target, {"header": {"frame_id": self._frame}, "pose": pose})


def _by_name(message: Message) -> dict[str, tuple[float, float]]:
    rates = message.get("velocity") or [float("nan")] * len(message["name"])
    states = zip(message["position"], rates, strict=True)
    return dict(zip(message["name"], states, strict=True))


def _merged(before: Message, message: Message) -> Message:
    """Return a message with the joints of both: several programs may publish on one topic."""
    states = {**_by_name(before), **_by_name(message)}
    positions, rates = zip(*states.values(), strict=True)
    return {**message, "name": list(states), "position": list(positions), "velocity": list(rates)}
