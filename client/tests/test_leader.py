"""A LeRobot leader arm steers the hand. No leader was there: it is an object with the methods of LeRobot's."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from makers import MAKERS, Body

from roboprompt_client.arms.arm import Arm
from roboprompt_client.commands.record_live import record_live
from roboprompt_client.errors import InvalidInputError, MotionError
from roboprompt_client.recording import leader as module
from roboprompt_client.recording.leader import Leader
from roboprompt_client.types import quaternions as rotations


class SO101Leader:
    """As LeRobot 0.4 has it: joints in degrees, the gripper 0 to 100."""

    def __init__(self, **config):
        self.config = SimpleNamespace(**{"use_degrees": True, **config})
        self.is_connected, self.is_calibrated, self.gone = False, True, False
        self.joints = {"x": 0.0, "y": 0.0, "yaw": 0.0, "gripper": 100.0}

    def connect(self, calibrate=True):
        assert not calibrate  # it would ask a person at the terminal
        self.is_connected = True

    def get_action(self):
        if self.gone:
            raise ConnectionError("no status packet from motor 3")
        return {f"{name}.pos": value for name, value in self.joints.items()}

    def disconnect(self):
        self.is_connected = False


class Straight:
    """A geometry: 1 degree is 1 cm along x and y; test_urdf.py reads a URDF."""

    def __init__(self, path, frame):
        pass

    def frame(self, angles_rad):
        x, y, _ = np.degrees([angles_rad[name] for name in ("x", "y", "yaw")])
        pose = np.eye(4)
        pose[:3, :3] = rotations.to_matrix(rotations.about_z(angles_rad["yaw"]))
        pose[:2, 3] = 0.01 * x, 0.01 * y
        return pose


@pytest.fixture
def leader(monkeypatch):
    monkeypatch.setattr(module.UrdfGeometry, "read", Straight)
    return SO101Leader()


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(s=0.0)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now.s))
    return now


def followed(steer, clock, ticks=25):
    """The way (6,) that a hand makes which obeys at once."""
    way = np.zeros(6)
    for _ in range(ticks):
        way += 0.04 * np.repeat([module.SPEED_M_S, module.TURN_RAD_S], 3) * steer.read("").direction
        clock.s += 0.04
    return way


def test_the_hand_makes_the_leader_s_motion_and_rests(leader, clock):
    leader.joints |= {"x": 30.0, "yaw": 40.0}  # where it is at first does not count
    with Leader(leader, "so101.urdf") as steer:
        assert not followed(steer, clock).any()
        leader.joints |= {"x": 31.5, "y": -1.0, "yaw": 44.0}
        way = followed(steer, clock)
        np.testing.assert_allclose(way[:3], [0.015, -0.01, 0], atol=module.AT_REST_M / 2)
        np.testing.assert_allclose(way[3:], [0, 0, np.radians(4)], atol=module.AT_REST_RAD / 2)
        assert not steer.read("").direction.any()
        leader.joints["x"] += 0.1  # a tremble
        assert not steer.read("").direction.any()
    assert not leader.is_connected


def test_a_leader_that_is_thrown_moves_the_hand_two_centimeters(leader, clock):
    with Leader(leader, "so101.urdf") as steer:
        leader.joints |= {"x": 50.0, "y": 50.0}
        assert np.linalg.norm(steer.read("").direction) == pytest.approx(1.0)
        assert np.linalg.norm(followed(steer, clock)) < module.SPEED_M_S * module.LAG_S


def test_its_gripper_closes_and_opens_the_hand_once(leader, clock):
    with Leader(leader, "so101.urdf") as steer:
        said = []
        for opened in (100, 55, 45, 39, 45, 55, 61, 100):
            leader.joints["gripper"] = float(opened)
            said.append(steer.read("x").keys)
    assert said == ["x", "x", "x", "xc", "x", "x", "xo", "x"]


@pytest.mark.parametrize("maker", MAKERS)
def test_it_leads_every_arm_while_it_records(leader, monkeypatch, tmp_path, maker):
    body = Body()
    arm, before_m = Arm(MAKERS[maker](body, monkeypatch)), body.position_m
    (tmp_path / f"led_{maker}.py").write_text("make = None")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(f"led_{maker}.make", lambda: Leader(leader, "so101.urdf"))
    ended = iter([False] * 40 + [True])
    monkeypatch.setattr("roboprompt_client.recording.teleop._line", lambda _: "\n" if paced(ended) else "")
    threading.Timer(0.3, leader.joints.update, [{"y": 1.0, "gripper": 0.0}]).start()
    trajectory = record_live(arm, tmp_path / "journal", 50.0, teleop=f"led_{maker}:make")
    moved_m = trajectory.positions_m[-1] - before_m
    assert moved_m[1] > 0.003
    assert np.abs(moved_m[[0, 2]]).max() < 1e-6
    assert trajectory.gripper_open[0] > trajectory.gripper_open[-1]


def paced(ended):
    time.sleep(0.04)
    return next(ended)


def test_one_that_cannot_lead_is_refused(leader, monkeypatch):
    with pytest.raises(InvalidInputError, match="not in degrees"):
        Leader(SO101Leader(use_degrees=False), "so101.urdf")
    leader.is_calibrated = False
    with pytest.raises(MotionError, match="run lerobot-calibrate first"), Leader(leader, "so101.urdf"):
        pass
    assert not leader.is_connected
    leader.is_calibrated = True
    with Leader(leader, "so101.urdf") as steer:
        leader.gone = True
        with pytest.raises(MotionError, match="leader arm: get_action: no status packet from motor 3"):
            steer.read("")
