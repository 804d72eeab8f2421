"""An arm behind a rosbridge server of the tests' own, made after the text of its protocol (v2.0). No ROS was there."""

import contextlib
import json
import threading
import time

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

from roboprompt_client.arms.arm import Arm
from roboprompt_client.arms.ros import Ros
from roboprompt_client.arms.safety import Tolerance
from roboprompt_client.cell import open_robot
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.types.poses import EndEffectorAction

POSE, TARGET, JOINTS, GRIPPER = "/arm/current_pose", "/arm/target_frame", "/joint_states", "/gripper/commands"
TYPES = {
    POSE: "geometry_msgs/msg/PoseStamped",
    TARGET: "geometry_msgs/msg/PoseStamped",
    JOINTS: "sensor_msgs/msg/JointState",
    GRIPPER: "std_msgs/msg/Float64MultiArray",
}
FINGERS = ("finger_1", "finger_2")
HOME_M, DOWN = np.array([0.4, 0.0, 0.4]), [1.0, 0.0, 0.0, 0.0]
PERIOD_S, SPEED_M_S = 0.01, 1.0


class Robot:
    """A robot with a Cartesian controller and two publishers of joint states, seen through rosbridge."""

    def __init__(self):
        self.position_m, self.turn, self.width_m = HOME_M, DOWN, 0.08
        self.target_m = HOME_M
        self.targets, self.refused = [], []
        self.frame, self.blocked, self.frozen, self.silent, self.nonsense = "base_link", False, False, False, None
        self._server = serve(self._talk, "127.0.0.1", 0)
        self.address = f"ws://127.0.0.1:{self._server.socket.getsockname()[1]}"
        self._connections, self._stamp = [], 0
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def _talk(self, connection):
        self._connections.append(connection)
        subscribed, advertised = set(), {}
        moving = threading.Thread(target=self._publish, args=(connection, subscribed), daemon=True)
        moving.start()
        with contextlib.suppress(ConnectionClosed):
            for text in connection:
                said = json.loads(text)
                topic = said["topic"]
                if said["op"] in ("advertise", "subscribe") and said["type"] != TYPES.get(topic):
                    message = f"{topic} has another type"
                    connection.send(json.dumps({"op": "status", "level": "error", "msg": message}))
                elif said["op"] == "subscribe":
                    subscribed.add(topic)
                elif said["op"] == "advertise":
                    advertised[topic] = said["type"]
                elif topic in advertised:
                    self._obey(topic, said["msg"])
                else:
                    self.refused.append(said)

    def _obey(self, topic, message):
        if topic == GRIPPER:
            self.width_m = sum(message["data"])
            return
        assert message["header"] == {"frame_id": "base_link"}  # rosbridge adds the time
        pose = message["pose"]
        self.target_m = np.array([pose["position"][axis] for axis in "xyz"])
        self.turn = [pose["orientation"][axis] for axis in "xyzw"]
        self.targets.append(self.target_m)

    def _publish(self, connection, subscribed):
        with contextlib.suppress(ConnectionClosed):
            while True:
                time.sleep(PERIOD_S)
                if self.silent:
                    continue
                away_m = self.target_m - self.position_m
                step_m = min(1.0, SPEED_M_S * PERIOD_S / max(float(np.linalg.norm(away_m)), 1e-9))
                if not self.blocked:
                    self.position_m = self.position_m + step_m * away_m
                self._stamp += not self.frozen
                for topic, message in self._messages():
                    if topic in subscribed:
                        connection.send(json.dumps({"op": "publish", "topic": topic, "msg": message}))

    def _messages(self):
        header = {"stamp": {"sec": 5, "nanosec": self._stamp}, "frame_id": self.frame}
        position = dict(zip("xyz", self.position_m.tolist(), strict=True))
        pose = {"position": position, "orientation": dict(zip("xyzw", self.turn, strict=True))}
        yield POSE, self.nonsense or {"header": header, "pose": pose}
        arm = {"name": ["j1", "j2"], "position": [0.1, 0.2], "velocity": [0.0, 0.5]}
        yield JOINTS, {"header": header, **arm, "effort": []}
        fingers = {"name": list(FINGERS), "position": [self.width_m / 2] * 2, "velocity": []}
        yield JOINTS, {"header": header, **fingers, "effort": []}

    def hang_up(self):
        for connection in self._connections:
            connection.close()

    def close(self):
        self._server.shutdown()


@pytest.fixture
def robot():
    robot = Robot()
    yield robot
    robot.close()


def options(robot, **changed):
    gripper = {"topic": GRIPPER, "type": TYPES[GRIPPER], "open": {"data": [0.04, 0.04]}, "close": {"data": [0, 0]}}
    named = {"joints": JOINTS, "joint_names": ["j1", "j2"], "finger_names": list(FINGERS)}
    topics = {"pose": POSE, "target": TARGET, "base_frame": "/base_link", "gripper": {**gripper, "wait_s": 0.1}}
    return {"address": robot.address, **topics, **named, "speed_m_s": 0.4, **changed}


@pytest.fixture
def arm(robot):
    with Arm(Ros(**options(robot))) as arm:
        yield arm


