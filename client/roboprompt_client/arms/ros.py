"""An arm of ROS 2 behind rosbridge: no ROS on this computer.

A controller takes Cartesian targets as `geometry_msgs/PoseStamped` and follows them at once, such as FZI's
`cartesian_motion_controller` (`target_frame`, `current_pose`) or MoveIt Servo's pose commands. A motion is sent in
steps, and none while the hand is far behind: an arm that hears no more of us goes no further than `MAX_LEAD_M`.
"""

import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from roboprompt_client.arms.driver import STEERED_S, ArmState, require_reach, straight_way
from roboprompt_client.arms.rosbridge import Message, Rosbridge
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.types.arrays import Array, finite_array, unit_quaternions

RATE_HZ, SETTLE_S = 20.0, 0.5
SPEED_M_S, TURN_RAD_S = 0.1, 0.5
MAX_AGE_S = 0.5  # of the pose that is taken for the present one
MAX_LEAD_M = 0.03
NEAR_M, NEAR_DEG = 0.001, 0.2
STILL_M = 0.0002  # what a hand that has settled moves in SETTLE_S
POSE, JOINTS = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/JointState"


@dataclass(frozen=True)
class RosGripper:
    """The messages that open and close a gripper, as its topic's type has them, and how long it takes."""

    topic: str
    type: str
    open: Mapping[str, Any]
    close: Mapping[str, Any]
    wait_s: float = 1.0


class Ros:
    """A driver for `Arm`.

    Args:
        address: of rosbridge, such as ws://192.168.1.5:9090.
        pose, target: the topics of the hand's present pose, and of the poses to go to, both in `base_frame`.
        joints: the topic of joints' states; `joint_names` are the arm's, in their order, and `finger_names` those
            whose positions add up to the width between the fingers.
        gripper: what `RosGripper` has; None: no gripper.
        reach_m: a pose further from the base is refused; None: nothing is known.

    Raises:
        InvalidInputError: for options that cannot be.
        MotionError: if nothing answers, or no pose comes.
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
        if joints is None and (joint_names or finger_names):
            raise InvalidInputError("joints", "is left out beside names of joints", "the topic of their states")
        self._pose, self._target, self._frame, self._joints = pose, target, base_frame.lstrip("/"), joints
        self._joint_names, self._finger_names = tuple(joint_names), tuple(finger_names)
        self._gripper = None if gripper is None else RosGripper(**gripper)
        self._gripper_open = None if gripper is None or finger_names else True
        self._step = (speed_m_s / RATE_HZ, turn_rad_s / RATE_HZ)
        self._reach_m = reach_m
        self._steps: Iterator[tuple[Array, Array]] = iter(())
        self._sent: tuple[Array, Array] | None = None
        self._sending = threading.Lock()  # no step follows a halt of another thread
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
            raise MotionError(f"{self.name}: a message has another form, or values that cannot be: {error}") from error
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
        """By `reach_m`; what else cannot be reached is the controller's to refuse."""
        self.state()
        if self._reach_m is not None:
            require_reach(position_m, self._reach_m)

    def start(self, position_m: Array, quaternion_xyzw: Array) -> None:
        self._steps, self._sent = straight_way(self.state(), position_m, quaternion_xyzw, *self._step), None

    def finished(self) -> bool:
        """A step on the way; at its end, or far behind it, whether the hand has come to rest."""
        now = self.state()
        off_m, off_deg = (0.0, 0.0) if self._sent is None else now.distance_to(*self._sent)
        with self._sending:
            step = next(self._steps, None) if off_m < MAX_LEAD_M else None
            if step is not None:
                self._send(*step)
        if step is not None:
            time.sleep(1 / RATE_HZ)
            return False
        if off_m < NEAR_M and off_deg < NEAR_DEG:
            return True
        time.sleep(SETTLE_S)
        return float(np.linalg.norm(self.state().position_m - now.position_m)) < STILL_M

    def steer(self, velocity_m_s: Array, turning_rad_s: Array) -> None:
        """By poses a little ahead, of which the last one is where the arm rests."""
        now = self.state()
        with self._sending:
            self._steps = iter(())
            self._send(*now.moved(velocity_m_s, turning_rad_s, STEERED_S))

    def set_gripper(self, *, is_open: bool) -> None:
        if (gripper := self._gripper) is None:
            return
        self._bridge.publish(gripper.topic, gripper.open if is_open else gripper.close)
        time.sleep(gripper.wait_s)
        self._gripper_open = None if self._finger_names else is_open
        self.state()

    def halt(self) -> None:
        """The present pose becomes the target; where it is not known, no further target is sent at least."""
        with self._sending:
            self._steps = iter(())
            now = self.state()
            self._send(now.position_m, now.quaternion_xyzw)

    def recover(self) -> None:
        """Errors of controllers are acknowledged where they run."""
        self.state()

    def close(self) -> None:
        self._bridge.close()

    def _introduce(self) -> None:
        """Say what is published and what is wanted, and wait for the first messages."""
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
        """A topic's last message, which must not be old."""
        if (news := self._bridge.last(topic)) is None:
            raise MotionError(f"{self.name}: nothing came from {topic}: is its controller active?")
        if (age_s := time.monotonic() - news.seen_s) > MAX_AGE_S:
            raise MotionError(f"{self.name}: {topic} says nothing new since {age_s:.1f} s, at most {MAX_AGE_S} s")
        return news.message

    def _joint_states(self, names: Sequence[str]) -> Array:
        """Position and velocity (N, 2) of joints; a velocity that is not said is NaN."""
        if self._joints is None or not names:
            return np.zeros((0, 2))
        states = _by_name(self._fresh(self._joints))
        if missing := [name for name in names if name not in states]:
            raise MotionError(f"{self.name}: {self._joints} says nothing of {', '.join(missing)}")
        return np.array([states[name] for name in names], float)

    def _send(self, position_m: Array, quaternion_xyzw: Array) -> None:
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
    """The joints of several publishers on one topic."""
    states = {**_by_name(before), **_by_name(message)}
    positions, rates = zip(*states.values(), strict=True)
    return {**message, "name": list(states), "position": list(positions), "velocity": list(rates)}
