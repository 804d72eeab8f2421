"""Motions that pages play."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.services.task_settings import TaskSettings
from app.sim.demonstrate import record_demonstration
from app.sim.world import BASE_POSITION_M
from app.web.play import HAND_M_S, MAX_MOMENTS, planned_motion, recorded_motion, why_without_arm
from roboprompt_client.arms.named import HAND_M, UR_GRIPPER_M
from roboprompt_client.types.trajectory import Trajectory

PANDA = TaskSettings(arm="panda", robot_base=BASE_POSITION_M)
UR5E = TaskSettings(arm="ur5e", robot_base=(0.1, 0.2, 0.3), robot_base_yaw_deg=70)
DOWN = [1.0, 0.0, 0.0, 0.0]


def action(position, gripper_open=True):
    return {"position": position, "quaternion_xyzw": DOWN, "gripper_open": gripper_open}


def asked(*actions, **request):
    return SimpleNamespace(actions=actions, request=request)


def test_the_recorded_arm_ends_where_the_recorded_hand_begins():
    trajectory = record_demonstration("push_button", 0, cameras=()).trajectory
    times_s = np.arange(len(trajectory)) / 20
    motion = recorded_motion(trajectory, times_s, PANDA)
    wrists = np.array(motion["arm"])[:, -1]
    away_m = np.linalg.norm(wrists - np.array(motion["positions"]), axis=1)
    assert away_m == pytest.approx(np.full(len(trajectory), HAND_M), abs=0.005)
    assert recorded_motion(trajectory, times_s, TaskSettings())["arm"] is None
    assert np.array(motion["objects"]) == pytest.approx(trajectory.object_positions_m, abs=1e-4)


def test_a_long_recording_is_thinned_and_keeps_its_ends():
    number = 6000
    line = np.linspace(0, 1, number)[:, None] * [1.0, 0, 0]
    trajectory = Trajectory.from_poses(line, np.tile(DOWN, (number, 1)), np.ones(number, bool))
    motion = recorded_motion(trajectory, np.arange(number) / 100, PANDA)
    assert len(motion["times_s"]) == MAX_MOMENTS
    assert (motion["times_s"][0], motion["times_s"][-1]) == (0, 59.99)
    assert motion["arm"] is None


def test_a_prediction_goes_straight_from_action_to_action():
    place, beside = [0.1, 0.0, 0.9], [0.1, 0.2, 0.9]
    motion = planned_motion(asked(action(place), action(beside), action(beside, gripper_open=False)), TaskSettings())
    first_s, second_s, third_s = motion["marks_s"]
    assert second_s - first_s == pytest.approx(0.2 / HAND_M_S, abs=0.01)
    assert np.ptp(np.array(motion["positions"])[:, [0, 2]], axis=0).tolist() == [0, 0]
    assert motion["open"][motion["times_s"].index(second_s)] is True
    assert motion["open"][motion["times_s"].index(third_s)] is False


def test_the_arm_is_shown_as_far_as_it_gets():
    near, far = [0.2, 0.0, 0.9], [5.0, 0.0, 0.9]
    whole = planned_motion(asked(action(near)), PANDA)
    assert len(whole["arm"]) == len(whole["times_s"])
    part = planned_motion(asked(action(near), action(far)), PANDA)
    assert 0 < len(part["arm"]) < len(part["times_s"])
    assert planned_motion(asked(), PANDA) is None


def test_a_base_that_is_turned_turns_the_arm():
    ready_rad = UR5E.geometry().ready_rad
    joints = np.linspace(ready_rad, ready_rad + 0.3, 5)
    poses = np.array([UR5E.geometry().hand(each) for each in joints])
    turn = Rotation.from_euler("z", 70, degrees=True)
    hands = (turn * Rotation.from_matrix(poses[:, :3, :3])).as_quat()
    positions_m = turn.apply(poses[:, :3, 3]) + UR5E.robot_base
    recorded = Trajectory(np.zeros((5, 6)), positions_m, hands, np.ones(5, bool), joint_positions_rad=joints)
    motion = recorded_motion(recorded, np.arange(5) / 10, UR5E)
    assert np.shape(motion["arm"]) == (5, 8, 3)
    away_m = np.linalg.norm(np.array(motion["arm"])[:, -1] - positions_m, axis=1)
    assert away_m == pytest.approx(np.full(5, UR_GRIPPER_M), abs=1e-3)
    assert why_without_arm(recorded, UR5E) == ""
    assert recorded_motion(recorded, np.arange(5) / 10, PANDA)["arm"] is None
    assert why_without_arm(recorded, PANDA).startswith("The recording has 6 joints, the task's arm 7 joints")
    near = {**action((positions_m[0] + [0.1, 0.1, -0.1]).tolist()), "quaternion_xyzw": hands[0].tolist()}
    planned = planned_motion(asked(near), UR5E)
    assert planned["arm"][0][-1] == pytest.approx(motion["arm"][0][-1], abs=1e-3)
    assert math.dist(planned["arm"][-1][-1], near["position"]) == pytest.approx(UR_GRIPPER_M, abs=2e-3)
