"""From moves to paths of the joints, and from paths to motions: with rests, and along routes without."""

import numpy as np
import pytest

from app.sim import panda
from app.sim.motion import Pace, joined, time_path
from app.sim.moves import move_to, tool_down
from app.sim.planner import Kinematics, Planner
from app.sim.world import BASE_POSITION_M, HOME_RAD, TIMESTEP_S
from roboprompt_client.errors import MotionError

CORNERS_M = np.array([[0.10, -0.10, 0.95], [0.10, -0.10, 0.85], [0.30, -0.10, 0.85], [0.30, 0.15, 0.95]])
ON_LINE_M = 0.002


@pytest.fixture(scope="module")
def kinematics():
    return Kinematics(BASE_POSITION_M)


@pytest.fixture(scope="module")
def planner(kinematics):
    return Planner(kinematics)


def over_table(x_m, y_m, z_m=0.85, yaw_rad=0.0, tilt_rad=0.0, *, straight=True):
    return move_to([x_m, y_m, z_m], tool_down(yaw_rad, tilt_rad), gripper_open=True, straight=straight)


def test_solutions_reach_the_pose_within_the_limits(kinematics):
    random = np.random.default_rng(1)
    for _ in range(5):
        x_m, y_m, yaw_rad = random.uniform([0.0, -0.3, -1.5], [0.4, 0.3, 1.5])
        pose = over_table(x_m, y_m, yaw_rad=yaw_rad).pose
        solutions = [joints for joints, _ in zip(kinematics.solutions(pose, HOME_RAD), range(3), strict=False)]
        assert solutions
        for joints in solutions:
            reached = kinematics.forward(joints)
            assert np.linalg.norm(reached.position_m - pose.position_m) < 1e-3
            assert (reached.rotation.inv() * pose.rotation).magnitude() < np.radians(0.5)
            assert (joints >= panda.JOINT_MIN_RAD - 1e-6).all()
            assert (joints <= panda.JOINT_MAX_RAD + 1e-6).all()


def test_a_straight_move_follows_a_line(planner, kinematics):
    free, line = planner.plan(HOME_RAD, [over_table(0.1, -0.2, straight=False), over_table(0.3, 0.2)])
    assert (free.straight, line.straight) == (False, True)
    motion = time_path(line, kinematics, TIMESTEP_S)
    start, end = np.array([0.1, -0.2, 0.85]), np.array([0.3, 0.2, 0.85])
    direction = (end - start) / np.linalg.norm(end - start)
    for joints in motion.positions_rad[::50]:
        offset = kinematics.forward(joints).position_m - start
        assert np.linalg.norm(offset - offset @ direction * direction) < 1e-3


def test_a_line_that_the_arm_cannot_follow_becomes_a_free_move(planner):
    # From the table's far left to its far right, the line passes through the robot's own base.
    behind = [over_table(-0.3, 0.45, straight=False), over_table(-0.3, -0.45)]
    paths = planner.plan(HOME_RAD, behind)
    assert [path.straight for path in paths] == [False, False]


def test_the_posture_is_chosen_for_the_lines_that_follow(planner):
    rising = [
        over_table(0.25, -0.2, z_m=0.90, yaw_rad=-1.3, tilt_rad=0.6, straight=False),
        over_table(0.25, -0.2, z_m=0.82, yaw_rad=-1.3, tilt_rad=0.6),
        over_table(0.20, -0.05, z_m=0.82, yaw_rad=-1.3, tilt_rad=0.6),
    ]
    assert [path.straight for path in planner.plan(HOME_RAD, rising)] == [False, True, True]


def test_an_unreachable_pose_is_named(planner):
    moves = [over_table(0.2, 0.0), over_table(1.5, 0.0), over_table(0.2, 0.1)]
    with pytest.raises(MotionError, match=r"action 2 of 3 .* position \[1\.500, 0\.000, 0\.850\] m"):
        planner.plan(HOME_RAD, moves)


def test_motions_respect_the_limits_and_end_at_rest(planner, kinematics):
    moves = [over_table(0.35, 0.3, straight=False), over_table(0.1, -0.3, yaw_rad=1.0)]
    for path in planner.plan(HOME_RAD, moves):
        motion = time_path(path, kinematics, TIMESTEP_S)
        assert (np.abs(motion.velocities_rad_s) <= panda.MAX_VELOCITY_RAD_S).all()
        acceleration = np.diff(motion.velocities_rad_s, axis=0) / TIMESTEP_S
        assert (np.abs(acceleration[:-1]) <= panda.MAX_ACCELERATION_RAD_S2).all()
        np.testing.assert_allclose(motion.positions_rad[-1], path.end_rad, atol=1e-9)
        np.testing.assert_allclose(motion.velocities_rad_s[-1], 0, atol=1e-6)


@pytest.fixture(scope="module")
def paths(planner):
    moves = [move_to(at, tool_down(), gripper_open=True, straight=at is not CORNERS_M[0]) for at in CORNERS_M]
    _, *lines = planner.plan(HOME_RAD, moves)
    return lines


def tool_m(kinematics, joints_rad):
    return np.array([kinematics.forward(joints).position_m for joints in joints_rad])


@pytest.mark.parametrize("within_m", [0.001, 0.01, 0.03])
def test_corners_are_passed_as_closely_as_asked(kinematics, paths, within_m):
    route = joined(paths, [within_m, within_m], kinematics)
    points = tool_m(kinematics, route.joints_rad)
    away_m = [np.linalg.norm(points - corner, axis=1).min() for corner in CORNERS_M]
    assert away_m[0] < 1e-3
    assert away_m[3] < 1e-3
    assert all(0.2 * within_m < distance_m < within_m + 1e-3 for distance_m in away_m[1:3])
    assert route.ends_m[:2] == pytest.approx([0.1, 0.3], abs=2e-3)
    assert (np.diff(route.along_m) > 0).all()


def test_between_its_corners_a_route_is_straight(kinematics, paths):
    route = joined(paths, [0.01, 0.01], kinematics)
    points = tool_m(kinematics, route.joints_rad)
    middle = (route.along_m > 0.15) & (route.along_m < 0.25)
    assert np.abs(points[middle][:, 1:] - CORNERS_M[1, 1:]).max() < ON_LINE_M


@pytest.fixture(scope="module")
def route(kinematics, paths):
    return joined(paths, [0.02, 0.01], kinematics)


def pace(route, speed_m_s=0.3):
    return Pace(route, np.full(len(route.along_m), speed_m_s), TIMESTEP_S)


def test_motions_stay_within_the_limits_up_to_the_jerk(route):
    motion = pace(route).motion
    rates = [np.diff(motion.positions_rad, n, axis=0) / TIMESTEP_S**n for n in (1, 2, 3)]
    limits = (panda.MAX_VELOCITY_RAD_S, panda.MAX_ACCELERATION_RAD_S2, panda.MAX_JERK_RAD_S3)
    for rate, limit, share in zip(rates, limits, (0.5, 0.5, 0.1), strict=True):
        assert (np.abs(rate) <= share * limit).all()
    assert np.abs(rates[0] - motion.velocities_rad_s[:-1]).max() < 0.02
    np.testing.assert_allclose(motion.positions_rad[[0, -1]], route.joints_rad[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(motion.velocities_rad_s[[0, -1]], 0, atol=1e-3)