def to(offset_m=(0.05, 0.03, -0.1), gripper_open=True):
    return EndEffectorAction(HOME_M + np.array(offset_m), np.array(DOWN), gripper_open)


def test_a_cell_s_file_moves_it(robot, tmp_path):
    (tmp_path / "cell.json").write_text(json.dumps({"arm": "ros", "options": options(robot)}))
    with open_robot(str(tmp_path / "cell.json")) as arm:
        state = arm.state()
        np.testing.assert_allclose(state.position_m, HOME_M)
        np.testing.assert_allclose(state.joint_positions_rad, [0.1, 0.2])
        assert state.joint_velocities_rad_s is None or state.joint_velocities_rad_s[1] == 0.5
        assert state.gripper_width_m == pytest.approx(0.08)
        arm.execute(to(gripper_open=False))
        np.testing.assert_allclose(robot.position_m, to().position_m, atol=0.001)
        assert arm.state().gripper_width_m == 0.0
    steps_m = np.linalg.norm(np.diff([HOME_M, *robot.targets], axis=0), axis=1)
    assert steps_m.max() < 0.021  # 0.4 m/s, 20 times a second
    assert robot.refused == []


def test_a_stop_makes_the_present_pose_the_target(robot, arm):
    threading.Timer(0.3, arm.stop).start()
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to((0.3, 0.2, -0.2)))
    time.sleep(0.2)
    held_m = robot.position_m
    assert np.linalg.norm(held_m - to((0.3, 0.2, -0.2)).position_m) > 0.1
    assert np.linalg.norm(robot.targets[-1] - held_m) < 0.02
    with pytest.raises(MotionError, match="recover"):
        arm.execute(to())
    arm.recover()
    arm.execute(to())


def test_an_arm_that_is_blocked_is_not_pushed_further(robot, arm):
    threading.Timer(0.2, setattr, (robot, "blocked", True)).start()
    with pytest.raises(MotionError, match="off its target"):
        arm.execute(to((0.4, 0.0, 0.0)))
    time.sleep(0.2)
    assert max(np.linalg.norm(target_m - robot.position_m) for target_m in robot.targets[4:]) < 0.06
    assert np.linalg.norm(robot.targets[-1] - robot.position_m) < 0.001  # it was stopped there


@pytest.mark.parametrize("what", ["frozen", "silent"])
def test_a_pose_that_is_old_stops_the_arm(robot, arm, what):
    threading.Timer(0.3, setattr, (robot, what, True)).start()
    with pytest.raises(MotionError, match="s old, at most"):
        arm.execute(to((0.4, 0.0, 0.0)))
    sent = len(robot.targets)
    time.sleep(0.2)
    assert len(robot.targets) == sent
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to())


def test_a_lost_connection_stops_the_arm(robot, arm):
    threading.Timer(0.3, robot.hang_up).start()
    with pytest.raises(MotionError, match="rosbridge: the connection"):
        arm.execute(to((0.4, 0.0, 0.0)))
    with pytest.raises(MotionError, match="was stopped"):
        arm.execute(to())


def test_it_is_steered_by_poses_a_little_ahead(robot, arm):
    with arm.steered() as steer:
        assert steer(np.array([0.0, 0.1, 0.0]), np.zeros(3)) == ""
    time.sleep(0.2)
    np.testing.assert_allclose(robot.targets[0] - HOME_M, [0, 0.015, 0], atol=1e-9)
    assert np.linalg.norm(robot.targets[-1] - robot.position_m) < 0.005  # and then it rests


def test_a_rosbridge_that_is_not_there_is_said():
    with pytest.raises(MotionError, match=r"connect ws://127\.0\.0\.1:9"):
        Ros("ws://127.0.0.1:9", pose=POSE, target=TARGET, base_frame="base_link")


def test_a_topic_of_another_type_is_said(robot):
    with pytest.raises(MotionError, match="/elsewhere has another type"):
        Ros(**options(robot, target="/elsewhere"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"frame": "world"}, "is in the frame 'world', not in 'base_link'"),
        ({"nonsense": {"header": {"frame_id": "base_link"}, "pose": {"position": {"x": 1}}}}, "malformed"),
        ({"turn": [2.0, 0, 0, 0]}, "malformed"),
        ({"position_m": np.full(3, np.nan)}, "malformed"),
    ],
)
def test_what_the_robot_says_wrongly_is_refused(robot, changes, message):
    for name, value in changes.items():
        setattr(robot, name, value)
    with pytest.raises(MotionError, match=message):
        Ros(**options(robot))


def test_options_that_cannot_be(robot, monkeypatch):
    monkeypatch.setattr("roboprompt_client.arms.rosbridge.CONNECT_S", 0.3)
    with pytest.raises(InvalidInputError, match="joints"):
        Ros(**options(robot, joints=None))
    with pytest.raises(InvalidInputError, match=r"options.speed_m_s: is 100 \(valid: .* at most 2"):
        Ros(**options(robot, speed_m_s=100))
    with pytest.raises(MotionError, match="lacks j3"):
        Ros(**options(robot, joint_names=["j1", "j3"]))
    with pytest.raises(MotionError, match=r"out of reach: 0\.566 m"):
        Arm(Ros(**options(robot, reach_m=0.5)), tolerance=Tolerance()).execute(to((0, 0, 0)))
