import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.sim import panda
from app.sim.moves import moves_from_actions, tool_down
from app.sim.planner import Kinematics
from app.sim.robot import SimulatedPanda, TrajectorySampler
from app.sim.tasks import make_task
from app.sim.world import BASE_POSITION_M, HOME_RAD
from roboprompt_client.errors import MotionError
from roboprompt_client.types.poses import EndEffectorAction

TOOL = Kinematics(BASE_POSITION_M)


@pytest.fixture
def robot():
    return SimulatedPanda(make_task("open_drawer", 0), cameras=())


def action(x_m, y_m, z_m, *, gripper_open=True, yaw_rad=0.0):
    return EndEffectorAction([x_m, y_m, z_m], tool_down(yaw_rad).as_quat(), gripper_open)


def joints_rad(robot):
    return np.array([robot.task.data.joint(name).qpos[0] for name in panda.JOINT_NAMES])


def finger_m(robot):
    return float(robot.task.data.joint(panda.FINGER_NAMES[0]).qpos[0])


def test_execute_reaches_the_pose_then_sets_the_gripper(robot):
    wanted = action(0.2, 0.2, 0.95, gripper_open=False, yaw_rad=0.4)
    robot.execute(wanted)
    reached = TOOL.forward(joints_rad(robot))
    assert np.linalg.norm(reached.position_m - wanted.position_m) < 1e-3
    assert (reached.rotation.inv() * Rotation.from_quat(wanted.quaternion_xyzw)).magnitude() < np.radians(0.3)
    assert finger_m(robot) < 1e-3
    robot.execute(action(0.2, 0.1, 0.95))
    assert finger_m(robot) > 0.039


def test_an_unreachable_action_is_named_before_anything_moves(robot):
    actions = [action(0.2, 0.2, 0.95), action(0.2, 0.1, 0.95), action(0.7, 0.5, 1.6)]
    with pytest.raises(MotionError, match="action 3 of 3 is out of the arm's reach"):
        robot.perform(moves_from_actions(actions))
    assert robot.task.data.time == 0
    np.testing.assert_allclose(joints_rad(robot), HOME_RAD, atol=1e-3)


def test_a_blocked_action_is_named(robot):
    done = []
    robot.after_move.append(done.append)
    under_the_table = [action(0.2, 0.2, 0.95), action(0.2, 0.2, 0.65)]
    with pytest.raises(MotionError, match=r"action 2 of 2 did not arrive, .* cm"):
        robot.perform(moves_from_actions(under_the_table))
    assert done == [0]


def test_stop_holds_the_arm_where_it_is(robot):
    with pytest.raises(MotionError):
        robot.perform(moves_from_actions([action(0.2, 0.2, 0.95), action(0.2, 0.2, 0.65)]))
    robot.stop()
    at_stop = joints_rad(robot)
    robot.hold(0.5)
    assert np.abs(joints_rad(robot) - at_stop).max() < 0.01
    robot.execute(action(0.2, 0.1, 0.95))


def test_observe_gives_poses_and_what_its_cameras_see():
    task = make_task("push_button", 1)
    observation = SimulatedPanda(task, cameras=("left_shoulder",)).observe()
    assert [pose.name for pose in observation.objects] == list(task.object_names)
    (frame,) = observation.frames
    assert frame.camera.name == "left_shoulder"
    assert all(np.isin(frame.mask, ids).any() for ids in task.mask_ids().values())


def test_recorder_samples_at_its_rate_what_the_joints_do(robot):
    recorder = TrajectorySampler(robot)
    robot.execute(action(0.2, 0.2, 0.95, gripper_open=False))
    trajectory = recorder.trajectory()
    np.testing.assert_allclose(np.diff(trajectory.timestamps_s), 0.05, atol=1e-9)
    for frame in range(0, len(trajectory), 7):
        pose = TOOL.forward(trajectory.joint_positions_rad[frame])
        np.testing.assert_allclose(trajectory.positions_m[frame], pose.position_m, atol=1e-6)
        turn = Rotation.from_quat(trajectory.quaternions_xyzw[frame]).inv() * pose.rotation
        assert turn.magnitude() < 1e-6
    slopes = np.gradient(trajectory.joint_positions_rad, 0.05, axis=0)
    assert np.abs(slopes - trajectory.joint_velocities_rad_s)[2:-2].max() < 0.15
    # The command closes at once; the fingers take their time.
    assert trajectory.gripper_open[0]
    assert not trajectory.gripper_open[-1]
    assert np.count_nonzero(np.diff(trajectory.gripper_open)) == 1
