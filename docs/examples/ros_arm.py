"""A ROS 2 arm: `{"arm": "ros_arm:RosArm"}` in a cell's file, on a computer with ROS 2. Not tested with ROS or an arm.

The arm's controller must follow each Cartesian target at once, such as FZI's `cartesian_motion_controller`. A motion is
sent in steps, and the next step waits while the hand is far behind: a program that hangs moves the arm by MAX_LEAD_M.
"""

import threading
import time

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped

from roboprompt_client.arms.driver import ArmState, straight_way
from roboprompt_client.errors import MotionError

STEP_M, STEP_RAD, PERIOD_S = 0.005, 0.025, 0.05  # 0.1 m/s
MAX_LEAD_M, NEAR_M, NEAR_DEG, MAX_AGE_S = 0.03, 0.001, 0.2, 0.5


class RosArm:
    name, proven = "ROS 2", ""

    def __init__(self, pose="current_pose", target="target_frame", frame="base_link", reach_m=0.85):
        rclpy.init()
        self._frame, self._reach_m, self._steps, self._sent = frame, reach_m, iter(()), None
        self._pose, self._came_s, self._sending = None, -np.inf, threading.Lock()
        self._node = rclpy.create_node("roboprompt_arm")
        self._target = self._node.create_publisher(PoseStamped, target, 1)
        self._node.create_subscription(PoseStamped, pose, self._take, 1)
        threading.Thread(target=rclpy.spin, args=(self._node,), daemon=True).start()

    def _take(self, message):
        self._pose, self._came_s = message.pose, time.monotonic()

    def state(self):
        if self._pose is None or time.monotonic() - self._came_s > MAX_AGE_S:
            raise MotionError("no present pose: is the controller active?")
        at, turn = self._pose.position, self._pose.orientation
        return ArmState(np.array([at.x, at.y, at.z]), np.array([turn.x, turn.y, turn.z, turn.w]))

    def check(self, position_m, quaternion_xyzw):
        if np.linalg.norm(position_m) > self._reach_m:
            raise MotionError(f"the pose is out of reach: at most {self._reach_m} m from the base")

    def start(self, position_m, quaternion_xyzw):
        self._steps = straight_way(self.state(), position_m, quaternion_xyzw, STEP_M, STEP_RAD)

    def finished(self):
        time.sleep(PERIOD_S)
        off_m, off_deg = (0.0, 0.0) if self._sent is None else self.state().distance_to(*self._sent)
        with self._sending:  # no step follows a halt of another thread
            if off_m < MAX_LEAD_M and (step := next(self._steps, None)) is not None:
                self._send(*step)
                return False
        return off_m < NEAR_M and off_deg < NEAR_DEG

    def _send(self, position_m, quaternion_xyzw):
        self._sent, message = (position_m, quaternion_xyzw), PoseStamped()
        message.header.frame_id, message.header.stamp = self._frame, self._node.get_clock().now().to_msg()
        at, turn = message.pose.position, message.pose.orientation
        at.x, at.y, at.z = position_m.tolist()
        turn.x, turn.y, turn.z, turn.w = quaternion_xyzw.tolist()
        self._target.publish(message)

    def set_gripper(self, *, is_open):
        """Publish to your gripper's controller, and wait until it is done."""

    def halt(self):
        with self._sending:
            self._steps, now = iter(()), self.state()
            self._send(now.position_m, now.quaternion_xyzw)

    def recover(self):
        self.state()

    def close(self):
        rclpy.shutdown()
